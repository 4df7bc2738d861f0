// Completion of the names in an expression: a list below the field, by the word before the caret.

const MATCHES = 12, WORD = /[A-Za-z_][\w.[\],]*$/;

// functions and signals that match a word: those that begin with it, then those that contain it
function matches(word) {
  const wanted = word.toLowerCase(), names = [...about.functions.map((one) => `${one}(`), ...about.signals.map((one) => one.name)];
  const found = names.filter((name) => name.toLowerCase().includes(wanted) && name !== word);
  return found.sort((a, b) => b.toLowerCase().startsWith(wanted) - a.toLowerCase().startsWith(wanted)).slice(0, MATCHES);
}

function completes(input) {
  const list = input.parentElement.appendChild(element("div", "", { className: "matches", hidden: true, role: "listbox" }));
  let chosen = -1;
  for (const [name, value] of [["role", "combobox"], ["autocomplete", "off"], ["aria-expanded", "false"], ["aria-autocomplete", "list"]]) input.setAttribute(name, value);
  const word = () => WORD.exec(input.value.slice(0, input.selectionStart))?.[0] ?? "";
  const shut = () => { list.hidden = true; chosen = -1; input.setAttribute("aria-expanded", "false"); };
  const mark = () => [...list.children].forEach((one, k) => { one.setAttribute("aria-selected", k === chosen); if (k === chosen) one.scrollIntoView({ block: "nearest" }); });
  const take = (name) => {
    const end = input.selectionStart, begin = end - word().length;
    input.setRangeText(name, begin, end, "end");
    shut();
    input.focus();
  };
  input.addEventListener("input", () => {
    const found = word() ? matches(word()) : [];
    list.replaceChildren(...found.map((name) => {
      const one = button(name, () => take(name), { className: "match", tabIndex: -1 });
      one.append(element("span", signals.get(name)?.unit ?? "", { className: "twin-unit" }));
      one.setAttribute("role", "option");
      one.onpointerdown = (event) => event.preventDefault(); // the field keeps the focus
      return one;
    }));
    list.hidden = !found.length;
    input.setAttribute("aria-expanded", found.length > 0);
    chosen = -1;
  });
  input.addEventListener("keydown", (event) => {
    if (list.hidden) return;
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (step) chosen = (chosen + step + list.children.length) % list.children.length;
    else if (event.key === "Escape") shut();
    else if (event.key === "Tab" || (event.key === "Enter" && chosen >= 0)) take(list.children[Math.max(chosen, 0)].firstChild.textContent);
    else return;
    event.preventDefault();
    mark();
  });
  input.addEventListener("blur", shut);
  input.form.addEventListener("submit", shut);
}

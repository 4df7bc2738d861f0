// Tables of reports that sort and filter.
for (const box of document.querySelectorAll("section:has(.matrix)")) {
  const body = box.querySelector(".matrix tbody"), heads = [...box.querySelectorAll(".matrix th")];
  const [word, only] = box.querySelectorAll("input"), rows = [...body.rows], value = (row, at) => row.cells[at].dataset.value ?? row.cells[at].textContent;
  const words = row => [...row.cells].filter(cell => !cell.classList.contains("number")).map(cell => cell.textContent).join(" ").toLowerCase();
  const more = box.querySelector(".more");  // a long table shows its first rows
  let limit = more ? 20 : Infinity;
  const filter = () => {
    const found = rows.filter(row => (row.classList.contains("bad") || !only.checked) && words(row).includes(word.value.toLowerCase())), shown = new Set(found.slice(0, limit));
    for (const row of rows) row.hidden = !shown.has(row);
    box.querySelector("[aria-live]").textContent = shown.size + " of " + rows.length;
    if (more) Object.assign(more, { hidden: found.length <= limit, textContent: `Show all ${found.length} rows` });
  };
  more?.addEventListener("click", () => { limit = Infinity; filter(); });
  heads.forEach((head, at) => head.querySelector("button").addEventListener("click", () => {
    const down = head.ariaSort === "ascending" ? -1 : 1;
    heads.forEach(other => other.ariaSort = other === head ? (down === 1 ? "ascending" : "descending") : "none");
    const order = (a, b) => isNaN(a) || isNaN(b) ? a.localeCompare(b) : a - b;
    // rows without a value stay last in both orders
    rows.sort((a, b) => (value(a, at) === "") - (value(b, at) === "") || down * order(value(a, at), value(b, at)));
    body.append(...rows);
    filter();
  }));
  word.addEventListener("input", filter);
  only.addEventListener("change", filter);
  filter();
}

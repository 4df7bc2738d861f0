// Panels around the chart: signals by member, cases, plots, cursors, expectations, events; the menu of a pane.

function element(tag, text, more = {}) { return Object.assign(document.createElement(tag), { textContent: text, ...more }); }
function button(text, onclick, more = {}) { return element("button", text, { type: "button", onclick, ...more }); }

// ---- changes of the state

function add(name, place) {
  const unit = unitOf(name), fits = (one) => one.kind === "time" && (one.items.length === 0 || (unit !== undefined && unitOf(one.items[0].signal) === unit));
  const wanted = state.panes[place ?? state.panes.length - 1];
  if (wanted && wanted.kind === "xy" && place !== undefined && wanted.items.length === 0) wanted.items.push({ signal: name, minus: null });
  else {
    const found = wanted && fits(wanted) ? wanted : place === undefined ? state.panes.findLast(fits) : undefined;
    if (!found) state.panes.splice(place === undefined || place < 0 ? state.panes.length : place + 1, 0, pane([name]));
    else if (!found.items.some((item) => item.signal === name && item.minus === null)) found.items.push({ signal: name, minus: null });
  }
  show();
}

function away(index, item) {
  const one = state.panes[index];
  one.items = one.items.filter((each) => each.signal !== item.signal || each.minus !== item.minus);
  if (!one.items.length) state.panes.splice(index, 1);
  show();
}

function toggle(name) {
  const index = state.panes.findIndex((one) => one.kind === "time" && one.items.some((item) => item.signal === name && item.minus === null));
  if (index < 0) add(name); else away(index, { signal: name, minus: null });
}

function after(index, made) { state.panes.splice(index + 1, 0, made); show(); }

// ---- the menu of a pane

function menu(index) {
  const one = state.panes[index], found = element("details", "", { className: "menu" }), list = element("div", "");
  found.append(element("summary", "⋯", { title: "Spectrum, difference, x-y, remove", ariaLabel: "more" }), list);
  const entry = (text, act) => list.append(button(text, act));
  const items = () => one.items.map((item) => ({ ...item }));
  if (one.kind === "time") {
    entry("Spectrum of the visible window", () => after(index, { kind: "spectrum", items: items() }));
    if (one.items.every((item) => item.minus === null)) {
      const less = (minus) => after(index, { kind: "time", items: items().map((item) => ({ ...item, minus })) });
      if (about.runs.length > 1) about.runs.forEach((run) => entry(`Difference from run ${run.letter}, case by case`, () => less(run.letter)));
      if (state.cases.length > 1) state.cases.forEach((k) => entry(`Difference from ${about.cases[k].label}`, () => less(k)));
    }
    const form = element("form", ""), input = element("input", "", { placeholder: "plot against signal ..." });
    input.setAttribute("list", "names");
    form.append(input, element("button", "Add"));
    form.onsubmit = (event) => { event.preventDefault(); if (input.value.trim()) after(index, { kind: "xy", items: items(), x: input.value.trim() }); };
    list.append(form);
  }
  list.append(ranged(one));
  if (index > 0) entry("Move up", () => { state.panes.splice(index - 1, 0, ...state.panes.splice(index, 1)); show(); });
  entry("Remove", () => { state.panes.splice(index, 1); show(); });
  return found;
}

// form for the vertical range of a pane; empty: range of the visible samples
function ranged(one) {
  const form = element("form", ""), edges = [0, 1].map((k) => element("input", "", { placeholder: k ? "highest" : "lowest", inputMode: "decimal", value: one.range?.[k] ?? "" }));
  form.append(...edges, element("button", "Set"));
  form.onsubmit = (event) => {
    event.preventDefault();
    const range = edges.map((each) => each.value.trim());
    one.range = range.every((each) => each !== "" && Number.isFinite(+each)) && +range[1] > +range[0] ? range.map(Number) : undefined;
    show();
  };
  return form;
}

// ---- panels

function panels() { ticked(); cases(); cursors(); expectations(); events(); }

function tree() {
  const words = find("search").value.toLowerCase().split(/\s+/).filter(Boolean), members = new Map();
  let count = 0;
  for (const one of about.signals) {
    const text = `${one.name} ${one.unit} ${one.about}`.toLowerCase();
    if (!words.every((word) => text.includes(word))) continue;
    count++;
    const at = one.name.replace(/\[[\d,]+\]$/, "").lastIndexOf("."), member = one.name.slice(0, Math.max(at, 0));
    if (!members.has(member)) members.set(member, []);
    members.get(member).push([one.name.slice(at + 1), one]);
  }
  find("count").textContent = count === about.signals.length ? `${count}` : `${count} of ${about.signals.length}`;
  find("tree").replaceChildren(...[...members].map(([member, own]) => {
    const found = element("details", "", { open: words.length > 0 && count < 300 }), list = element("div", "");
    found.append(element("summary", member || "signals"), list);
    const fill = () => { if (!list.childElementCount) list.append(...own.map(([short, one]) => leaf(short, one))); ticked(); };
    found.ontoggle = () => { if (found.open) fill(); };
    if (found.open) fill();
    return found;
  }));
}

function leaf(short, one) {
  const found = button("", () => toggle(one.name), { className: "leaf", title: [one.name, one.about].filter(Boolean).join(": "), draggable: true });
  found.dataset.name = one.name;
  found.append(element("span", short), element("span", one.unit, { className: "twin-unit" }));
  found.ondragstart = (event) => event.dataTransfer.setData("text/plain", one.name);
  return found;
}

function ticked() {
  const shown = new Set(state.panes.flatMap((one) => one.items.map((item) => item.signal)));
  for (const one of find("tree").querySelectorAll(".leaf")) one.setAttribute("aria-pressed", shown.has(one.dataset.name));
}

function cases() {
  find("chosen").textContent = `${state.cases.length} of ${about.cases.length} shown`;
  const list = find("cases").querySelector("div");
  const scrolled = [...list.querySelectorAll(".grid")].map((one) => one.scrollTop);
  list.replaceChildren(...about.runs.flatMap((run, r) => {
    const heading = element("div", "", { className: "run" }), grid = element("div", "", { className: "grid" }), table = element("table", "");
    heading.append(element("b", about.runs.length > 1 ? `${run.letter}  ` : ""), `${run.name} `, element("span", [run.folder, ...run.overrides].join(", "), { className: "twin-soft" }));
    if (about.runs.length > 1) {
      const input = element("input", "", { size: 6, value: state.offsets[r], inputMode: "decimal", title: "by how much the run is moved in time, to align it with others" });
      input.onchange = () => { if (Number.isFinite(+input.value)) { state.offsets[r] = +input.value; show(); } };
      const label = element("label", "", { className: "twin-soft" });
      label.append(" moved by ", input, " s");
      heading.append(element("br", ""), label);
    }
    for (const variant of new Set(about.cases.filter((one) => one.run === r).map((one) => one.variant))) {
      if (about.embedded && !about.shown.some((k) => about.cases[k].run === r && about.cases[k].variant === variant)) continue;
      const row = table.insertRow();
      row.insertCell().textContent = variant;
      const seeds = row.insertCell();
      about.cases.forEach((one, k) => {
        if (one.run !== r || one.variant !== variant || (about.embedded && !about.shown.includes(k))) return;
        const chosen = button(one.seed, () => { state.cases = chosen.ariaPressed === "true" ? state.cases.filter((each) => each !== k) : [...state.cases, k]; show(); }, { className: "seed", title: `${one.label}: ${one.samples} samples` });
        chosen.setAttribute("aria-pressed", state.cases.includes(k));
        seeds.append(chosen);
      });
    }
    grid.append(table);
    return [heading, grid];
  }));
  list.querySelectorAll(".grid").forEach((one, k) => { one.scrollTop = scrolled[k] || 0; });
}

function plots() {
  const there = (name) => !about.embedded || about.embedded.some((one) => one.signal === name);
  const own = about.plots.filter((plot) => [...plot.signals, plot.x].filter(Boolean).every(there));
  find("plots").hidden = !own.length;
  find("plots").querySelector("div").replaceChildren(...own.map((plot) => button(plot.title, () => {
    state.panes.push(ofPlot(plot));
    show();
  })));
}

async function cursors() {
  const [a, b] = state.cursors, box = find("cursors"), lines = [...curves.values()].filter((line) => line.spec.kind === "time");
  box.hidden = a === undefined;
  if (a === undefined) return;
  const times = lines.map(({ spec }) => state.cursors.map((time) => time - offset(spec.case)));
  let values = [];
  try { values = await source.values(lines.map(({ spec }) => ({ ...spec, window: [0, 1] })), times); } catch { values = lines.map(() => []); }
  if (state.cursors[0] !== a || state.cursors[1] !== b) return;
  const table = element("table", ""), row = (cells, tag = "td") => { const made = table.insertRow(); cells.forEach((text) => made.append(element(tag, text))); return made; };
  row(["", "A", "B", "B − A", "1 / (B − A)"], "th");
  row(["time", `${digits(a)} s`, b === undefined ? "" : `${digits(b)} s`, b === undefined ? "" : `${digits(b - a)} s`, b === undefined || b === a ? "" : `${digits(1 / (b - a))} Hz`]);
  lines.forEach((line, k) => {
    const [one, two] = values[k] || [], unit = heads.get(line.name)?.unit ?? "", text = (value) => (value === null || value === undefined ? "–" : `${digits(value)} ${unit}`);
    const made = row(["", text(one), b === undefined ? "" : text(two), b === undefined || one === null || two === null ? "" : text(two - one), ""]);
    const swatch = element("i", "");
    swatch.style.background = `var(--line-${line.color})`;
    made.firstChild.append(swatch, `${line.spec.signal}${lessOf(line.item.minus)}, ${about.cases[line.spec.case].label}`);
  });
  box.replaceChildren(table);
}

function expectations() {
  const box = find("expectations"), order = (one) => (one.verdict === "fail" ? 0 : 1), rows = about.expectations.toSorted((a, b) => order(a) - order(b)).map((one) => {
    const found = button("", () => goTo(one), { className: "outcome", disabled: !one.signal || (!!about.embedded && !about.embedded.some((each) => each.signal === one.signal || each.head.key === one.signal)) });
    const label = element("span", "");
    label.append(element("b", (about.runs.length > 1 ? `${about.runs[one.run].letter}: ` : "") + one.name), one.detail && one.detail !== one.name ? `: ${one.detail}` : "");
    found.append(element("b", one.verdict === "fail" ? "FAIL" : one.verdict, { className: one.verdict }), label);
    return found;
  });
  const failed = about.expectations.filter((one) => one.verdict === "fail").length, problem = about.runs.map((run) => run.problem).filter(Boolean);
  box.hidden = !rows.length && !problem.length;
  box.querySelector("summary").textContent = rows.length && about.expectations.every((one) => one.verdict === "open") ? `Expectations: ${rows.length}, judged at the end` : failed ? `Expectations: ${failed} of ${rows.length} failed` : `Expectations: ${rows.length}, none failed`;
  box.querySelector("div").replaceChildren(...problem.map((text) => element("p", text, { className: "twin-soft" })), ...rows);
}

// show the signal of an expectation; of a failed one, its first failed span
function goTo(one) {
  const curve = about.embedded?.find((each) => each.signal === one.signal || each.head.key === one.signal);
  const name = curve ? curve.signal : one.signal;
  const seen = state.panes.some((each) => each.kind === "time" && each.items.some((item) => item.minus === null && (item.signal === name || heads.get(item.signal)?.key === one.signal)));
  if (!seen) state.panes.unshift(pane([name]));
  const bad = Object.keys(one.spans).map(Number);
  if (bad.length) {
    if (!bad.some((k) => state.cases.includes(k))) state.cases = [...state.cases, bad[0]];
    const [from, to] = one.spans[bad.find((k) => state.cases.includes(k))][0], [low, high] = extentOf(), move = state.offsets[one.run];
    const margin = Math.max((to - from) * 0.5, (high - low) * 0.02);
    state.window = [Math.max(from + move - margin, low), Math.min(to + move + margin, high)];
  }
  show();
  find("drawing").scrollIntoView({ block: "nearest" });
}

function events() {
  const found = marks();
  find("events").hidden = !found.length;
  find("events").querySelector("summary").textContent = `Events: ${found.length}`;
  find("events").querySelector("div").replaceChildren(...found.map(({ at, text }) => {
    const row = button("", () => { const [low, high] = state.window || extentOf(), half = Math.min((high - low) / 2, 0.5 * (extentOf()[1] - extentOf()[0]) / 20 + (high - low) / 20); state.window = [at - half, at + half]; show(); }, { className: "outcome" });
    row.append(element("b", `${digits(at)} s`), element("span", text));
    return row;
  }));
}

find("search").oninput = tree;
find("expression").onsubmit = (event) => {
  event.preventDefault();
  const input = event.target.querySelector("input");
  if (input.value.trim()) { state.panes.push(pane([input.value.trim()])); input.value = ""; show(); }
};
find("names").append(...about.signals.slice(0, 3000).map((one) => element("option", "", { value: one.name })));
if (about.embedded) find("expression").hidden = true;
if (innerWidth < 760) for (const id of ["signals", "cases"]) find(id).open = false;
begin();
if (about.growing && !about.embedded) followed();
tree();
plots();

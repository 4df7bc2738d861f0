// Panels around the chart: signals by member, cases, plots; the menu of a pane; the field for new plots.

function element(tag, text, more = {}) { return Object.assign(document.createElement(tag), { textContent: text, ...more }); }
function button(text, onclick, more = {}) { return element("button", text, { type: "button", onclick, ...more }); }

const MOST = 50, MANY = 3; // variants in which an expression is tried; overridden values that are shown at once

// ---- changes of the state

// scroll to a pane, of a split one to the first
function reveal(place) {
  chart.legends.children[shown.findIndex((one) => one.place === place)]?.scrollIntoView({ block: "start" });
}

function add(name, place) {
  const unit = unitOf(name), fits = (one) => one.kind === "time" && (one.items.length === 0 || (unit !== undefined && unitOf(one.items[0].signal) === unit));
  const wanted = state.panes[place ?? state.panes.length - 1];
  if (wanted && wanted.kind === "xy" && place !== undefined && wanted.items.length === 0) wanted.items.push({ signal: name, minus: null });
  else {
    const found = wanted && fits(wanted) ? wanted : place === undefined ? state.panes.findLast(fits) : undefined;
    if (!found) { after(place === undefined || place < 0 ? state.panes.length - 1 : place, pane([name])); return; }
    if (!found.items.some((item) => item.signal === name && item.minus === null)) found.items.push({ signal: name, minus: null });
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

function after(index, made) { state.panes.splice(index + 1, 0, { facet: "", weights: [], ...made }); show(); reveal(index + 1); }

// ---- signals and expressions that cannot be drawn

// why a plot can be drawn in none of the shown variants; empty if it can
async function refusal(kind, signal, x = "") {
  const groups = groupsOf(state.cases.length ? state.cases : [0], true).slice(0, MOST), specs = groups.map(({ cases: [number] }) => (
    { kind, signal, x, case: number, minus: null, shift: 0, seeds: [], part: "mean", window: windowOf().map((time) => time - offset(number)) }));
  try {
    const lines = await source.lines(specs, 16), good = lines.filter((line) => !line.head.error);
    return !good.length ? lines[0].head.error : good.every(({ y }) => y.length && !y.some(Number.isFinite)) ? `${signal}: has no finite value in the visible time.` : "";
  } catch (error) { return error.message; }
}

const numberOf = ({ value }) => (value.trim() ? Number(value) : NaN);

// mark a field as invalid, with the reason at the end of its form; without a reason, as valid
function refuse(input, reason) {
  const form = input.closest("form, .run, #playback");
  input.setAttribute("aria-invalid", !!reason);
  form.querySelector(".wrong")?.remove();
  if (reason) form.append(element("small", reason, { className: "wrong", role: "alert" }));
}

// ---- the menu of a pane

function menu(index) {
  const one = state.panes[index], found = element("details", "", { className: "menu" }), list = element("div", "");
  found.append(element("summary", "Analyze", { title: "Spectrum, x-y plot, difference, split by variant, range, remove" }), list);
  const entry = (text, act) => list.append(button(text, act));
  const items = () => one.items.map((item) => ({ ...item }));
  if (one.kind === "time") {
    entry("Spectrum of the visible window", () => after(index, { kind: "spectrum", items: items() }));
    const form = element("form", ""), input = element("input", "", { placeholder: "x-y plot: over signal", ariaLabel: "x-y plot: over signal" });
    form.append(element("span", "", { className: "field" }), element("button", "Add"));
    form.firstChild.append(input);
    completes(input);
    form.onsubmit = async (event) => {
      event.preventDefault();
      const x = input.value.trim(), reason = x && await refusal("time", x);
      if (reason) refuse(input, reason); else if (x) after(index, { kind: "xy", items: items(), x });
    };
    list.append(form);
  }
  for (const [facet, text] of [["", "One pane"], ["variant", "A pane for each variant"], ["run", "A pane for each run"]]) {
    const parts = new Set(state.cases.map((k) => about.cases[k][facet || "variant"])).size;
    if (one.facet !== facet && (facet === "" || parts > 1)) entry(text, () => { one.facet = facet; one.weights = []; show(); });
  }
  list.append(ranged(one));
  if (index > 0) entry("Move up", () => { state.panes.splice(index - 1, 0, ...state.panes.splice(index, 1)); show(); });
  entry("Remove", () => { state.panes.splice(index, 1); show(); });
  if (one.variants) entry("Show all variants", () => { delete one.variants; show(); });
  if (one.kind === "time" && one.items.every((item) => item.minus === null)) list.append(...differences(index, items()));
  return found;
}

// a choice of what is subtracted from the signals of a pane: a run, or of each run a variant; a case where seeds are shown separately
function differences(index, items) {
  const variants = [...new Set(state.cases.map((k) => about.cases[k].variant))], choices = about.runs.length > 1 ? about.runs.map(({ letter: run }) => [run, `run ${run}, case by case`]) : [];
  if (state.band && variants.length > 1) choices.push(...variants.map((variant) => [`=${variant}`, `${variant}, seed by seed`]));
  else if (state.cases.length > 1) choices.push(...state.cases.map((k) => [k, about.cases[k].label]));
  if (!choices.length) return [];
  const select = element("select", "", { ariaLabel: "difference from" });
  select.append(element("option", "Difference from ..."), ...choices.map(([, text]) => element("option", text)));
  select.onchange = () => after(index, { kind: "time", items: items.map((item) => ({ ...item, minus: choices[select.selectedIndex - 1][0] })) });
  return [select];
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

function panels() { following(); ticked(); cases(); tabulate(); expectations(); metrics(); events(); }

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
  if (!count) find("tree").replaceChildren(element("p", `No recorded signal matches \u201c${find("search").value}\u201d. Parameters are listed in the report.`, { className: "twin-soft" }));
  else find("tree").replaceChildren(...[...members].map(([member, own]) => {
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

function folded(title, text) {
  const found = element("details", "", { className: "twin-soft" });
  found.append(element("summary", title), element("pre", text));
  return found;
}

// letter and line of a run among several, its name, folder and overridden values
const nameOf = (run, r = about.runs.indexOf(run)) => [...(about.runs.length > 1 ? [element("b", `${run.letter} `), swatch({ color: 7, ...lineOf(r) }), " "] : []), `${run.name} `, element("span", [run.folder, ...(run.overrides.length > MANY ? [] : run.overrides)].join(", "), { className: "twin-soft" }), ...(run.overrides.length > MANY ? [folded(`${run.overrides.length} changed values`, run.overrides.join("\n").replace(/-?\d+\.\d{6,}(e-\d+)?/g, (value) => digits(+value)))] : [])];

function cases() {
  const all = about.embedded ? about.shown : about.cases.map((_, k) => k);
  find("chosen").textContent = `${state.cases.length} of ${all.length} shown${seedsNotHere()}`;
  find("some").hidden = state.cases.length >= all.length && !shown.some(({ hidden }) => hidden.length);
  find("some").textContent = state.cases.length < all.length ? "Show all" : "Show all in each pane";
  find("some").title = `At first up to ${GROUPS} curves a signal are shown, so that they can be told apart`;
  find("some").onclick = () => { state.cases = all; for (const one of state.panes) delete one.variants; show(); };
  const list = find("cases").querySelector("div"), seeds = groupsOf(all, true).some((group) => group.cases.length > 1);
  find("together").hidden = !seeds;
  find("band").checked = state.band;
  const scrolled = [...list.querySelectorAll(".grid")].map((one) => one.scrollTop);
  list.replaceChildren(...about.runs.flatMap((run, r) => {
    const heading = element("div", "", { className: "run" }), grid = element("div", "", { className: "grid" }), table = element("table", "");
    heading.append(...nameOf(run));
    if (about.runs.length > 1) {
      const input = element("input", "", { size: 6, value: state.offsets[r], inputMode: "decimal", title: "by how much the run is moved in time, to align it with others" });
      input.onchange = () => { const by = numberOf(input); if (Number.isFinite(by)) { state.offsets[r] = by; show(); } else refuse(input, "A number in s, such as 0.5."); };
      const label = element("label", "", { className: "twin-soft" });
      label.append(" moved by ", input, " s");
      heading.append(element("br", ""), label);
    }
    for (const variant of new Set(about.cases.filter((one) => one.run === r).map((one) => one.variant))) {
      if (about.embedded && !about.shown.some((k) => about.cases[k].run === r && about.cases[k].variant === variant)) continue;
      const row = table.insertRow();
      const own = about.cases.flatMap((one, k) => (one.run === r && one.variant === variant && (!about.embedded || about.shown.includes(k)) ? [k] : [])), all = own.every((k) => state.cases.includes(k));
      row.insertCell().append(button(variant, () => { state.cases = all ? state.cases.filter((k) => !own.includes(k)) : [...new Set([...state.cases, ...own])]; show(); }, { className: "variant", title: all ? `Hide all seeds of ${variant}` : `Show all seeds of ${variant}` }));
      const buttons = row.insertCell();
      about.cases.forEach((one, k) => {
        if (one.run !== r || one.variant !== variant || (about.embedded && !about.shown.includes(k))) return;
        const chosen = button(one.seed > 9999 ? "seed" : one.seed, () => { state.cases = chosen.ariaPressed === "true" ? state.cases.filter((each) => each !== k) : [...state.cases, k]; show(); }, { className: "seed", title: `${one.label}: ${one.samples} samples` });
        chosen.setAttribute("aria-pressed", state.cases.includes(k));
        buttons.append(chosen);
      });
    }
    grid.append(table);
    return [heading, grid];
  }));
  list.querySelectorAll(".grid").forEach((one, k) => { one.scrollTop = scrolled[k] || 0; });
}

// links to the cases of a study that were kept with their signals; what is shown stays
function study() {
  if (!about.study) return;
  const { name, current, cases: kept } = about.study, box = find("study");
  box.hidden = false;
  box.querySelector("summary").textContent = `Cases of ${name}: ${kept.length} kept`;
  box.querySelector("div").replaceChildren(...kept.map(({ number, passed }) => {
    const link = element("a", `${number}${passed === false ? " ✗" : ""}`, { className: "seed", href: `?case=${number}`, title: `Case ${number}${passed === false ? ": failed" : passed ? ": passed" : ""}` });
    link.onclick = () => { link.hash = address(); };
    if (number === current) link.setAttribute("aria-current", "page");
    return link;
  }));
}

function plots() {
  const own = about.plots.filter(isDrawable);
  find("plots").hidden = !own.length;
  find("plots").querySelector("div").replaceChildren(...own.map((plot) => button(plot.title, () => {
    state.panes.push(ofPlot(plot));
    state.cases = withVariants(state.cases, state.panes.at(-1).variants);
    const own = windowOfPlots([plot], state.cases), [from, to] = windowOf();
    if (own && (own[0] >= to || own[1] <= from)) state.window = own; // nothing of it would be seen
    show();
    reveal(state.panes.length - 1);
  })));
}

// ---- new plots

document.addEventListener("input", ({ target }) => { if (target.getAttribute("aria-invalid") === "true") refuse(target, ""); }); // the reason was of another text
find("search").oninput = tree;
find("band").onchange = () => { state.band = find("band").checked; show(); };
find("kind").onchange = () => {
  const isXy = find("kind").value === "xy";
  find("across").hidden = !isXy;
  find("signal").placeholder = isXy ? "signal" : "signal or expression, as abs(a.x - b.x)";
};
find("new").onsubmit = async (event) => {
  event.preventDefault();
  const [kind, signal, x] = ["kind", "signal", "x"].map((id) => find(id).value.trim());
  if (!signal || (kind === "xy" && !x)) { find(signal ? "x" : "signal").focus(); return; }
  for (const [id, ...wanted] of [["signal", "time", signal], ...(kind === "xy" ? [["x", "time", x]] : []), ["signal", kind, signal, kind === "xy" ? x : ""]]) {
    const reason = await refusal(...wanted);
    if (reason) { refuse(find(id === "x" ? "signal" : "x"), ""); refuse(find(id), reason); return; }
  }
  find("signal").value = find("x").value = "";
  after(state.panes.length - 1, pane([signal], kind === "xy" ? { kind, x } : { kind }));
};
for (const id of ["signal", "x"]) completes(find(id));
if (about.embedded) { find("playback").append(find("all"), find("undo")); find("new").parentElement.hidden = true; }
find("expectations").open = about.expectations.some((one) => !["pass", "skipped"].includes(one.verdict)) || !about.metrics.length;
if (about.following) find("values").open = false; // room for the chart
if (innerHeight <= LOW && innerWidth > NARROW) for (const id of ["scene", "values"]) find(id).open = false;
for (const [width, ids] of [[MIDDLE, ["signals"]], [NARROW, ["cases", "metrics", "values"]]]) if (innerWidth <= width) for (const id of ids) find(id).open = false;
begin();
if (about.growing && !about.embedded) followed();
tree();
plots();
if (about.runs.length > 1) find("runs").append(...about.runs.map((run) => { const own = element("span", ""); own.append(...nameOf(run)); return own; }));
study();

// The page: `state` defines what is shown and is stored in the URL; everything else follows from it.
//
//   panes:   [{kind: "time" | "xy" | "spectrum", items: [{signal, minus}], x, plot, range}]; minus: a case's number, or a run's as "A"
//   cases:   numbers of the shown cases       window: [from, to] or null       cursors: [a, b]
//   offsets: shift of each run in time [s]

const about = JSON.parse(document.getElementById("about").textContent);
const source = about.embedded ? new EmbeddedSource(about) : new ServerSource();
const signals = new Map(about.signals.map((one) => [one.name, one]));
const heads = new Map(); // of a signal: its units and how it is drawn, once it was read
const HEIGHT = 190, DASHES = [[], [6, 3], [2, 2], [8, 3, 2, 3]];
const KEYS = { ArrowLeft: [-0.2, -0.2], ArrowRight: [0.2, 0.2], "+": [0.2, -0.2], "-": [-0.33, 0.33] }; // by how much of the window its ends move
const AGAIN = 1000; // polling period of a run in progress [ms]
const find = (id) => document.getElementById(id);
const hint = find("message").textContent;
let state, chart, curves = new Map();

// ---- state and URL

function first() {
  const seen = new Set(), firsts = about.cases.flatMap(({ run, variant }, k) => (seen.has(`${run} ${variant}`) ? [] : (seen.add(`${run} ${variant}`), [k])));
  const found = { panes: [], cases: about.shown.length ? about.shown : firsts, window: null, cursors: [], offsets: about.runs.map(() => 0) };
  const failed = about.expectations.find((one) => one.verdict === "fail" && Object.keys(one.spans).length);
  found.cases = found.cases.slice(0, 6);
  if (about.shown_signals.length) found.panes = together(about.shown_signals);
  else if (failed) {
    found.panes = [pane([failed.signal])];
    found.cases = [...new Set([...Object.keys(failed.spans).map(Number).slice(0, 3), ...found.cases])].slice(0, 6);
  } else found.panes = about.plots.slice(0, 2).map(ofPlot);
  return found;
}

const pane = (names, more = {}) => ({ kind: "time", items: names.map((signal) => ({ signal, minus: null })), ...more });
const ofPlot = (plot) => pane(plot.signals, plot.x ? { kind: "xy", x: plot.x, plot: plot.title } : { plot: plot.title });

// signals of one unit in one pane
function together(names) {
  const panes = new Map();
  for (const name of names) {
    const unit = unitOf(name) ?? name;
    if (!panes.has(unit)) panes.set(unit, pane([]));
    panes.get(unit).items.push({ signal: name, minus: null });
  }
  return [...panes.values()];
}

function remembered() {
  try {
    const saved = JSON.parse(decodeURIComponent(location.hash.slice(1)));
    const whole = (value) => Number.isInteger(value) && value >= 0 && value < about.cases.length;
    const pair = (value) => Array.isArray(value) && value.every(Number.isFinite);
    const range = (one) => (pair(one.range) && one.range.length === 2 && one.range[1] > one.range[0] ? one.range : undefined);
    const items = (one) => one.items.filter((item) => typeof item.signal === "string").map(({ signal, minus }) => ({ signal, minus: minus ?? null }));
    return {
      panes: saved.panes.filter((one) => ["time", "xy", "spectrum"].includes(one.kind)).slice(0, 24).map((one) => ({ ...one, items: items(one), range: range(one) })),
      cases: saved.cases.filter(whole),
      window: pair(saved.window) && saved.window.length === 2 && saved.window[1] > saved.window[0] ? saved.window : null,
      cursors: pair(saved.cursors) ? saved.cursors.slice(0, 2) : [],
      offsets: about.runs.map((_, k) => (Number.isFinite(saved.offsets?.[k]) ? saved.offsets[k] : 0)),
    };
  } catch { return null; }
}

function keep() {
  clearTimeout(keep.due);
  keep.due = setTimeout(() => history.replaceState(null, "", `#${encodeURIComponent(JSON.stringify(state))}`), 200);
}

// ---- from state to curves

const letter = (minus) => typeof minus === "string";
const offset = (number) => state.offsets[about.cases[number].run];
const unitOf = (signal) => heads.get(signal)?.unit ?? signals.get(signal)?.unit;
const recorded = (signal, number) => { const one = signals.get(signal); return !one || one.cases === "all" || one.cases.includes(number); };

// the subtracted case: itself, or the same variant and seed of a run
function other(minus, number) {
  if (!letter(minus)) return minus;
  const { variant, seed } = about.cases[number], run = about.runs.findIndex((one) => one.letter === minus);
  return about.cases.findIndex((one) => one.run === run && one.variant === variant && one.seed === seed);
}

function drawnBy(one) {
  const found = [];
  one.items.forEach((item, i) => state.cases.forEach((number, c) => {
    const minus = item.minus === null ? null : other(item.minus, number);
    if (minus === number || minus === -1 || !recorded(item.signal, number)) return;
    const spec = { kind: one.kind, signal: item.signal, case: number, minus, x: one.kind === "xy" ? one.x : "",
                   shift: minus === null ? 0 : offset(minus) - offset(number) };
    const single = one.items.length === 1;
    found.push({ spec, item, name: JSON.stringify([spec, offset(number)]), color: (single ? c : i) % 8, dash: DASHES[single ? 0 : c % 4],
                 label: labeled(item, number, single), step: heads.get(item.signal)?.real === false && one.kind === "time" });
  }));
  return found;
}

function lessOf(minus) { return minus === null ? "" : ` − ${letter(minus) ? minus : about.cases[minus].label}`; }
function labeled(item, number, single) {
  const label = about.cases[number].label, short = state.cases.length === 1;
  return short && !single ? item.signal + lessOf(item.minus) : single ? label + lessOf(item.minus) : `${item.signal}${lessOf(item.minus)}, ${label}`;
}

function titled(one) {
  const names = one.items.map((item) => item.signal + lessOf(item.minus)).join(", ");
  const what = one.kind === "xy" ? `${names} over ${one.x}` : one.kind === "spectrum" ? `Spectrum of ${names}` : names;
  return one.plot && one.items.length > 1 ? one.plot : what;
}

function shownPane(one) {
  const lines = drawnBy(one), head = lines.map((line) => heads.get(line.name)).find(Boolean);
  const unit = head?.unit ?? unitOf(one.items[0]?.signal) ?? "";
  const found = { title: titled(one), unit, range: one.range, curves: lines, own: one.kind !== "time", log: one.kind === "spectrum" ? "xy" : "" };
  if (found.own) found.x = { label: one.kind === "spectrum" ? "frequency" : one.x, unit: `[${head?.x_unit || (one.kind === "xy" ? signals.get(one.x)?.unit : "Hz") || ""}]` };
  const plot = about.plots.find((each) => each.title === one.plot);
  if (plot && one.items.every((item) => item.minus === null)) Object.assign(found, { band: plot.band.length ? plot.band : null, lines: plot.lines });
  if (one.kind === "time") Object.assign(found, judged(one, lines));
  return found;
}

// limits and failed spans of the signals of a pane
function judged(one, lines) {
  const limits = [], spans = [];
  for (const each of about.expectations) {
    const own = lines.filter(({ spec, item }) => item.minus === null && [spec.signal, heads.get(spec.signal)?.key].includes(each.signal) && about.cases[spec.case].run === each.run);
    if (!each.signal || !own.length) continue;
    const move = state.offsets[each.run];
    for (const y of [each.low, each.high]) if (y !== null) limits.push({ y, from: each.begin === null ? -Infinity : each.begin + move, to: each.end === null ? Infinity : each.end + move, failed: each.verdict === "fail" });
    for (const { spec } of own) for (const [from, to] of each.spans[spec.case] || []) spans.push({ from: from + move, to: to + move });
  }
  return { limits, spans };
}

// ---- drawing

const extentOf = () => {
  const chosen = state.cases.length ? state.cases : about.cases.map((_, k) => k), shown = chosen.filter((k) => about.cases[k].samples);
  const from = Math.min(...shown.map((k) => about.cases[k].begin + offset(k))), to = Math.max(...shown.map((k) => about.cases[k].end + offset(k)));
  return to > from ? [from, to] : Number.isFinite(from) ? [from, from + 1] : [0, 1];
};

async function samples({ names, points, from, to }) {
  const window = from === undefined ? extentOf() : [from, to];
  const asked = names.map((name) => curves.get(name)?.spec), moved = names.map((_, k) => offset(asked[k].case));
  try {
    const lines = await source.lines(asked.map((spec, k) => ({ ...spec, window: window.map((time) => time - moved[k]) })), Math.min(Math.max(2 * points, 16), 8000));
    lines.forEach(({ head }, k) => learned(names[k], asked[k], head));
    const problem = lines.find((one) => one.head.error);
    say(problem ? problem.head.error : "");
    return { from: window[0], to: window[1], last: window[1],
             curves: lines.map(({ x, y }, k) => ({ x: asked[k].kind === "time" && moved[k] ? Float64Array.from(x, (time) => time + moved[k]) : x, y })) };
  } catch (error) {
    say(error instanceof TypeError ? "The server does not answer. Start twin view again, then load this page anew." : error.message);
    return null;
  }
}

// units arrive with the samples: redraw titles and limits if they are new
function learned(name, spec, head) {
  if (head.error || heads.has(name)) return;
  heads.set(name, head);
  if (spec.kind === "time") heads.set(spec.signal, head);
  clearTimeout(learned.due);
  learned.due = setTimeout(renewed, 0);
}

function renewed() {
  if (document.querySelector("details.menu[open]")) { learned.due = setTimeout(renewed, 300); return; } // not under a hand
  chart.setPanes(laid());
  cursors();
}

function laid() {
  const panes = state.panes.map(shownPane);
  curves = new Map(panes.flatMap((one) => one.curves.map((line) => [line.name, line])));
  return panes;
}

function say(text) {
  find("message").textContent = text || hint;
  find("message").classList.toggle("problem", !!text);
}

class Panes extends Chart {
  legend(one, index) {
    const line = super.legend(one, index), chips = document.createElement("div");
    chips.className = "chips";
    chips.append(...line.querySelectorAll(".twin-chip"));
    [...chips.children].forEach((chip, k) => {
      const { dash, color } = one.curves[k], swatch = chip.querySelector("i");
      if (dash.length) { swatch.classList.add("dashed"); swatch.style.borderColor = `var(--line-${color})`; }
      chip.title = `${one.curves[k].spec.signal}: ${signals.get(one.curves[k].spec.signal)?.about || one.curves[k].label}`;
    });
    line.append(chips, menu(index));
    return line;
  }
}

const digits = (value) => (value === null || value === undefined ? "–" : String(+value.toPrecision(6)));

function show() {
  const own = state.panes.filter((one) => one.kind !== "time").length;
  find("chart").style.height = `${Math.max(state.panes.length, 1) * (innerWidth < 760 ? 170 : HEIGHT) + 26 * (own + 1)}px`;
  chart.window = state.window;
  chart.setPanes(laid());
  chart.setCursors(state.cursors);
  chart.setMarks(marks(), []);
  find("chart").querySelector(".empty")?.remove();
  if (!state.panes.length) find("chart").append(Object.assign(document.createElement("div"), { className: "empty", textContent: "Pick a signal, or drag one here." }));
  panels();
  windowed();
  keep();
}

function marks() {
  const shown = state.cases.map((k) => about.cases[k]), found = new Map();
  for (const { run, time, name, variants } of about.events) {
    if (shown.some((one) => one.run === run && (!variants.length || variants.includes(one.variant)))) {
      const at = time + state.offsets[run];
      found.set(`${at} ${name}`, { at, text: name });
    }
  }
  return [...found.values()].sort((a, b) => a.at - b.at);
}

function windowed() {
  const [from, to] = state.window || extentOf();
  find("from").value = digits(from);
  find("to").value = digits(to);
}

function begin() {
  state = remembered() || first();
  chart = new Panes(find("chart"), { panes: [], source: samples, notify: heard });
  find("chart").chart = chart; // for tests, and for the console of the browser
  for (const id of ["from", "to"]) {
    find(id).onchange = () => {
      const pair = [find("from").value, find("to").value].map(Number);
      if (pair.every(Number.isFinite) && pair[1] > pair[0]) { state.window = pair; show(); } else { say("from must be below to, both in s."); }
    };
  }
  find("all").onclick = () => { state.window = null; show(); };
  find("dark").onclick = () => {
    const dark = document.body.classList.toggle("body--dark");
    try { localStorage.setItem("twin-dark", dark ? "1" : "0"); } catch { /* a file may not remember */ }
  };
  find("link").onclick = async () => {
    history.replaceState(null, "", `#${encodeURIComponent(JSON.stringify(state))}`);
    try { await navigator.clipboard.writeText(location.href); say("The address is in the clipboard."); } catch { say("Copy it from the address line."); }
  };
  addEventListener("keydown", (event) => {
    const move = KEYS[event.key];
    if (!move || event.target.closest("input, select") || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    const [from, to] = state.window || extentOf(), [begin, end] = move;
    state.window = [from + begin * (to - from), to + end * (to - from)];
    show();
  });
  addEventListener("hashchange", () => { state = remembered() || state; show(); });
  document.addEventListener("click", (event) => document.querySelectorAll("details.menu[open]").forEach((one) => { if (!one.contains(event.target)) one.open = false; }));
  show();
}

// A run in progress: draw new samples; reload the page at its end to show its verdicts.
async function followed() {
  try {
    const { over, problem, cases } = await source.progress();
    if (over) {
      history.replaceState(null, "", `#${encodeURIComponent(JSON.stringify(state))}`);
      location.reload();
      return;
    }
    if (JSON.stringify(cases) !== followed.last) {
      followed.last = JSON.stringify(cases);
      cases.forEach(([begin, end, samples], k) => Object.assign(about.cases[k], { begin, end, samples }));
      chart.stale = true;
      windowed();
    }
    if (problem.length) { say(problem.join(" ")); return; }
  } catch { say("The server does not answer. Start twin view again, then load this page anew."); }
  setTimeout(followed, AGAIN);
}

// user actions on the chart
function heard(event, detail) {
  if (event === "window") { state.window = detail.all ? null : [detail.from, detail.to]; windowed(); keep(); }
  if (event === "cursors") { state.cursors = [detail.a, detail.b].filter((one) => one !== undefined); cursors(); keep(); }
  if (event === "drop") add(detail.name, detail.pane);
  if (event === "remove") { const { item } = curves.get(detail.name); away(detail.pane, item); }
}

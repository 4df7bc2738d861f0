// The page: chart, window, cursors, address; draws what `state` says.

import { Chart, swatch } from "./chart.js";
import { number, readable, readableTime } from "./scale.js";

const KEYS = { ArrowLeft: [-0.2, -0.2], ArrowRight: [0.2, 0.2], "+": [0.2, -0.2], "-": [-0.33, 0.33] }; // by how much of the window its ends move
const AGAIN = 1000; // polling period of a run in progress [ms]
const MIDDLE = 1180, NARROW = 760, LOW = 700; // largest widths of pages with two columns and with one, as in view.css; height of a page without scene and table at first [px]
const hint = find("message").textContent;
let chart, shown = [], curves = new Map();
const distances = new Map(); // of curves of other runs from the same of run A, as texts

async function samples({ names, points, from, to }) {
  const window = from === undefined ? extentOf() : [from, to], windowFor = ({ kind }) => (kind === "spectrum" && isBetween() ? summarized() : window);
  const asked = names.map((name) => JSON.parse(name)), moved = asked.map(([spec]) => (spec.kind === "fan" ? state.offsets[about.following.run] : offset(spec.case)));
  try {
    const read = asked.flatMap(([spec], k) => (spec.kind === "fan" ? [] : [{ ...spec, window: windowFor(spec).map((time) => time - moved[k]) }]));
    const answers = await source.lines(read, Math.min(Math.max(2 * points, 16), 8000)), lines = asked.map(([spec]) => (spec.kind === "fan" ? forecastOf(spec) : answers.shift()));
    lines.forEach(({ head }, k) => learned(names[k], asked[k][0], head));
    const problem = lines.find((one) => one.head.error);
    say(problem ? problem.head.error : "");
    setTimeout(() => announce(state.panes.length), 0); // when the chart has them
    const shifted = (times, k) => (times && moved[k] ? Float64Array.from(times, (time) => time + moved[k]) : times), isTimed = (k) => ["time", "fan"].includes(asked[k][0].kind);
    return { from: window[0], to: window[1], last: window[1], curves: lines.map(({ x, y, t, count, head }, k) => ({ count: count ?? head.count, x: isTimed(k) ? shifted(x, k) : x, y, t: shifted(t, k) })) };
  } catch (error) {
    say(error instanceof TypeError ? "The server does not answer. Start twin view again, then load this page anew." : error.message);
    return null;
  }
}

// a line of the last forecast of a followed rig
function forecastOf({ path, part }) {
  const { time, signals } = about.following.forecast, own = Object.values(signals).find((one) => one.path === path);
  return { x: Float64Array.from(time), y: Float64Array.from(own[part]), head: { unit: own.unit, real: true, count: time.length } };
}

// units arrive with the samples: redraw titles and limits if they are new
function learned(name, spec, head) {
  if (head.error || heads.has(name)) return;
  heads.set(name, head);
  if (spec.kind === "time") heads.set(spec.signal, head);
  clearTimeout(learned.due);
  learned.due = setTimeout(renewed, 0);
}

// spectra follow the cursors and the visible time, which are in their titles
function transformed() {
  if (!state.panes.some(({ kind }) => kind === "spectrum")) return;
  chart.stale = true;
  clearTimeout(learned.due);
  learned.due = setTimeout(renewed, 0);
}

function renewed() {
  if (document.querySelector("details.menu[open]")) { learned.due = setTimeout(renewed, 300); return; } // not under a hand
  chart.setPanes(laid());
  tabulate();
}

function laid() {
  shown = shownPanes();
  curves = new Map(shown.flatMap((one) => one.curves.map((line) => [line.name, { ...line, place: one.place, pane: one }])));
  return shown;
}

function say(text) {
  find("message").textContent = text || hint;
  find("message").classList.toggle("problem", !!text);
}

class Panes extends Chart {
  unfolded = new Set(); // places of panes whose legend is shown as a whole

  zoom(from, to) { super.zoom(...inRuns(from, to)); }

  setHover(hover) { super.setHover(hover); if (hover) bringRows(this.panes[hover.pane]); }

  legend(one, index) {
    const line = super.legend(one, index), isUnfolded = this.unfolded.has(one.place);
    line.classList.toggle("unfolded", isUnfolded);
    line.append(button(isUnfolded ? "less" : `all ${one.curves.length}`, () => { if (!this.unfolded.delete(one.place)) this.unfolded.add(one.place); show(); }, { className: "more", title: isUnfolded ? "Show some of the names" : "Show all names" }));
    if (one.hidden?.length) {
      const names = one.hidden.join("; "), why = state.panes[one.place].plot ? "not in this plot" : "not judged here", isShort = this.panes.length > 2 && one.hidden.length > 1;
      line.append(button(isShort ? `${one.hidden.length} variants ${why}` : `${why}: ${names}`, () => { delete state.panes[one.place].variants; show(); }, { className: "hidden", title: `Show ${names}, too` }));
    }
    const level = one.limits?.find(({ name }) => name);
    if (level) line.append(element("span", `dashed: ${level.name} of each curve`, { className: "hidden" }));
    if (one.violations?.length) line.append(element("span", `red: fails ${one.violations.join("; ")}`, { className: "violations" }));
    one.thinned = line.querySelector(".twin-pane-title").appendChild(element("span", ""));
    line.append(menu(one.place));
    return line;
  }

  chip(curve, index) {
    const chip = super.chip(curve, index);
    curve.equality = chip.firstChild.appendChild(element("span", ""));
    curve.equality.before(" ");
    return chip;
  }

  // some rows of names, and a button for the others
  measure() {
    const rows = innerWidth <= NARROW ? 4 : this.panes.length > 2 ? 2 : 3;
    for (const line of this.legends.children) {
      const names = line.firstChild, tops = [...new Set([...names.children].map((one) => one.offsetTop))].sort((a, b) => a - b), isLong = tops.length > rows;
      line.classList.toggle("long", isLong);
      names.style.maxHeight = isLong && !line.classList.contains("unfolded") ? `${tops[rows] - tops[0]}px` : "";
    }
    super.measure();
  }

  // how far a run is from run A; a difference that is zero in the visible window would otherwise look like a curve that is missing
  values(one) {
    super.values(one);
    const loop = one.curves.map(({ name }) => this.data[name]).find((data) => data?.t && data.count > data.t.length), texts = [[one.thinned, loop ? `, drawn through ${loop.t.length} of ${loop.count} samples: choose a shorter time` : ""]];
    for (const { equality, item, name } of one.curves) {
      const y = item.minus === null ? [] : [...(this.data[name]?.y ?? [])].filter((value) => !Number.isNaN(value));
      texts.push([equality, item.minus === null ? distances.get(name) ?? "" : y.length && y.every((value) => value === 0) ? "(equal)" : ""]);
    }
    const changed = texts.filter(([span, text]) => span.textContent !== text);
    for (const [span, text] of changed) span.textContent = text;
    if (changed.length) this.measure();
  }
}

function show() {
  document.querySelectorAll("[aria-invalid=true]").forEach((input) => refuse(input, ""));
  const panes = laid();
  makeRoom();
  find("chart").style.setProperty("--panes", Math.max(panes.length, 1));
  chart.window = state.window;
  chart.setPanes(panes);
  chart.setCursors(state.cursors);
  chart.setMarks(marks());
  announce(panes.length);
  panels();
  windowed();
  pictured();
  keep();
}

// a sentence in place of charts without signals, and of those of a run before its first sample
function announce(count) {
  const isWaiting = about.growing && !state.cases.some((k) => about.cases[k].samples);
  const text = !count ? "Pick a signal, or drag one here." : isWaiting ? "Waiting for the first samples." : chart.frames ? "" : "Loading ...";
  find("chart").querySelector(".empty")?.remove();
  if (text) find("chart").append(Object.assign(document.createElement("div"), { className: "empty", role: "status", textContent: text }));
}

function marks() {
  const cases = state.cases.map((k) => about.cases[k]), found = new Map();
  for (const { run, time, name, variants, first } of about.events) {
    if (cases.some((one) => one.run === run && (!variants.length || variants.includes(one.variant)))) {
      const at = time + state.offsets[run];
      found.set(`${at} ${name}`, { at, text: name, ...(first && { first }) });
    }
  }
  return [...found.values()].sort((a, b) => a.at - b.at);
}

const windowOf = () => state.window || extentOf();

function windowed() {
  const [from, to] = windowOf();
  if (state.time !== null) state.time = Math.min(Math.max(state.time, from), to); // the picture is of the window, too
  find("clear").hidden = !state.cursors.length;
  for (const [id, at] of [["from", from], ["to", to]]) written(find(id), String(+readableTime(at, from, to)));
  find("span").value = state.window ? "" : state.span ?? "";
  played(from, to);
}

// write a time, but not into a field in which somebody types, nor under the caret while the run goes on
function written(field, text) {
  if (field === document.activeElement && (about.growing || field.value !== field.dataset.text)) return;
  refuse(field, "");
  field.value = field.dataset.text = text;
}

// user actions on the chart
function heard(event, detail) {
  if (event === "window") { state.window = detail.all ? null : [detail.from, detail.to]; windowed(); transformed(); tabulate(); pictured(); keep(); }
  if (event === "cursors") { state.cursors = [detail.a, detail.b].filter((one) => one !== undefined); find("clear").hidden = !state.cursors.length; transformed(); tabulate(); keep(); }
  if (event === "time") { pause(); goToTime(detail.at); }
  if (event === "dim") tabulate();
  if (event === "drop") add(detail.name, shown[detail.pane]?.place ?? -1);
  if (event === "remove") { const { item, place } = curves.get(detail.name); away(place, item); }
  if (event === "range") {
    const { pane: index, ...axes } = detail, { place } = shown[index];
    Object.assign(state.panes[place], axes);
    for (const one of shown) if (one.place === place) Object.assign(one, axes);
    chart.redraw();
    keep();
  }
  if (event === "weights") {
    state.panes.forEach((one) => { one.weights = []; });
    shown.forEach((one, k) => { state.panes[one.place].weights[one.part] = detail.weights[k]; });
    keep();
  }
}

function begin() {
  state = remembered() || first();
  chart = new Panes(find("chart"), { panes: [], source: samples, notify: heard });
  find("chart").chart = chart; // for tests, and for the console of the browser
  for (const id of ["from", "to"]) {
    find(id).onchange = () => {
      const pair = ["from", "to"].map((end) => numberOf(find(end)));
      if (pair[1] > pair[0]) { find(id).dataset.text = find(id).value; state.window = pair; show(); } else refuse(find(id), "from must be below to, both numbers in s.");
    };
  }
  find("all").onclick = () => { state.window = null; state.span = null; show(); };
  find("undo").onclick = () => history.back();
  find("clear").onclick = () => { state.cursors = []; show(); };
  find("span").hidden = !about.growing;
  find("span").onchange = () => { state.window = null; state.span = +find("span").value || null; show(); };
  find("dark").onclick = () => {
    const dark = document.body.classList.toggle("body--dark");
    try { localStorage.setItem("twin-dark", dark ? "1" : "0"); } catch { /* a file may not remember */ }
  };
  find("link").onclick = async () => {
    history.replaceState(null, "", address());
    try { await navigator.clipboard.writeText(location.href); say("The address is in the clipboard."); } catch { say("Copy it from the address line."); }
  };
  addEventListener("keydown", pressed);
  addEventListener("hashchange", () => {
    const { cursors, time } = state, isStep = history.state !== null; // cursors are no part of the steps
    state = { ...(remembered() || state), ...(isStep ? { cursors, time } : {}) };
    keep.last = steady();
    show();
  });
  document.addEventListener("click", (event) => {
    closeMenus(event.target);
    if (event.detail) event.target.closest("button, summary")?.blur(); // by the pointer: the space bar plays, it does not repeat the button
  });
  document.querySelectorAll(".splitter").forEach(splits);
  show();
  new ResizeObserver(() => { find("stage").style.scrollPaddingTop = `${find("scene").open && innerWidth > NARROW ? find("scene").offsetHeight + 8 : 0}px`; }).observe(find("scene")); // it stays in view
}

// three panes need the room of the scene: it is folded, and opens when it plays or when there are fewer panes
function makeRoom() {
  const isFull = shown.length > 2 && innerWidth > NARROW && innerHeight > LOW && !about.growing, scene = find("scene");
  if (isFull && !makeRoom.wasFull && scene.open && !playing) { scene.open = false; play.unfolds = true; }
  if (!isFull && play.unfolds) { scene.open = true; play.unfolds = false; }
  makeRoom.wasFull = isFull;
  find("stage").classList.toggle("full", isFull);
}

function closeMenus(but) {
  document.querySelectorAll("details.menu[open]").forEach((one) => { if (!one.contains(but)) one.open = false; });
}

function pressed(event) {
  if (event.key === "Escape") closeMenus(null);
  const step = event.ctrlKey || event.metaKey ? { z: -1, Z: 1, y: 1 }[event.key] : undefined;
  if (step && !event.target.closest("input, textarea") && (step > 0 || history.state)) { event.preventDefault(); history.go(step); return; }
  if (event.target.closest("input:not([type=range]), select, textarea") || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === " " && !event.target.closest("button, summary")) { event.preventDefault(); find("play").click(); }
  if (event.target.closest("input")) return; // its arrows move the time
  const move = KEYS[event.key];
  if (!move) return;
  event.preventDefault();
  const [from, to] = windowOf(), [begin, end] = move;
  state.window = inRuns(from + begin * (to - from), to + end * (to - from));
  show();
}

// a window moved, and shortened, into the time of the runs
function inRuns(from, to) {
  const [low, high] = extentOf(null), begin = Math.min(Math.max(from, low), Math.max(high - (to - from), low));
  return [begin, Math.min(begin + to - from, high)];
}

// a border that sets the width of a column
function splits(border) {
  const column = find(border.dataset.for), sign = Number(border.dataset.sign);
  border.onpointerdown = (event) => {
    border.setPointerCapture(event.pointerId);
    const begin = event.clientX, width = column.offsetWidth;
    border.onpointermove = (moved) => document.querySelector("main").style.setProperty(`--${border.dataset.for}`, `${Math.max(width + sign * (moved.clientX - begin), 140)}px`);
    border.onpointerup = border.onpointercancel = () => { border.onpointermove = null; };
  };
}

// the new status of a followed rig: its forecast, and marks of changes
function renew(known) {
  const { run, changes } = about.following = known;
  about.events = [...about.events.filter((one) => one.run !== run), ...changes.map(({ onset, name }) => ({ run, time: onset, name, variants: [] }))];
  following();
  events();
  chart.setMarks(marks());
  if (document.querySelector("details.menu[open]")) return; // not under a hand
  chart.setPanes(laid());
}

// A run in progress: draw new samples; reload the page at its end to show its verdicts.
async function followed() {
  try {
    const { over, problem, cases, following: known } = await source.progress();
    if (over) {
      history.replaceState(null, "", address());
      location.reload();
      return;
    }
    if (JSON.stringify(cases) !== followed.last) {
      followed.last = JSON.stringify(cases);
      cases.forEach(([begin, end, samples], k) => Object.assign(about.cases[k], { begin, end, samples }));
      if (known) renew(known);
      chart.stale = true;
      announce(state.panes.length);
      windowed();
      tabulate();
    }
    if (problem.length) { say(problem.join(" ")); return; }
  } catch { say("The server does not answer. Start twin view again, then load this page anew."); }
  setTimeout(followed, AGAIN);
}

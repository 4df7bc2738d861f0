// The page: chart, window, cursors, address; draws what `state` says.

import { Chart, swatch } from "./chart.js";
import { number, readable, readableTime } from "./scale.js";

const KEYS = { ArrowLeft: [-0.2, -0.2], ArrowRight: [0.2, 0.2], "+": [0.2, -0.2], "-": [-0.33, 0.33] }; // by how much of the window its ends move
const AGAIN = 1000; // polling period of a run in progress [ms]
const MIDDLE = 1180, NARROW = 760; // largest widths of pages with two columns and with one, as in view.css [px]
const hint = find("message").textContent;
let chart, shown = [], curves = new Map();

async function samples({ names, points, from, to }) {
  const window = from === undefined ? extentOf() : [from, to];
  const asked = names.map((name) => JSON.parse(name)), moved = asked.map(([spec]) => (spec.kind === "fan" ? state.offsets[about.following.run] : offset(spec.case)));
  try {
    const read = asked.flatMap(([spec], k) => (spec.kind === "fan" ? [] : [{ ...spec, window: window.map((time) => time - moved[k]) }]));
    const answers = await source.lines(read, Math.min(Math.max(2 * points, 16), 8000)), lines = asked.map(([spec]) => (spec.kind === "fan" ? forecastOf(spec) : answers.shift()));
    lines.forEach(({ head }, k) => learned(names[k], asked[k][0], head));
    const problem = lines.find((one) => one.head.error);
    say(problem ? problem.head.error : "");
    return { from: window[0], to: window[1], last: window[1],
             curves: lines.map(({ x, y }, k) => ({ x: ["time", "fan"].includes(asked[k][0].kind) && moved[k] ? Float64Array.from(x, (time) => time + moved[k]) : x, y })) };
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
  legend(one, index) {
    const line = super.legend(one, index);
    if (one.violations?.length) line.firstChild.append(element("span", `red: fails ${one.violations.join("; ")}`, { className: "violations" }));
    line.append(menu(one.place));
    return line;
  }

  chip(curve, index) {
    const chip = super.chip(curve, index);
    curve.equality = chip.firstChild.appendChild(element("span", ""));
    return chip;
  }

  // a difference that is zero in the visible window would otherwise look like a curve that is missing
  values(one) {
    super.values(one);
    for (const { equality, item, name } of one.curves) {
      const y = item.minus === null ? [] : [...(this.data[name]?.y ?? [])].filter((value) => !Number.isNaN(value)), text = y.length && y.every((value) => value === 0) ? "(equal)" : "";
      if (equality.textContent !== text) equality.textContent = text;
    }
  }
}

function show() {
  document.querySelectorAll("[aria-invalid=true]").forEach((input) => refuse(input, ""));
  const panes = laid();
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
  const text = !count ? "Pick a signal, or drag one here." : isWaiting ? "Waiting for the first samples." : "";
  find("chart").querySelector(".empty")?.remove();
  if (text) find("chart").append(Object.assign(document.createElement("div"), { className: "empty", role: "status", textContent: text }));
}

function marks() {
  const cases = state.cases.map((k) => about.cases[k]), found = new Map();
  for (const { run, time, name, variants } of about.events) {
    if (cases.some((one) => one.run === run && (!variants.length || variants.includes(one.variant)))) {
      const at = time + state.offsets[run];
      found.set(`${at} ${name}`, { at, text: name });
    }
  }
  return [...found.values()].sort((a, b) => a.at - b.at);
}

const windowOf = () => state.window || extentOf();

function windowed() {
  const [from, to] = windowOf();
  if (state.time !== null) state.time = Math.min(Math.max(state.time, from), to); // the picture is of the window, too
  find("clear").hidden = !state.cursors.length;
  find("from").value = +readableTime(from, from, to);
  find("to").value = +readableTime(to, from, to);
  find("span").value = state.window ? "" : state.span ?? "";
  played(from, to);
}

// user actions on the chart
function heard(event, detail) {
  if (event === "window") { state.window = detail.all ? null : [detail.from, detail.to]; windowed(); tabulate(); pictured(); keep(); }
  if (event === "cursors") { state.cursors = [detail.a, detail.b].filter((one) => one !== undefined); find("clear").hidden = !state.cursors.length; tabulate(); keep(); }
  if (event === "time") { pause(); goToTime(detail.at); }
  if (event === "dim") tabulate();
  if (event === "drop") add(detail.name, shown[detail.pane]?.place ?? -1);
  if (event === "remove") { const { item, place } = curves.get(detail.name); away(place, item); }
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
      const pair = [find("from").value, find("to").value].map(Number);
      if (pair.every(Number.isFinite) && pair[1] > pair[0]) { state.window = pair; show(); } else { say("from must be below to, both in s."); }
    };
  }
  find("all").onclick = () => { state.window = null; state.span = null; show(); };
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
  addEventListener("hashchange", () => { state = remembered() || state; show(); });
  document.addEventListener("click", (event) => document.querySelectorAll("details.menu[open]").forEach((one) => { if (!one.contains(event.target)) one.open = false; }));
  document.querySelectorAll(".splitter").forEach(splits);
  show();
}

function pressed(event) {
  if (event.target.closest("input, select, textarea") || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === " " && !event.target.closest("button, summary")) { event.preventDefault(); find("play").click(); }
  const move = KEYS[event.key];
  if (!move) return;
  event.preventDefault();
  const [from, to] = windowOf(), [begin, end] = move;
  state.window = [from + begin * (to - from), to + end * (to - from)];
  show();
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

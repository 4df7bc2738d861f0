// Curves of a report in place of its still plots. All have one window and one cursor of time, which moves the scene too. After player.js.

import { Chart, swatch } from "./chart.js";
import { isMarked } from "./painter.js";
import { rowsAt } from "./pointer.js";
import { unpack, visible } from "./samples.js";
import { drawViews, elementOf } from "./views.js";

const charts = [];
let player = null, shownTime = null, isAtStart = false, isPinned = false; // pinned: the case of the list, until a pane is clicked or a link followed

// the first violation: the scene and the cursor of time begin there
const { dataset: start = {} } = document.getElementById("plots") ?? {};

// what the legend of a pane names; panes with the same names share the legend of the first one
const legendOf = (pane) => JSON.stringify(pane.curves.map(({ label, color, dash }) => [label, color, dash]));

class ReportChart extends Chart {
  constructor(element, panes, marks, reach) {
    const isLoop = panes[0].own;
    element.classList.toggle("loop", !!isLoop);
    super(element, { panes, marks: isLoop ? [] : marks.filter((mark) => panes.some((pane) => isMarked(pane, mark))), source: curvesOf(isLoop, reach) });
    this.notify = (event, detail) => this.share(event, detail);
    this.allPanes = panes;
    this.showPane("");
    element.chart = this; // for tests, and for the console of the browser
    element.addEventListener("pointermove", () => {
      if (typeof this.hover?.at !== "number") return;
      if (!isPinned) selectCase(this.panes[this.hover.pane].case);
      showTime(this.hover.at, this);
    });
    element.addEventListener("click", () => { if (this.hover) { isPinned = false; selectCase(this.panes[this.hover.pane].case); } });
    element.addEventListener("pointerleave", () => this.setTime(shownTime));
    scrollThrough(element);
  }

  // values of all panes at the time under the pointer, above each pane where they cover no curve; of loops beside the pointer
  setHover(hover) {
    super.setHover(hover);
    const time = hover && !this.panes[hover.pane].own && !this.cursors.length ? hover.at : null; // else beside the pointer: t1 and t2 stand above
    if (time !== null) this.readout.hidden = true;
    this.reads ??= [];
    while (this.reads.length < this.panes.length) this.reads.push(Object.assign(this.element.appendChild(document.createElement("div")), { className: "twin-read", hidden: true }));
    this.reads.forEach((read, index) => {
      const rows = time === null || index >= this.panes.length ? [] : rowsAt(this, index, time);
      read.hidden = !rows.length;
      if (!rows.length) return;
      read.style.top = `${this.boxes[index].head + 1}px`;
      read.replaceChildren(Object.assign(document.createElement("b"), { textContent: hover.title }), ...rows.map(({ label, text, ...curve }) => {
        const row = document.createElement("div");
        row.append(swatch(curve), rows.length > 1 ? `${label} ${text}` : text);
        return row;
      }));
    });
  }

  // show the pane of a title alone, or all panes
  showPane(title) {
    const panes = this.allPanes.filter((pane) => !title || pane.title === title), element = this.legends.parentElement;
    element.hidden = !panes.length;
    element.style.setProperty("--panes", panes.length);
    this.setPanes(panes);
  }

  legend(pane, index) {
    const row = super.legend(pane, index);
    pane.alike = index && legendOf(pane) === legendOf(this.panes[0]) ? [...row.querySelectorAll(".twin-chip")] : [];
    for (const chip of pane.alike) chip.hidden = true;
    if (!index) this.times = row.querySelector(".twin-pane-title").appendChild(document.createElement("b"));
    return row;
  }

  // the instant of the scene that is drawn at the same pixel as a time of a pane: scene, values and cursors are of one sample
  snap(time, index) {
    const { case: own } = this.panes[index] ?? {}, { across } = this.boxes[index] ?? {}, film = own ? player?.films[films.findIndex((one) => isCase(one, own))] : player?.film;
    const near = across && film?.time[nearest(film.time, time)];
    return Math.abs(across?.(near) - across?.(time)) <= 1 ? near : time;
  }
  get samples() { return this.panes.some(({ own }) => own) ? this.data : stored; }

  // at the cursors, of the stored samples instead of those that are drawn, in every pane
  values(pane) {
    const { data, cursors } = this;
    if (cursors.length) this.data = { ...data, ...Object.fromEntries(pane.curves.flatMap(({ name }) => (ended[name] ? [[name, ended[name]]] : []))) };
    super.values(pane);
    this.data = data;
    for (const chip of pane.alike || []) chip.hidden = !cursors.length;
    if (pane !== this.panes[0]) return;
    const [t1, t2] = cursors.map((time) => +time.toFixed(4)), isThinned = this.panes.some(({ thinned }) => thinned);
    const text = !cursors.length ? "" : `\u2003t1 ${t1} s${cursors.length > 1 ? `, t2 ${t2} s, Δt ${+(t2 - t1).toFixed(4)} s` : ""}${isThinned ? " (last sample that is kept)" : ""}`;
    if (this.times.textContent !== text) this.times.textContent = text;
  }

  share(event, { from, to, all, a, b }) {
    const others = charts.filter((other) => other !== this);
    if (event === "dim") this.dimAlike();
    if (event === "drawn" && this.frames && !isAtStart && !this.panes[0].own) this.start();
    if (event === "window") for (const other of others) other.setWindow(...(all ? [null, null] : [from, to]));
    if (event === "cursors") for (const other of others) other.setCursors([a, b].filter((time) => time !== undefined));
  }

  // the scene begins at the worst violation, else halfway: at its start many a machine stands
  start() {
    const [first, last] = this.axis();
    isAtStart = true;
    goTo({ time: (first + last) / 2, ...start });
  }

  // dim in panes without a legend of their own what is dimmed in the first one
  dimAlike() {
    const [first, ...others] = this.panes;
    for (const pane of others.filter((one) => legendOf(one) === legendOf(first))) {
      pane.curves.forEach(({ name }, k) => { if (this.dimmed.has(first.curves[k].name)) this.dimmed.add(name); else this.dimmed.delete(name); });
    }
  }
}

// Film of the machine as the viewer draws it. `data`: of `machine_film` (recorded_views.py).
class MachineFilm {
  constructor(place, { views, time, signals }) {
    Object.assign(this, { time, instant: 0, picture: place.appendChild(document.createElement("div")) });
    this.signals = signals.map((track) => ({ ...track, values: track.integer ? unpackTrack(track).map(Math.round) : unpackTrack(track) }));
    this.move = drawViews(this.picture, views);
  }

  show(at) { this.instant = nearest(this.time, at); this.draw(); }
  draw() {
    const rowOf = ({ values, count }) => (values.length > count ? this.instant : 0); // what stands has one row
    this.move(Object.fromEntries(this.signals.map((track) => [track.name, elementOf(track.values, rowOf(track), track.shape)])), [], this.time[this.instant]);
  }
  legend() { return []; }
  listen() { /* nothing is zoomed */ }
}

// show the curves of a figure on the whole screen, or in their place again
function enlarge(figure, isLarge) {
  figure.classList.toggle("large", isLarge);
  document.body.classList.toggle("with-large", isLarge);
  figure.querySelector(".enlarge").textContent = isLarge ? "Close" : "Enlarge";
  const select = figure.querySelector(".pane");
  if (select && !isLarge) { select.value = ""; select.onchange(); }
}

// the panes of a figure by their titles, one of which is shown alone where the figure is large
function paneSelect(own) {
  const titles = own.flatMap((chart) => chart.allPanes.map(({ title }) => title)), select = document.createElement("select");
  Object.assign(select, { className: "pane", ariaLabel: "Panes", onchange: () => { for (const chart of own) chart.showPane(select.value); } });
  select.append(new Option("all panes", ""), ...titles.map((title) => new Option(title)));
  return titles.length > 1 && titles.every(Boolean) ? [select] : [];
}
addEventListener("keydown", (event) => { const figure = event.key === "Escape" && document.querySelector("figure.large"); if (figure) enlarge(figure, false); });

// the wheel scrolls the page; it zooms with Ctrl only, as a pinch on a touchpad does
function scrollThrough(element) {
  element.addEventListener("wheel", (event) => { if (!event.ctrlKey) event.stopPropagation(); }, { capture: true });
}

// names of curves are the indices of their arrays, and the unit of their times [ns]
const stored = {}, ended = {};
async function lineOf(name) {
  const [first, second, step] = name.split(" "), [x, y] = await Promise.all([first, second].map(unpack));
  if (!step) return { x, y }; // a loop
  stored[name] ??= { x: x.map((count) => (count * step) / 1e9), y };
  ended[name] ??= { x: [...stored[name].x, stored[name].x.at(-1) + 1e-9], y: [...y, NaN] }; // no value after the last sample
  return stored[name];
}
const curvesOf = (isLoop, [first, last]) => async ({ names, points, from, to }) => {
  const lines = await Promise.all(names.map(lineOf));
  const window = from === undefined ? [first, last] : [from, to];
  return { from: first, to: last, last, curves: isLoop ? lines : lines.map((line) => visible(line, ...window, 2 * points)) };
};

// show a time [s] in the scene and in all charts but the one under the pointer
function showTime(time, origin) {
  if (player) player.show(time); else chartTimes(time);
  origin.setTime(null);
}

// show a case in the scene
function selectCase(wanted = []) {
  const first = films.findIndex((film) => isCase(film, wanted));
  if (player && first >= 0 && !isCase(films[player.films.indexOf(player.film)], wanted)) player.select(first);
}
function isCase({ case: own }, [variant, seed]) { return own?.[0] === variant && own[1] === +seed; }

// show a case and a time [s] in the scene, or the time in the charts
function goTo({ variant, seed, time }) {
  player?.play(false);
  isPinned = false;
  selectCase([variant, seed]);
  if (time !== undefined) { if (player) player.show(+time); else chartTimes(+time); }
}

function chartTimes(time) {
  shownTime = time;
  for (const chart of charts) chart.setTime(time);
}

for (const [id, { panels, marks }] of Object.entries(JSON.parse(document.getElementById("panels").textContent))) {
  const figure = document.getElementById(id), box = document.createElement("div");
  box.className = "panels";
  figure.querySelector("figcaption").after(box);
  figure.classList.add("live");
  const button = figure.querySelector("figcaption").appendChild(document.createElement("button"));
  Object.assign(button, { type: "button", className: "enlarge", textContent: "Enlarge", onclick: () => enlarge(figure, !figure.classList.contains("large")) });
  const ends = panels.flat().flatMap((pane) => pane.reach ?? []), reach = [Math.min(...ends), Math.max(...ends)]; // one axis of time for all panes of a plot
  const own = panels.map((panes) => new ReportChart(box.appendChild(document.createElement("div")), panes, marks, reach));
  charts.push(...own);
  button.before(...paneSelect(own));
}

const films = JSON.parse(document.getElementById("films").textContent), stage = document.querySelector(".player");
if (films.length) {
  document.body.classList.add("with-films");
  const highest = () => Math.max(innerHeight * 0.2, 110), canvas = stage.querySelector(".view");
  player = new Player(stage, films.map((data) => (data.views ? new MachineFilm(stage.querySelector(".machine"), data) : new Film(canvas, data, highest))), chartTimes);
  goTo(start);
  stage.querySelector(".film").addEventListener("change", () => { isPinned = true; });
  scrollThrough(stage);
  if (matchMedia("(max-width: 900px)").matches) stage.closest("details").open = false; // it would cover the first plot
}
for (const link of document.querySelectorAll(".failures a[data-variant]")) link.addEventListener("click", () => goTo(link.dataset));

// a link opens what it leads to; one to a plot shows the case of its first pane
for (const link of document.querySelectorAll("main a[href^='#']")) link.addEventListener("click", () => {
  const target = document.querySelector(link.hash);
  for (const fold of [target.closest("details"), target.querySelector(":scope > details:not(.rule)")]) if (fold) fold.open = true;
  isPinned = false;
  if (!link.dataset.variant) selectCase(target.querySelector(".twin-chart")?.chart.allPanes.find((pane) => pane.case)?.case);
});

// menu of a narrow page
document.querySelector("nav select")?.addEventListener("change", ({ target }) => { document.querySelector(`nav a[href="${target.value}"]`)?.click(); target.value = ""; });

// what is pinned above a plot: the scene, on a narrow page the menu; no scene above figures without an axis of time
const scene = document.querySelector(".with-films .stage");
const pinned = new ResizeObserver(() => {
  const isWide = matchMedia("(min-width: 1100px)").matches, above = isWide ? scene : document.querySelector("nav");
  document.documentElement.style.setProperty("--above", `${above?.offsetHeight ?? 0}px`);
});
for (const element of document.querySelectorAll("main > nav, .with-films .stage")) pinned.observe(element);
if (scene) {
  const timeless = [...document.querySelectorAll("figure:not(.live), figure:has(.loop)")], near = new Set();
  const watch = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) if (isIntersecting) near.add(target); else near.delete(target);
    scene.classList.toggle("loose", near.size > 0);
  }, { rootMargin: "0px 0px -60% 0px" });
  for (const figure of timeless) watch.observe(figure);
}

// tables and drawings that are wider than the page say so
const widths = new ResizeObserver((entries) => { for (const { target } of entries) target.classList.toggle("cut", target.scrollWidth > target.clientWidth + 1); });
for (const table of document.querySelectorAll(".scroll, .drawing")) widths.observe(table);

// the viewer that serves this report, if one does: a file cannot start it
const viewer = document.documentElement.dataset.viewer;
for (const command of document.querySelectorAll(".command[data-query]")) {
  if (viewer) {
    const link = command.appendChild(document.createElement("a"));
    link.href = viewer + command.dataset.query;
    link.textContent = "Open in the viewer";
  }
}

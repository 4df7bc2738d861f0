// Panes of curves over one axis, drawn on a canvas. Independent of the server: samples come from a `source`.
//
//   new Chart(element, {panes, source, span, follow, notify, marks})
//   panes:  [{title, ending, unit, weight, curves: [{name, label, short, color, step, dash, width, opacity, faint, low, high, about}], band: [low, high], lines: [y], own, log,
//            x: {label, unit}, spans: [{from, to, text}], reach: [first, last], case: [variant, seed], range: [low, high], home, extent: [low, high], shared: [y], domain: [low, high], limits: [{y, from, to, failed, warns}]}]
//           `ending`: of all labels, whose rest is `short`. `weight`: height relative to other panes. `own`: over its own x instead of time (x-y, spectra). log: "", "x", "y", "xy"
//           `range`: of the vertical axis, and `domain`: of its own x, to which a user has zoomed; `axis`: panes with the same text share the range of all; `home`: the range without zoom (default: `range`); `extent`: of the curves of all panes with this axis, `shared`: their violated limits
//           `reach`: times of the curves' ends; marks (of the pane's variant) and the time cursor are drawn in between only. marks: [{at, text, variants, first}]
//           of a curve, other curves of the source: `faint`, drawn faintly behind it; `low` and `high`, with a filled area between them
//   source: async ({names, from, to, span, points}) -> {from, to, last, curves: [{x, y, t, count}]}; t: times of the points of an x-y plot; count: samples in the window, of which `x` may have the extremes alone; span: length of the last seconds
//   notify: (event, detail): "window" {from, to, follow, span, all}, "cursors" {a, b}, "time" {at}, "drop" {name, pane}, "remove" {name, pane},
//           "weights" {weights}, "range" {pane, range, domain}, "dim" {names}, "drawn"
// Drag: zoom in, along the vertical axis too. Shift-drag: move. Wheel: zoom time or frequency at the pointer (of x-y plots both axes), over the numbers of a vertical axis along that.
// Double-click: all, or follow again. Pointer: values of the nearest samples. Click: cursor t1; shift-click or the next click: cursor t2; a third
// moves the nearer one; a click on a cursor removes it. Cursors snap to samples; cursors, the time cursor and the borders of panes are dragged.
// A click on a name of the legend dims its curve.

import { before, number } from "./scale.js";
import { BOTTOM, GAP, LEFT, NAME, RIGHT, STRIP, TIMES, paintCurves, paintOverlays } from "./painter.js";
import { listenTo } from "./pointer.js";

const PERIOD = 1000 / 31, TICK = PERIOD / 4, ROW = 24, SMALLEST = 24, AWAY = 24, SLIM = 500, LARGE = 0.4; // [ms], [ms]; height of a row of the legend, least height of a pane, distance of the read-out, width of a chart with several lines of names [px]; part of a pane that it may cover
const SVG = "http://www.w3.org/2000/svg";

export class Chart {
  constructor(element, options) {
    this.element = element;
    this.notify = options.notify || (() => {});
    this.source = options.source;
    this.span = options.span || 10;
    this.follow = !!options.follow;
    this.window = null;      // [from, to] of the axis; null: all that there is
    this.full = [0, 1];
    this.cursors = [];
    this.time = null;        // of the time cursor
    this.hover = null;
    this.dimmed = new Set(); // names of curves
    this.marks = options.marks || [];
    this.data = {};
    this.frames = 0;
    this.idle = 0;
    element.classList.add("twin-chart");
    this.canvas = element.appendChild(document.createElement("canvas"));
    this.picture = document.createElement("canvas");  // the curves, without cursors
    this.legends = element.appendChild(document.createElement("div"));
    this.readout = element.appendChild(document.createElement("div"));
    this.readout.className = "twin-hover";
    this.readout.hidden = true;
    this.observer = new ResizeObserver((entries) => { if (entries.some((one) => one.target === element)) this.resize(); this.measure(); });
    this.observer.observe(element);
    this.theme = new MutationObserver(() => { this.style(); this.draw(); });
    this.theme.observe(document.body, { attributes: true, attributeFilter: ["class"] });
    listenTo(this);
    this.setPanes(options.panes || []);
    this.last = 0;
    this.loop = setInterval(() => this.tick(performance.now()), TICK);  // animation frames would cost a paint each
  }

  close() { clearInterval(this.loop); this.observer.disconnect(); this.theme.disconnect(); }

  // ---- content

  setPanes(panes) {
    this.panes = panes;
    for (const pane of panes) if (!("home" in pane)) pane.home = pane.range;
    for (const line of this.legends.children) this.observer.unobserve(line);
    this.legends.replaceChildren(...panes.map((pane, index) => this.legend(pane, index)));
    for (const line of this.legends.children) this.observer.observe(line);  // its rows wrap
    this.hover = null;
    this.changed = true;
    this.readout.hidden = true;
    this.measure();
    this.resize();
    this.stale = true;
  }
  setMarks(marks) { this.marks = marks; this.measure(); this.draw(); }
  setWindow(from, to) {
    this.follow = false;
    this.window = from === null || to === null ? null : [from, to];
    this.stale = true;
  }
  setFollow(span) { this.follow = true; this.window = null; if (span) this.span = span; this.stale = true; }
  setCursors(cursors) { this.cursors = cursors; this.redraw(false); }
  setTime(at) { this.time = at; this.redraw(false); }
  setHover(hover) {
    if (!hover && !this.hover) return;
    this.hover = hover;
    this.readout.hidden = !hover;
    if (hover) this.showReadout(hover);
    this.redraw(false);
  }

  legend(pane, index) {
    const row = document.createElement("div");
    row.className = "twin-legend";
    const names = row.appendChild(document.createElement("div")), title = names.appendChild(document.createElement("span"));
    names.className = "twin-names";
    title.className = "twin-pane-title";
    title.textContent = [pane.title, pane.unit && `[${pane.unit}]`].filter(Boolean).join(" ") + (pane.ending || "");
    names.append(...pane.curves.map((curve) => this.chip(curve, index)));
    pane.instant = title.appendChild(document.createElement("span"));
    pane.beyond = row.appendChild(document.createElement("span"));
    pane.beyond.className = "twin-beyond";
    return row;
  }

  chip(curve, index) {
    const chip = document.createElement("span"), name = chip.appendChild(document.createElement("button")), label = curve.label || curve.name;
    chip.className = "twin-chip";
    name.type = "button";
    name.className = "twin-chip-name";
    name.title = `${curve.about || label}. Click: dim or show.`;
    name.ariaLabel = label;
    name.append(swatch(curve), curve.short || label);
    const mark = () => { chip.classList.toggle("twin-dimmed", this.dimmed.has(curve.name)); name.setAttribute("aria-pressed", !this.dimmed.has(curve.name)); };
    name.onclick = () => {
      if (!this.dimmed.delete(curve.name)) this.dimmed.add(curve.name);
      mark();
      this.notify("dim", { names: [...this.dimmed] });
      this.redraw();
    };
    mark();
    chip.append(" ");
    curve.shown = chip.appendChild(document.createElement("b"));
    const away = chip.appendChild(document.createElement("button"));
    away.type = "button";
    away.textContent = "×";
    away.title = `Take ${label} away`;
    away.setAttribute("aria-label", away.title);
    away.onclick = () => this.notify("remove", { name: curve.name, pane: index });
    return chip;
  }

  showReadout(hover) {
    const title = document.createElement("b");
    title.textContent = hover.title;
    this.readout.replaceChildren(title, ...hover.rows.map(({ label, text, ...curve }) => {
      const row = document.createElement("div"), value = document.createElement("span");
      value.textContent = text;
      row.append(swatch(curve), `${label} `, value);
      return row;
    }), ...(hover.notes || []).map((text) => Object.assign(document.createElement("div"), { className: "twin-fail", textContent: text })));
    // beside the samples that are read, where there is more room; where it would cover much of the pane, above or below it
    const { offsetWidth: wide, offsetHeight: tall } = this.readout, { clientX: x, box } = hover, { left, right, top } = this.element.getBoundingClientRect();
    const bottom = Math.min(top + box.top + box.height, innerHeight), isLarge = tall > LARGE * box.height || wide > LARGE * (right - left), above = top + box.top - tall - 2, below = bottom + BOTTOM;
    this.readout.style.left = `${Math.max(x < (left + right) / 2 ? Math.min(x + AWAY, right - wide) : x - AWAY - wide, 0)}px`;
    this.readout.style.top = `${isLarge && above >= 0 ? above : isLarge && below + tall <= innerHeight ? below : Math.max(Math.min(top + box.top + 4, bottom - tall - 4), 0)}px`;
  }

  // ---- requests

  async tick(now) {
    const due = this.follow ? now - this.last >= (this.idle > 15 ? 250 : PERIOD) : this.stale;
    if (this.asking || document.hidden || !due) return;
    if (this.stale) this.idle = 0;
    this.asking = true; this.stale = false; this.last = now;
    try { await this.ask(); } catch (error) { this.idle = 100; } finally { this.asking = false; }
  }

  async ask() {
    const all = this.panes.flatMap((pane) => pane.curves.flatMap((curve) => [curve.name, curve.faint, curve.low, curve.high]));
    const names = [...new Set(all.filter(Boolean))];
    const points = Math.max(100, Math.min(2000, Math.round(this.canvas.clientWidth - LEFT - RIGHT)));
    const wanted = this.follow ? { span: this.span } : this.window ? { from: this.window[0], to: this.window[1] } : {};
    const frame = names.length ? await this.source({ names, points, ...wanted }) : { from: 0, to: this.span, last: 0, curves: [] };
    if (!frame) return;
    this.idle = frame.last === this.lastTime ? this.idle + 1 : 0;
    this.lastTime = frame.last;
    this.data = Object.fromEntries(names.map((name, k) => [name, frame.curves[k]]));
    this.full = [frame.from, frame.to];
    this.frames++;
    this.draw();
  }

  // ---- layout and drawing

  resize() {
    const width = this.element.clientWidth, height = this.element.clientHeight, ratio = window.devicePixelRatio || 1;
    if (!width || !height) return;
    this.canvas.width = Math.round(width * ratio); this.canvas.height = Math.round(height * ratio);
    this.canvas.style.width = `${width}px`; this.canvas.style.height = `${height}px`;
    if (width !== this.width) this.stale = true;
    this.width = width; this.height = height; this.ratio = ratio;
    this.style();
    this.draw();
  }

  style() {
    const of = getComputedStyle(this.element), color = (name) => of.getPropertyValue(name).trim();
    this.colors = { text: color("--soft"), grid: color("--grid"), band: color("--band"), fail: color("--fail"), violation: color("--violation"), ink: color("--ink"),
                    accent: color("--accent"), lines: [...Array(8).keys()].map((k) => color(`--line-${k}`)) };
  }

  // heights of the legends; they change when names wrap
  measure() {
    const heads = [...this.legends.children].map((one) => Math.max(one.offsetHeight + 4, ROW));
    const below = this.below(), fixed = [...heads, ...below].reduce((a, b) => a + b, GAP * Math.max(this.panes.length - 1, 0));
    this.element.style.setProperty("--heads", `${fixed}px`);  // for the least height of the panes in the style of the viewer
    if (String(heads) === String(this.heads)) return;
    this.heads = heads;
    this.draw();
  }

  // heights below the panes, where numbers of an axis and names of marks stand
  below() {
    const timed = this.panes.findLastIndex((pane) => !pane.own);
    this.strips = Math.min(this.marks.length, this.width < SLIM ? 3 : 1); // lines of the names of marks
    return this.panes.map((pane, index) => (pane.own ? BOTTOM + NAME : index === timed ? BOTTOM : TIMES) + (index === timed ? STRIP * this.strips : 0));
  }

  places() {
    const heads = this.panes.map((_, index) => this.heads?.[index] || ROW), below = this.below();
    const weights = this.panes.map((pane) => pane.weight || 1), sum = (list) => list.reduce((a, b) => a + b, 0);
    const rest = Math.max(this.height - sum(heads) - sum(below) - GAP * (this.panes.length - 1), 0);
    this.unit = rest / (sum(weights) || 1);  // pixels of a weight of one
    let head = 0;
    return this.panes.map((_, index) => {
      const top = head + heads[index], height = Math.max(this.unit * weights[index], 10), end = top + height + below[index];
      const box = { head, top, height, edge: end + GAP / 2 };
      head = end + GAP;
      return box;
    });
  }

  // move the border below a pane by pixels, from the weights when the drag began
  resizePanes(index, by, weights) {
    const least = SMALLEST / this.unit, both = weights[index] + weights[index + 1];
    const above = Math.min(Math.max(weights[index] + by / this.unit, least), both - least);
    this.panes[index].weight = above;
    this.panes[index + 1].weight = both - above;
    this.redraw();
    this.notify("weights", { weights: this.panes.map((pane) => pane.weight || 1) });
  }

  axis() { return this.window || this.full; }

  // the time that the pointer means in a pane, and the samples that are read at it: here those that are drawn
  snap(time) { return time; }
  get samples() { return this.data; }

  // draw at most once a frame; not the curves, if only the pointer, a cursor or the time has moved
  redraw(curves = true) {
    this.changed ||= curves;
    this.frame ??= requestAnimationFrame(() => { this.frame = null; this.draw(this.changed); });
  }

  draw(curves = true) {
    if (!this.width || !this.colors) return;
    if (curves) {
      this.changed = false;
      this.boxes = this.places();
      this.boxes.forEach((box, index) => { this.legends.children[index].style.top = `${box.head + 1}px`; });
      paintCurves(this);
    }
    paintOverlays(this);
    for (const pane of this.panes) this.values(pane);
    this.notify("drawn", {});
  }

  // values of the legend: the last with their time, or those at the cursors with their difference
  values(pane) {
    const last = pane.own || this.cursors.length || !this.follow ? [] : pane.curves.map((curve) => this.data[curve.name]?.x.at(-1)).filter(isFinite);
    const instant = last.length ? ` at ${Math.max(...last).toFixed(2)} s` : "";
    if (pane.instant.textContent !== instant) pane.instant.textContent = instant;
    const at = (data, x) => { const k = before(data.x, x); return k < 0 ? NaN : data.y[k]; };
    for (const curve of pane.curves) {
      const data = this.data[curve.name];
      const [a, b] = data ? this.cursors.map((x) => at(data, x)) : [];
      const names = curve.codes && this.cursors.length ? [a, b].slice(0, this.cursors.length).map((value) => curve.codes[value] ?? number(value, 0)) : null;
      const text = pane.own || !data?.x.length ? "" : names ? names.join(" → ") : this.cursors.length === 2 ? `${number(a, 0)} → ${number(b, 0)}, Δ ${number(b - a, 0)} ${pane.unit}`
        : this.cursors.length ? `${number(a, 0)} ${pane.unit}` : this.follow ? number(data.y[data.y.length - 1], 0) : "";
      if (curve.shown.textContent !== text) curve.shown.textContent = text;
    }
  }

  // ---- actions

  zoom(from, to) {
    if (!(to - from > 1e-9)) return;
    if (this.follow) this.wasFollowing = true;
    this.follow = false; this.window = [from, to]; this.stale = true;
    this.redraw();
    clearTimeout(this.notifyTimer);
    this.notifyTimer = setTimeout(() => this.notify("window", this.seen()), 150);
  }
  seen() { const [from, to] = this.axis(); return { from, to, follow: this.follow, span: this.span, all: !this.window }; }

  // zoom axes of a pane that it does not share: `range`, `domain`
  zoomPane(index, axes) {
    if (Object.values(axes).some(([low, high]) => !(high > low))) return;
    Object.assign(this.panes[index], axes);
    this.redraw();
    clearTimeout(this.rangeTimer);
    this.rangeTimer = setTimeout(() => this.notifyRange(index), 150);
  }
  notifyRange(index) { const { range, domain } = this.panes[index] || {}; this.notify("range", { pane: index, range, domain }); }

  // show all, in all panes along the time, in one of them along its own axes
  showAll(index) {
    const pane = this.panes[index];
    this.window = null; this.follow = this.wasFollowing || this.follow; this.stale = true;
    if (pane && (pane.range !== pane.home || pane.domain)) { Object.assign(pane, { range: pane.home, domain: undefined }); this.notifyRange(index); }
    this.redraw();
    this.notify("window", this.seen());
  }

  placeCursor(x, second) {
    if (x === null) return;
    const nearer = this.cursors.length < 2 ? this.cursors.length : +(Math.abs(this.cursors[1] - x) <= Math.abs(this.cursors[0] - x));
    this.cursors = Object.assign([...this.cursors], { [second && this.cursors.length ? 1 : nearer]: x });
    this.notifyCursors();
  }
  removeCursor(index) { this.cursors = this.cursors.filter((_, k) => k !== index); this.notifyCursors(); }
  notifyCursors() { const [a, b] = this.cursors; this.redraw(false); this.notify("cursors", { a, b }); }
}

// a piece of a curve as it is drawn
export function swatch({ color, dash, opacity, width }) {
  const picture = document.createElementNS(SVG, "svg"), line = picture.appendChild(document.createElementNS(SVG, "line"));
  picture.setAttribute("class", "twin-swatch");
  for (const [name, value] of Object.entries({ x1: 0, x2: 22, y1: 4, y2: 4, "stroke-dasharray": (dash || []).join(" ") })) line.setAttribute(name, value);
  Object.assign(line.style, { stroke: `var(--line-${color % 8})`, opacity, strokeWidth: width });
  return picture;
}

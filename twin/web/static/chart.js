// Panes of curves over one axis, drawn on a canvas. Independent of the server: samples come from a `source`.
//
//   new Chart(element, {panes, source, span, follow, notify})
//   panes:  [{title, unit, curves: [{name, label, color, step, dash, faint}], band: [low, high], lines: [y], own, log, x: {label, unit},
//            spans: [{from, to}], range: [low, high], limits: [{y, from, to, failed}]}]
//           `faint`: name of another curve, drawn faintly behind. `own`: over its own x instead of time (x-y, spectra). log: "", "x", "y", "xy"
//   source: async ({names, from, to, span, points}) -> {from, to, last, curves: [{x, y}]}; span: length of the last seconds
//   notify:   (event, detail): "window" {from, to, follow}, "cursors" {a, b}, "drop" {name, pane}, "remove" {name, pane}
// Drag: zoom in. Shift-drag: move. Wheel: zoom at the pointer. Double-click: all, or follow again.
// Click: cursor A; shift-click or the next click: cursor B; a third: none.

import { before, decades, extent, number, ticks } from "./scale.js";

const LEFT = 58, RIGHT = 14, TOP = 26, GAP = 10, BOTTOM = 26, STRIP = 16, PERIOD = 1000 / 31, TICK = PERIOD / 4;

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
    this.marks = options.marks || [];
    this.spans = options.spans || [];
    this.data = {};
    this.frames = 0;
    this.idle = 0;
    element.classList.add("twin-chart");
    this.canvas = element.appendChild(document.createElement("canvas"));
    this.legends = element.appendChild(document.createElement("div"));
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(element);
    this.theme = new MutationObserver(() => { this.style(); this.draw(); });
    this.theme.observe(document.body, { attributes: true, attributeFilter: ["class"] });
    this.listen();
    this.setPanes(options.panes || []);
    this.last = 0;
    this.loop = setInterval(() => this.tick(performance.now()), TICK);  // animation frames would cost a paint each
  }

  close() { clearInterval(this.loop); this.observer.disconnect(); this.theme.disconnect(); }

  // ---- content

  setPanes(panes) {
    this.panes = panes;
    this.legends.replaceChildren(...panes.map((pane, index) => this.legend(pane, index)));
    this.resize();
    this.stale = true;
  }
  setMarks(marks, spans) { this.marks = marks || []; this.spans = spans || []; this.draw(); }
  setWindow(from, to) {
    this.follow = false;
    this.window = from === null || to === null ? null : [from, to];
    this.stale = true;
  }
  setFollow(span) { this.follow = true; this.window = null; if (span) this.span = span; this.stale = true; }
  setCursors(cursors) { this.cursors = cursors; this.draw(); }

  legend(pane, index) {
    const line = document.createElement("div");
    line.className = "twin-legend";
    const title = line.appendChild(document.createElement("span"));
    title.className = "twin-pane-title";
    title.textContent = [pane.title, pane.unit && `[${pane.unit}]`].filter(Boolean).join(" ");
    pane.curves.forEach((curve) => {
      const chip = line.appendChild(document.createElement("span"));
      chip.className = "twin-chip";
      chip.title = curve.name;
      const swatch = chip.appendChild(document.createElement("i"));
      swatch.style.background = `var(--line-${curve.color % 8})`;
      chip.append(curve.label || curve.name);
      curve.shown = chip.appendChild(document.createElement("b"));
      const away = chip.appendChild(document.createElement("button"));
      away.textContent = "×";
      away.title = `Take ${curve.label || curve.name} away`;
      away.setAttribute("aria-label", away.title);
      away.onclick = () => this.notify("remove", { name: curve.name, pane: index });
    });
    return line;
  }

  // ---- requests and drawing

  async tick(now) {
    const due = this.follow ? now - this.last >= (this.idle > 15 ? 250 : PERIOD) : this.stale;
    if (this.asking || document.hidden || !due) return;
    if (this.stale) this.idle = 0;
    this.asking = true; this.stale = false; this.last = now;
    try { await this.ask(); } catch (error) { this.idle = 100; } finally { this.asking = false; }
  }

  async ask() {
    const names = [...new Set(this.panes.flatMap((pane) => pane.curves.flatMap((curve) => [curve.name, ...(curve.faint ? [curve.faint] : [])])))];
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

  // ---- drawing

  resize() {
    const width = this.element.clientWidth, height = this.element.clientHeight, ratio = window.devicePixelRatio || 1;
    if (!width || !height) return;
    this.canvas.width = Math.round(width * ratio); this.canvas.height = Math.round(height * ratio);
    this.canvas.style.width = `${width}px`; this.canvas.style.height = `${height}px`;
    this.width = width; this.height = height; this.ratio = ratio;
    this.style();
    this.stale = true;
    this.draw();
  }

  style() {
    const of = getComputedStyle(this.element), color = (name) => of.getPropertyValue(name).trim();
    this.colors = { text: color("--soft"), grid: color("--grid"), band: color("--band"), fail: color("--fail"), ink: color("--ink"),
                    accent: color("--accent"), lines: [...Array(8).keys()].map((k) => color(`--line-${k}`)) };
  }

  places() {
    const count = Math.max(this.panes.length, 1), timed = this.panes.findLastIndex((pane) => !pane.own);
    const below = this.panes.map((pane, index) => (pane.own || index === timed ? BOTTOM : 0) + (index === timed && this.marks.length ? STRIP : 0));  // where numbers of an axis stand
    const height = (this.height - (below.reduce((sum, one) => sum + one, 0) || BOTTOM) - GAP * (count - 1)) / count;
    let top = 0;
    return this.panes.map((_, index) => {
      const place = { top: top + TOP, height: Math.max(height - TOP, 10) };
      top += height + GAP + below[index];
      return place;
    });
  }

  axis() { return this.window || this.full; }

  draw() {
    if (!this.width || !this.colors) return;
    const context = this.canvas.getContext("2d");
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    context.clearRect(0, 0, this.width, this.height);
    context.font = "11px system-ui, sans-serif";
    this.boxes = this.places();
    const lastTimed = this.panes.findLastIndex((pane) => !pane.own);
    this.panes.forEach((pane, index) => {
      const box = this.boxes[index];
      const line = this.legends.children[index];
      line.style.top = `${box.top - TOP + 1}px`;
      this.pane(context, pane, box, index === lastTimed);
    });
    if (lastTimed >= 0 && this.marks.length) this.strip(context, this.boxes[lastTimed]);
    this.notify("drawn", {});
  }

  pane(context, pane, box, last) {
    const of = (name) => this.data[name] || { x: [], y: [] }, curves = pane.curves.map((curve) => of(curve.name));
    const faint = pane.curves.map((curve) => of(curve.faint));
    const [from, to] = pane.own ? own(curves) : this.axis();
    const logX = (pane.log || "").includes("x"), logY = (pane.log || "").includes("y");
    const shown = logY ? curves.map(({ x, y }) => ({ x, y: y.map((value) => (value > 0 ? value : NaN)) })) : curves;
    let [low, high] = extent([...shown, ...faint], from, to, [...(pane.band || []), ...(pane.lines || [])]);
    const near = (pane.limits || []).map((one) => one.y).filter((y) => y > 2 * low - high && y < 2 * high - low);
    if (near.length) [low, high] = extent(shown, from, to, [...(pane.band || []), ...(pane.lines || []), ...near]);
    if (logY) [low, high] = decade(shown);
    if (pane.range) [low, high] = pane.range;
    const width = this.width - LEFT - RIGHT, log = Math.log10;
    const across = logX ? (x) => LEFT + ((log(x) - log(from)) / (log(to) - log(from))) * width : (x) => LEFT + ((x - from) / (to - from)) * width;
    const down = logY ? (y) => box.top + (1 - (log(y) - log(low)) / (log(high) - log(low))) * box.height : (y) => box.top + (1 - (y - low) / (high - low)) * box.height;
    Object.assign(box, { across, down, from, to, low, high });
    this.frame(context, pane, box, last, logX, logY);
    context.save();
    context.beginPath(); context.rect(LEFT, box.top, width, box.height); context.clip();
    context.lineJoin = "round"; context.lineWidth = 1.4;
    context.globalAlpha = 0.35;
    pane.curves.forEach((curve, k) => {
      context.strokeStyle = this.colors.lines[curve.color % 8];
      stroke(context, faint[k], across, down, curve.step);
    });
    context.globalAlpha = 1;
    pane.curves.forEach((curve, k) => {
      context.strokeStyle = this.colors.lines[curve.color % 8];
      context.setLineDash(curve.dash || []);
      stroke(context, shown[k], across, down, curve.step);
    });
    context.setLineDash([4, 3]);
    for (const one of pane.limits || []) {
      context.strokeStyle = one.failed ? this.colors.fail : this.colors.accent;
      line(context, across(Math.max(one.from, from)), down(one.y), across(Math.min(one.to, to)), down(one.y));
    }
    context.setLineDash([]);
    if (!pane.own) this.overlays(context, box);
    context.restore();
    this.values(pane, curves);
  }

  frame(context, pane, box, last, logX, logY) {
    const { colors } = this, width = this.width - LEFT - RIGHT, bottom = box.top + box.height;
    if (!pane.own) for (const one of [...this.spans, ...(pane.spans || [])]) {
      context.fillStyle = colors.fail; context.globalAlpha = 0.13;
      const a = Math.max(box.across(one.from), LEFT), b = Math.min(box.across(one.to), LEFT + width);
      if (one.to >= box.from && one.from <= box.to) context.fillRect(a, box.top, Math.max(b - a, 2), box.height);
      context.globalAlpha = 1;
    }
    if (pane.band) {
      context.fillStyle = colors.band;
      context.fillRect(LEFT, box.down(pane.band[1]), width, box.down(pane.band[0]) - box.down(pane.band[1]));
    }
    context.strokeStyle = colors.grid; context.fillStyle = colors.text; context.lineWidth = 1;
    const rows = logY ? decades(box.low, box.high) : ticks(box.low, box.high, box.height / 34);
    context.textAlign = "right"; context.textBaseline = "middle";
    for (const y of rows.at) {
      const at = Math.round(box.down(y)) + 0.5;
      line(context, LEFT, at, LEFT + width, at);
      context.fillText(number(y, rows.step), LEFT - 6, at);
    }
    const columns = logX ? decades(box.from, box.to) : ticks(box.from, box.to, width / 90);
    const name = (pane.own && pane.x && [pane.x.label, pane.x.unit].filter(Boolean).join(" ")) || "s";
    const free = 16 + context.measureText(name).width;  // the name of the axis stands left of its numbers
    context.textAlign = "center"; context.textBaseline = "top";
    for (const x of columns.at) {
      const at = Math.round(box.across(x)) + 0.5;
      line(context, at, box.top, at, bottom);
      const text = number(x, columns.step);
      if ((last || pane.own) && at - context.measureText(text).width / 2 > free) context.fillText(text, at, bottom + 5);
    }
    if (last || pane.own) {
      context.textAlign = "left";
      context.fillText(name, 8, bottom + 5);
    }
    context.setLineDash([4, 4]); context.strokeStyle = colors.text;
    for (const y of pane.lines || []) line(context, LEFT, box.down(y), LEFT + width, box.down(y));
    context.setLineDash([]);
  }

  overlays(context, box) {
    const bottom = box.top + box.height;
    context.font = "10px system-ui, sans-serif"; context.textBaseline = "top";
    context.strokeStyle = this.colors.accent; context.globalAlpha = 0.4; context.setLineDash([2, 3]);
    for (const mark of this.marks) { const at = box.across(mark.at); line(context, at, box.top, at, bottom); }
    context.globalAlpha = 1; context.setLineDash([]);
    this.cursors.forEach((x, k) => {
      const at = box.across(x);
      context.strokeStyle = context.fillStyle = this.colors.ink;
      context.lineWidth = 1; line(context, at, box.top, at, bottom);
      context.textAlign = "left";
      context.fillText("AB"[k], at + 3, bottom - 12);
    });
    if (this.dragged && !this.dragged.move) {
      context.fillStyle = this.colors.accent; context.globalAlpha = 0.18;
      context.fillRect(this.dragged.begin, box.top, this.dragged.now - this.dragged.begin, box.height);
      context.globalAlpha = 1;
    }
    context.font = "11px system-ui, sans-serif";
  }

  // names of the marks, in one line below the last pane; a name that would cover the one before is left out
  strip(context, box) {
    const y = box.top + box.height + BOTTOM;
    context.font = "11px system-ui, sans-serif"; context.textBaseline = "top"; context.textAlign = "left";
    context.fillStyle = this.colors.accent;
    let end = 0;
    for (const mark of this.marks) {
      const at = box.across(mark.at);
      if (!(at >= LEFT && at <= this.width - RIGHT)) continue;
      context.fillRect(at - 1, y, 2, 10);
      const text = mark.text || "", wide = context.measureText(text).width, left = Math.min(at + 4, this.width - RIGHT - wide);
      if (left < end) continue;
      context.fillText(text, left, y);
      end = left + wide + 8;
    }
  }

  // values of the legend: the last, or those at the cursors with their difference
  values(pane, curves) {
    const at = (data, x) => { const k = before(data.x, x); return k < 0 ? NaN : data.y[k]; };
    pane.curves.forEach((curve, k) => {
      const data = curves[k];
      if (!data.x.length) { curve.shown.textContent = ""; return; }
      const [a, b] = this.cursors.map((x) => at(data, x));
      const text = pane.own ? "" : this.cursors.length === 2 ? `${number(a, 0)} → ${number(b, 0)}, Δ ${number(b - a, 0)}`
        : this.cursors.length ? number(a, 0) : this.follow ? number(data.y[data.y.length - 1], 0) : "";
      if (curve.shown.textContent !== text) curve.shown.textContent = text;
    });
  }

  // ---- user actions

  listen() {
    const { canvas } = this, place = (event) => event.clientX - canvas.getBoundingClientRect().left;
    const time = (x) => { const [from, to] = this.axis(); return from + ((x - LEFT) / (this.width - LEFT - RIGHT)) * (to - from); };
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button > 1) return;
      canvas.setPointerCapture(event.pointerId);
      this.dragged = { begin: place(event), now: place(event), move: event.shiftKey || event.button === 1, axis: [...this.axis()] };
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!this.dragged) return;
      this.dragged.now = place(event);
      if (this.dragged.move && Math.abs(this.dragged.now - this.dragged.begin) > 3) {
        const [from, to] = this.dragged.axis, by = ((this.dragged.begin - this.dragged.now) / (this.width - LEFT - RIGHT)) * (to - from);
        this.zoom(from + by, to + by);
      }
      this.draw();
    });
    canvas.addEventListener("pointerup", (event) => {
      const drag = this.dragged;
      this.dragged = null;
      if (!drag) return;
      const far = Math.abs(drag.now - drag.begin) > 4;
      if (far && !drag.move) this.zoom(...[time(drag.begin), time(drag.now)].sort((a, b) => a - b));
      else if (!far) this.cursor(time(drag.now), event.shiftKey);
      this.draw();
    });
    canvas.addEventListener("pointercancel", () => { this.dragged = null; this.draw(); });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const factor = Math.pow(1.0015, event.deltaY), [from, to] = this.axis(), at = time(place(event));
      if (this.follow) { this.span = Math.min(Math.max(this.span * factor, 0.05), 3600); this.notify("window", this.seen()); return; }
      this.zoom(at - (at - from) * factor, at + (to - at) * factor);
    }, { passive: false });
    canvas.addEventListener("dblclick", () => {
      this.cursors = []; this.window = null; this.follow = this.wasFollowing || this.follow; this.stale = true;
      this.notify("window", this.seen()); this.notify("cursors", {});
    });
    this.element.addEventListener("dragover", (event) => event.preventDefault());
    this.element.addEventListener("drop", (event) => {
      event.preventDefault();
      const y = event.clientY - canvas.getBoundingClientRect().top, name = event.dataTransfer.getData("text/plain");
      const pane = this.boxes.findIndex((box) => y >= box.top - TOP && y <= box.top + box.height + GAP);
      if (name) this.notify("drop", { name, pane });
    });
  }

  zoom(from, to) {
    if (!(to - from > 1e-9)) return;
    if (this.follow) this.wasFollowing = true;
    this.follow = false; this.window = [from, to]; this.stale = true;
    clearTimeout(this.notifyTimer);
    this.notifyTimer = setTimeout(() => this.notify("window", this.seen()), 150);
  }
  seen() { const [from, to] = this.axis(); return { from, to, follow: this.follow, span: this.span, all: !this.window }; }

  cursor(x, second) {
    if (second && this.cursors.length) this.cursors = [this.cursors[0], x];
    else this.cursors = this.cursors.length === 2 ? [] : [...this.cursors, x];
    const [a, b] = this.cursors;
    this.notify("cursors", { a, b });
  }
}

// range of a logarithmic axis
function decade(curves) {
  let low = Infinity, high = 0;
  for (const { y } of curves) for (const value of y) { if (value > 0 && value < low) low = value; if (value > high) high = value; }
  return high > 0 ? [Math.max(low, high * 1e-12) / 1.6, high * 1.6] : [0.1, 1];
}

function own(curves) {
  let low = Infinity, high = -Infinity;
  for (const { x } of curves) for (const value of x) { if (value < low) low = value; if (value > high) high = value; }
  return high > low ? [low, high] : [0, 1];
}

function line(context, x0, y0, x1, y1) { context.beginPath(); context.moveTo(x0, y0); context.lineTo(x1, y1); context.stroke(); }

function stroke(context, { x, y }, across, down, step) {
  context.beginPath();
  let open = false, previous = 0;
  for (let k = 0; k < x.length; k++) {
    const value = y[k];
    if (!(value === value)) { open = false; continue; }  // a gap where there is no value
    const at = across(x[k]), level = down(value);
    if (!open) { context.moveTo(at, level); open = true; }
    else { if (step) context.lineTo(at, previous); context.lineTo(at, level); }
    previous = level;
  }
  context.stroke();
}

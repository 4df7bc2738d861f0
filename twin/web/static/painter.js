// Drawing of a chart on its canvas: frames, curves, bands of seeds, limits, marks, cursors.

import { axis, decades, extent, nearest, number, ticks } from "./scale.js";

export const LEFT = 58;   // margins [px]
export const RIGHT = 14;
export const GAP = 10;    // between panes
export const BOTTOM = 26; // for the numbers of an axis
export const NAME = 8;    // more, for the name of an axis
export const TIMES = 19;  // for the times below a pane that is not the last
export const STRIP = 16;  // for the names of marks
const LEVELS = 3, TALL = 80; // least ticks of a vertical axis of at least this height [px]
const MOST = 2; // times the range of the curves: band, lines and limits are inside a vertical axis that they make no longer, so that curves have half of it
const NOTHING = { x: [], y: [] }, FAINT = 0.35, DIMMED = 0.12, AREA = 0.2;

// what stays while pointer, cursors and time move; `paintOverlays` copies it
export function paintCurves(chart) {
  const { picture, canvas, ratio } = chart, context = picture.getContext("2d");
  picture.width = canvas.width; picture.height = canvas.height;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.font = "11px system-ui, sans-serif";
  const lastTimed = chart.panes.findLastIndex((pane) => !pane.own);
  chart.panes.forEach((pane, index) => drawPane(chart, context, pane, chart.boxes[index]));
  if (lastTimed >= 0 && chart.marks.length) drawStrip(chart, context, chart.boxes[lastTimed]);
}

export function paintOverlays(chart) {
  const { picture, canvas, ratio } = chart, context = canvas.getContext("2d");
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.clearRect(0, 0, canvas.width, canvas.height);
  context.drawImage(picture, 0, 0);
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  chart.panes.forEach((pane, index) => {
    const box = chart.boxes[index];
    context.save();
    clip(chart, context, box);
    if (pane.own) drawInstants(chart, context, pane, box); else drawOverlays(chart, context, pane, box);
    drawZoom(chart, context, pane, box, index);
    drawHover(chart, context, pane, box);
    context.restore();
  });
}

function clip(chart, context, box) { context.beginPath(); context.rect(LEFT, box.top, chart.width - LEFT - RIGHT, box.height); context.clip(); }

// scales of a pane: functions from values to pixels
function fitPane(chart, pane, box, shown, more) {
  const [from, to] = pane.own ? pane.domain ?? ownExtent(shown) : chart.axis();
  const logX = (pane.log || "").includes("x"), logY = (pane.log || "").includes("y");
  const [low, high] = pane.range ?? (logY ? decadeRange(shown) : verticalRange(chart, pane, [...shown, ...more], from, to));
  const across = axis(from, to, logX, LEFT, chart.width - LEFT - RIGHT), down = axis(high, low, logY, box.top, box.height);
  Object.assign(box, { across, down, from, to, low, high, logX, logY });
}

// The range of the visible samples, or of all panes that share it, with references from the nearest on, as long as the curves keep half of the axis.
// Violated limits of a pane with an axis of its own are in any case; a live axis has all, since it must not jump, but limits of warnings only while they are exceeded: far ones would flatten its curves.
export function verticalRange(chart, pane, series, from, to) {
  const group = pane.axis ? chart.panes.filter(({ axis: own }) => own === pane.axis) : [pane];
  const all = group.length > 1 ? group.flatMap((other) => { const { curves, more } = seriesOf(chart, other); return [...curves, ...more]; }) : series;
  const own = pane.extent ? [{ x: [from, from], y: pane.extent }] : all, range = extent(own, from, to, []), most = MOST * (range[1] - range[0]), near = [];
  const shared = (pane.shared || []).map((y) => ({ y })), far = [...group.flatMap(references), ...shared].map((one) => [Math.max(range[0] - one.y, one.y - range[1], 0), one]).sort(([a], [b]) => a - b);
  for (const [, { y, failed, warns }] of far) {
    const isWanted = warns ? (y < 0 ? range[0] < y : range[1] > y) : (failed && !pane.extent) || chart.follow;
    if (isWanted || Math.max(range[1], y, ...near) - Math.min(range[0], y, ...near) <= most) near.push(y);
  }
  return near.length ? extent(own, from, to, near) : range;
}

// Faint curves as far as they count for the vertical axis: by the size of the others, which they would flatten.
function limited(faint, curves) {
  let low = Infinity, high = -Infinity;
  for (const { y } of curves) for (const value of y) { if (value < low) low = value; if (value > high) high = value; }
  const size = low > high ? 0 : Math.max(high - low, Math.abs(low), Math.abs(high));
  return size < 1e-9 ? faint : faint.map(({ x, y }) => ({ x, y: y.map((value) => Math.min(Math.max(value, low - size), high + size)) }));
}

const references = (pane) => [...(pane.band || []).map((y) => ({ y, name: "band" })), ...(pane.lines || []).map((y) => ({ y, name: "line" })), ...(pane.limits || []).map((one) => ({ name: "limit", ...one }))];

// the samples of the curves of a pane, and those around and behind them
function seriesOf(chart, pane) {
  const of = (name) => chart.data[name] || NOTHING, curves = pane.curves.map((curve) => of(curve.name));
  const more = pane.curves.flatMap((curve) => [curve.low, curve.high].filter(Boolean).map(of));
  return { of, curves, more: [...more, ...limited(pane.curves.map((curve) => of(curve.faint)), curves)] };
}

function drawPane(chart, context, pane, box) {
  const { of, curves, more } = seriesOf(chart, pane);
  const logY = (pane.log || "").includes("y"), shown = logY ? curves.map(({ x, y }) => ({ x, y: y.map((value) => (value > 0 ? value : NaN)) })) : curves;
  fitPane(chart, pane, box, shown, more);
  box.shown = shown;
  drawFrame(chart, context, pane, box);
  context.save();
  clip(chart, context, box);
  context.lineJoin = "round";
  const order = [...pane.curves.entries()].sort(([, a], [, b]) => (b.width ?? 0) - (a.width ?? 0)); // wide ones below
  for (const [k, curve] of order) {
    const part = chart.dimmed.has(curve.name) ? DIMMED : curve.opacity ?? 1;
    context.strokeStyle = context.fillStyle = chart.colors.lines[curve.color % 8];
    context.globalAlpha = AREA * part;
    if (curve.low) fillBetween(context, of(curve.low), of(curve.high), box);
    context.globalAlpha = FAINT * part;
    stroke(context, of(curve.faint), box, curve.step);
    context.globalAlpha = part;
    context.setLineDash(curve.dash || []);
    context.lineWidth = curve.width ?? 1.4;
    stroke(context, shown[k], box, curve.step);
    context.setLineDash([]);
  }
  context.globalAlpha = 1; context.lineWidth = 1.4;
  context.setLineDash([4, 3]);
  for (const one of pane.limits || []) {
    context.strokeStyle = one.color !== undefined ? chart.colors.lines[one.color % 8] : one.failed ? chart.colors.fail : chart.colors.text;
    line(context, box.across(Math.max(one.from, box.from)), box.down(one.y), box.across(Math.min(one.to, box.to)), box.down(one.y));
  }
  context.restore();
  showBeyond(pane, box);
  if (chart.frames && pane.curves.length && !pane.curves.some(({ name }) => chart.data[name])) {
    context.fillStyle = chart.colors.text; context.textAlign = "center"; context.textBaseline = "middle";
    context.fillText("Loading ...", chart.width / 2, box.top + box.height / 2);
  }
}

// names and values of the references above and below the vertical axis, in the legend where they cover no curve
function showBeyond(pane, box) {
  const named = [...new Map(references(pane).map(({ y, name }) => [y, `${name} ${number(y, 0)}`]))].sort(([a], [b]) => a - b);
  const texts = named.filter(([y]) => y > box.high || y < box.low).map(([y, text]) => `${text} ${y > box.high ? "\u2191" : "\u2193"}`);
  if (pane.beyond.textContent !== texts.join(", ")) pane.beyond.textContent = texts.join(", ");
}

function drawFrame(chart, context, pane, box) {
  const { colors } = chart, width = chart.width - LEFT - RIGHT, bottom = box.top + box.height;
  context.beginPath();
  for (const one of pane.own ? [] : pane.spans || []) {
    const a = Math.max(box.across(one.from), LEFT), b = Math.min(box.across(one.to), LEFT + width);
    if (one.to >= box.from && one.from <= box.to) context.rect(a, box.top, Math.max(b - a, 2), box.height);
  }
  context.fillStyle = colors.violation;
  context.fill(); // once: spans of many cases hide no curve
  if (pane.band) {
    context.fillStyle = colors.band;
    const [above, below] = [pane.band[1], pane.band[0]].map((y) => Math.min(Math.max(box.down(y), box.top), bottom));
    context.fillRect(LEFT, above, width, below - above);
  }
  context.strokeStyle = colors.grid; context.fillStyle = colors.text; context.lineWidth = 1;
  const rows = box.logY ? decades(box.low, box.high) : levels(box);
  context.textAlign = "right"; context.textBaseline = "middle";
  for (const y of rows.at) {
    const at = Math.round(box.down(y)) + 0.5;
    line(context, LEFT, at, LEFT + width, at);
    context.fillText(number(y, rows.step), LEFT - 6, at);
  }
  drawColumns(context, pane, box, width);
  context.setLineDash([4, 4]); context.strokeStyle = colors.text;
  for (const y of pane.lines || []) if (y >= box.low && y <= box.high) line(context, LEFT, box.down(y), LEFT + width, box.down(y));
  context.setLineDash([]);
}

// ticks of a vertical axis: three or more, unless it is too short for their numbers
function levels({ low, high, height }) {
  let count = height / 34, rows = ticks(low, high, count);
  while (rows.at.length < LEVELS && height >= TALL && count < 20) rows = ticks(low, high, (count += 1));
  return rows;
}

function drawColumns(context, pane, box, width) {
  const bottom = box.top + box.height, columns = box.logX ? decades(box.from, box.to) : ticks(box.from, box.to, width / 90);
  const name = (pane.own && pane.x && [pane.x.label, pane.x.unit].filter(Boolean).join(" ")) || "";
  context.textAlign = "center"; context.textBaseline = "top";
  for (const x of columns.at) {
    const at = Math.round(box.across(x)) + 0.5;
    line(context, at, box.top, at, bottom);
    const text = number(x, columns.step) + (pane.own || x !== columns.at.at(-1) ? "" : " s");
    const half = context.measureText(text).width / 2;
    context.fillText(text, Math.min(at, LEFT + width + RIGHT - half), bottom + 5);
  }
  context.fillText(name, LEFT + width / 2, bottom + 18); // times have their unit
}

// whether a pane shows a mark: where its curves reach, and in its variants only
export function isMarked({ case: own, reach }, { at, variants = [] }) {
  return (!reach || (reach[0] <= at && at <= reach[1])) && (!own || !variants.length || variants.includes(own[0]));
}

function drawOverlays(chart, context, pane, box) {
  const bottom = box.top + box.height, { colors } = chart;
  context.font = "10px system-ui, sans-serif"; context.textBaseline = "top";
  context.strokeStyle = colors.accent; context.globalAlpha = 0.4; context.setLineDash([2, 3]);
  for (const mark of chart.marks.filter((one) => isMarked(pane, one))) { const at = box.across(mark.at); line(context, at, box.top, at, bottom); }
  context.globalAlpha = 1; context.setLineDash([]);
  chart.cursors.forEach((x, k) => {
    const at = box.across(x);
    context.strokeStyle = context.fillStyle = colors.ink;
    context.lineWidth = 1; line(context, at, box.top, at, bottom);
    context.textAlign = "left";
    context.fillText(`t${k + 1}`, at + 3, bottom - 12);
  });
  if (chart.time !== null && isMarked(pane, { at: chart.time })) {
    const at = box.across(chart.time);
    context.strokeStyle = context.fillStyle = colors.accent; context.lineWidth = 1.5;
    line(context, at, box.top, at, bottom);
    context.beginPath(); context.moveTo(at - 5, box.top); context.lineTo(at + 5, box.top); context.lineTo(at, box.top + 7); context.fill();
  }
  context.font = "11px system-ui, sans-serif";
}

// what a drag zooms to: a time in all panes, a part of the vertical axis in its own
function drawZoom(chart, context, pane, box, index) {
  const drag = chart.gesture, { along } = drag?.kind === "zoom" ? drag : {}, isOwn = drag?.pane === index;
  if (!along || !(isOwn || (along.across && !pane.own && !chart.panes[drag.pane].own))) return;
  const [left, right] = along.across ? [drag.begin, drag.now] : [LEFT, chart.width - RIGHT], [top, bottom] = along.down && isOwn ? [drag.y, drag.nowY] : [box.top, box.top + box.height];
  if (!along.across && !along.down) return;
  context.fillStyle = chart.colors.accent; context.globalAlpha = 0.18;
  context.fillRect(left, top, right - left, bottom - top);
  context.globalAlpha = 1;
}

// of curves over another quantity: their points at the cursors, at the time cursor and at the time under the pointer
function drawInstants(chart, context, pane, box) {
  const { colors, hover } = chart, named = chart.cursors.map((time, k) => [time, colors.ink, `t${k + 1}`]);
  if (chart.time !== null) named.push([chart.time, colors.accent, ""]);
  if (hover && hover.at !== null && chart.panes[hover.pane] !== pane) named.push([hover.at, null, ""]);
  const names = [];
  context.textBaseline = "bottom"; context.textAlign = "left"; context.lineWidth = 2;
  for (const [time, color, letter] of named) {
    pane.curves.forEach((curve, c) => {
      const { t } = chart.data[curve.name] || {}, k = t && !chart.dimmed.has(curve.name) ? nearest(t, time) : -1;
      if (k < 0 || time < t[0] || time > t[t.length - 1]) return;
      const [x, y] = [box.across(box.shown[c].x[k]), box.down(box.shown[c].y[k])];
      context.fillStyle = colors.lines[curve.color % 8]; context.strokeStyle = color;
      context.beginPath(); context.arc(x, y, color ? 4 : 3, 0, 7); context.fill();
      if (color) context.stroke();
      if (!letter) return;
      // the color says which curve: right of its point and above it, else left or below, inside the pane and beside other names
      const wide = context.measureText(letter).width, lefts = [x + 6, x - 6 - wide].filter((left) => left >= LEFT && left + wide <= chart.width - RIGHT);
      const free = [-4, 15, -15, 26].map((by) => y + by).filter((level) => level - 11 >= box.top && level <= box.top + box.height).flatMap((level) => lefts.map((left) => ({ left, level })));
      const at = free.find(({ left, level }) => !names.some((other) => Math.abs(other.level - level) < 11 && Math.abs(other.left - left) < wide + 2));
      if (!at) return; // another one is where this would be
      names.push(at);
      context.fillText(letter, at.left, at.level);
    });
  }
}

// a thin line at the pointer, and dots on the samples whose values are read
function drawHover(chart, context, pane, box) {
  const hover = chart.hover;
  if (!hover) return;
  context.strokeStyle = chart.colors.text; context.lineWidth = 1; context.globalAlpha = 0.6;
  if (!pane.own && hover.at !== null) line(context, box.across(hover.at), box.top, box.across(hover.at), box.top + box.height);
  context.globalAlpha = 1;
  if (chart.panes[hover.pane] !== pane) return;
  for (const { curve, x, y } of hover.dots) {
    context.fillStyle = chart.colors.lines[pane.curves[curve].color % 8];
    context.beginPath(); context.arc(box.across(x), box.down(y), 3, 0, 7); context.fill();
  }
}

// names of the marks below the last pane, those that are `first` before others, in lines of which each name takes the first with room; a name that would cover others is left out
function drawStrip(chart, context, box) {
  const y = box.top + box.height + BOTTOM, lines = Array.from({ length: chart.strips }, () => []);
  context.font = "11px system-ui, sans-serif"; context.textBaseline = "top"; context.textAlign = "left";
  context.fillStyle = chart.colors.accent;
  for (const mark of [...chart.marks].sort((a, b) => !!b.first - !!a.first)) {
    const at = box.across(mark.at);
    if (!(at >= LEFT && at <= chart.width - RIGHT)) continue;
    context.fillRect(at - 1, y - 7, 2, 6); // above the names, which it would cross
    const text = mark.text || "", wide = context.measureText(text).width, left = Math.max(Math.min(at - 1, chart.width - RIGHT - wide), 0);
    const free = lines.findIndex((taken) => !taken.some(([from, to]) => left < to && left + wide + 8 > from));
    if (free < 0) continue;
    context.fillText(text, left, y + free * STRIP);
    lines[free].push([left, left + wide + 8]);
  }
}

// range of a logarithmic axis, of six decades at most
function decadeRange(curves) {
  let low = Infinity, high = 0;
  for (const { y } of curves) for (const value of y) { if (value > 0 && value < low) low = value; if (value > high) high = value; }
  return high > 0 ? [Math.max(low, high * 1e-6) / 1.6, high * 1.6] : [0.1, 1];
}

export function ownExtent(curves) {
  let low = Infinity, high = -Infinity;
  for (const { x } of curves) for (const value of x) { if (value < low) low = value; if (value > high) high = value; }
  return high > low ? [low, high] : [0, 1];
}

function line(context, x0, y0, x1, y1) { context.beginPath(); context.moveTo(x0, y0); context.lineTo(x1, y1); context.stroke(); }

function stroke(context, { x, y }, { across, down }, step) {
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

function fillBetween(context, low, high, { across, down }) {
  context.beginPath();
  for (let k = 0; k < low.x.length; k++) context.lineTo(across(low.x[k]), down(low.y[k]));
  for (let k = high.x.length - 1; k >= 0; k--) context.lineTo(across(high.x[k]), down(high.y[k]));
  context.fill();
  Object.assign(context, { globalAlpha: Math.min(3 * context.globalAlpha, 1), lineWidth: 0.6 }); // an edge, seen on a wide line of another run
  context.stroke();
}

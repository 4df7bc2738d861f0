// Drawing of a chart on its canvas: frames, curves, bands of seeds, limits, marks, cursors.

import { decades, extent, number, ticks } from "./scale.js";

export const LEFT = 58;   // margins [px]
export const RIGHT = 14;
export const GAP = 10;    // between panes
export const BOTTOM = 26; // for the numbers of an axis
export const STRIP = 16;  // for the names of marks
const LEVELS = 3, TALL = 80; // least ticks of a vertical axis of at least this height [px]
const NOTHING = { x: [], y: [] }, FAINT = 0.35, DIMMED = 0.12, AREA = 0.2;

// what stays while pointer, cursors and time move; `paintOverlays` copies it
export function paintCurves(chart) {
  const { picture, canvas, ratio } = chart, context = picture.getContext("2d");
  picture.width = canvas.width; picture.height = canvas.height;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.font = "11px system-ui, sans-serif";
  const lastTimed = chart.panes.findLastIndex((pane) => !pane.own);
  chart.panes.forEach((pane, index) => drawPane(chart, context, pane, chart.boxes[index], index === lastTimed));
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
    if (!pane.own) drawOverlays(chart, context, box);
    drawHover(chart, context, pane, box);
    context.restore();
  });
}

function clip(chart, context, box) { context.beginPath(); context.rect(LEFT, box.top, chart.width - LEFT - RIGHT, box.height); context.clip(); }

// scales of a pane: functions from values to pixels
function fitPane(chart, pane, box, shown, more) {
  const [from, to] = pane.own ? ownExtent(shown) : chart.axis();
  const logX = (pane.log || "").includes("x"), logY = (pane.log || "").includes("y"), extra = [...(pane.band || []), ...(pane.lines || [])];
  let [low, high] = extent([...shown, ...more], from, to, extra);
  const near = (pane.limits || []).filter(({ y, failed }) => failed || (y > 2 * low - high && y < 2 * high - low)).map(({ y }) => y);
  if (near.length) [low, high] = extent([...shown, ...more], from, to, [...extra, ...near]);
  if (logY) [low, high] = decadeRange(shown);
  if (pane.range) [low, high] = pane.range;
  const width = chart.width - LEFT - RIGHT, log = Math.log10;
  const across = logX ? (x) => LEFT + ((log(x) - log(from)) / (log(to) - log(from))) * width : (x) => LEFT + ((x - from) / (to - from)) * width;
  const down = logY ? (y) => box.top + (1 - (log(y) - log(low)) / (log(high) - log(low))) * box.height : (y) => box.top + (1 - (y - low) / (high - low)) * box.height;
  Object.assign(box, { across, down, from, to, low, high, logX, logY });
}

function drawPane(chart, context, pane, box, last) {
  const of = (name) => chart.data[name] || NOTHING, curves = pane.curves.map((curve) => of(curve.name));
  const logY = (pane.log || "").includes("y"), shown = logY ? curves.map(({ x, y }) => ({ x, y: y.map((value) => (value > 0 ? value : NaN)) })) : curves;
  const more = pane.curves.flatMap((curve) => [curve.faint, curve.low, curve.high].filter(Boolean).map(of));
  fitPane(chart, pane, box, shown, more);
  box.shown = shown;
  drawFrame(chart, context, pane, box, last);
  context.save();
  clip(chart, context, box);
  context.lineJoin = "round"; context.lineWidth = 1.4;
  pane.curves.forEach((curve, k) => {
    const part = chart.dimmed.has(curve.name) ? DIMMED : curve.opacity ?? 1;
    context.strokeStyle = context.fillStyle = chart.colors.lines[curve.color % 8];
    context.globalAlpha = AREA * part;
    if (curve.low) fillBetween(context, of(curve.low), of(curve.high), box);
    context.globalAlpha = FAINT * part;
    stroke(context, of(curve.faint), box, curve.step);
    context.globalAlpha = part;
    context.setLineDash(curve.dash || []);
    stroke(context, shown[k], box, curve.step);
    context.setLineDash([]);
  });
  context.globalAlpha = 1;
  context.setLineDash([4, 3]);
  for (const one of pane.limits || []) {
    context.strokeStyle = one.failed ? chart.colors.fail : chart.colors.accent;
    line(context, box.across(Math.max(one.from, box.from)), box.down(one.y), box.across(Math.min(one.to, box.to)), box.down(one.y));
  }
  context.restore();
}

function drawFrame(chart, context, pane, box, last) {
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
    context.fillRect(LEFT, box.down(pane.band[1]), width, box.down(pane.band[0]) - box.down(pane.band[1]));
  }
  context.strokeStyle = colors.grid; context.fillStyle = colors.text; context.lineWidth = 1;
  const rows = box.logY ? decades(box.low, box.high) : levels(box);
  context.textAlign = "right"; context.textBaseline = "middle";
  for (const y of rows.at) {
    const at = Math.round(box.down(y)) + 0.5;
    line(context, LEFT, at, LEFT + width, at);
    context.fillText(number(y, rows.step), LEFT - 6, at);
  }
  drawColumns(context, pane, box, width, last || pane.own);
  context.setLineDash([4, 4]); context.strokeStyle = colors.text;
  for (const y of pane.lines || []) line(context, LEFT, box.down(y), LEFT + width, box.down(y));
  context.setLineDash([]);
}

// ticks of a vertical axis: three or more, unless it is too short for their numbers
function levels({ low, high, height }) {
  let count = height / 34, rows = ticks(low, high, count);
  while (rows.at.length < LEVELS && height >= TALL && count < 20) rows = ticks(low, high, (count += 1));
  return rows;
}

function drawColumns(context, pane, box, width, numbered) {
  const bottom = box.top + box.height, columns = box.logX ? decades(box.from, box.to) : ticks(box.from, box.to, width / 90);
  const name = (pane.own && pane.x && [pane.x.label, pane.x.unit].filter(Boolean).join(" ")) || "s";
  const free = 16 + context.measureText(name).width;  // the name of the axis stands left of its numbers
  context.textAlign = "center"; context.textBaseline = "top";
  for (const x of columns.at) {
    const at = Math.round(box.across(x)) + 0.5;
    line(context, at, box.top, at, bottom);
    const text = number(x, columns.step);
    if (numbered && at - context.measureText(text).width / 2 > free) context.fillText(text, at, bottom + 5);
  }
  if (!numbered) return;
  context.textAlign = "left";
  context.fillText(name, 8, bottom + 5);
}

function drawOverlays(chart, context, box) {
  const bottom = box.top + box.height, { colors } = chart;
  context.font = "10px system-ui, sans-serif"; context.textBaseline = "top";
  context.strokeStyle = colors.accent; context.globalAlpha = 0.4; context.setLineDash([2, 3]);
  for (const mark of chart.marks) { const at = box.across(mark.at); line(context, at, box.top, at, bottom); }
  context.globalAlpha = 1; context.setLineDash([]);
  chart.cursors.forEach((x, k) => {
    const at = box.across(x);
    context.strokeStyle = context.fillStyle = colors.ink;
    context.lineWidth = 1; line(context, at, box.top, at, bottom);
    context.textAlign = "left";
    context.fillText("AB"[k], at + 3, bottom - 12);
  });
  if (chart.time !== null) {
    const at = box.across(chart.time);
    context.strokeStyle = context.fillStyle = colors.accent; context.lineWidth = 1.5;
    line(context, at, box.top, at, bottom);
    context.beginPath(); context.moveTo(at - 5, box.top); context.lineTo(at + 5, box.top); context.lineTo(at, box.top + 7); context.fill();
  }
  const drag = chart.gesture;
  if (drag?.kind === "zoom" && Math.abs(drag.now - drag.begin) > 4) {
    context.fillStyle = colors.accent; context.globalAlpha = 0.18;
    context.fillRect(drag.begin, box.top, drag.now - drag.begin, box.height);
    context.globalAlpha = 1;
  }
  context.font = "11px system-ui, sans-serif";
}

// a thin line at the pointer, and dots on the samples whose values are read
function drawHover(chart, context, pane, box) {
  const hover = chart.hover;
  if (!hover) return;
  context.strokeStyle = chart.colors.text; context.lineWidth = 1; context.globalAlpha = 0.6;
  if (!pane.own && hover.at !== null) line(context, box.across(hover.at), box.top, box.across(hover.at), box.top + box.height);
  context.globalAlpha = 1;
  if (chart.panes[hover.pane] !== pane) return;
  for (const { curve, k } of hover.samples) {
    context.fillStyle = chart.colors.lines[pane.curves[curve].color % 8];
    context.beginPath(); context.arc(box.across(box.shown[curve].x[k]), box.down(box.shown[curve].y[k]), 3, 0, 7); context.fill();
  }
}

// names of the marks, in one line below the last pane; a name that would cover the one before is left out
function drawStrip(chart, context, box) {
  const y = box.top + box.height + BOTTOM;
  context.font = "11px system-ui, sans-serif"; context.textBaseline = "top"; context.textAlign = "left";
  context.fillStyle = chart.colors.accent;
  let end = 0;
  for (const mark of chart.marks) {
    const at = box.across(mark.at);
    if (!(at >= LEFT && at <= chart.width - RIGHT)) continue;
    context.fillRect(at - 1, y, 2, 10);
    const text = mark.text || "", wide = context.measureText(text).width, left = Math.min(at + 4, chart.width - RIGHT - wide);
    if (left < end) continue;
    context.fillText(text, left, y);
    end = left + wide + 8;
  }
}

// range of a logarithmic axis, of six decades at most
function decadeRange(curves) {
  let low = Infinity, high = 0;
  for (const { y } of curves) for (const value of y) { if (value > 0 && value < low) low = value; if (value > high) high = value; }
  return high > 0 ? [Math.max(low, high * 1e-6) / 1.6, high * 1.6] : [0.1, 1];
}

function ownExtent(curves) {
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
}

// Gestures on a chart: zoom, move, cursors and time cursor that are dragged and snap to samples, heights of panes, read-out under the pointer.

import { nearest, number, readable, readableTime } from "./scale.js";
import { LEFT, RIGHT, GAP, ownExtent } from "./painter.js";

const NEAR = 6, FAR = 4, LONG = 20, REST = 30; // [px]: to grasp a line; to be a drag rather than a click; to zoom along both axes; until the samples at the pointer are read [ms]

export function listenTo(chart) {
  const { canvas } = chart;
  const place = (event) => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button > 1) return;
    canvas.setPointerCapture(event.pointerId);
    const [x, y] = place(event), grasped = graspedAt(chart, x, y) || { kind: event.shiftKey || event.button === 1 ? "move" : "zoom" }, pane = paneAt(chart, y);
    chart.gesture = { ...grasped, pane, box: chart.boxes[pane], begin: x, now: x, y, nowY: y, weights: chart.panes.map((one) => one.weight || 1) };
  });
  canvas.addEventListener("pointermove", (event) => {
    const [x, y] = place(event);
    if (chart.gesture) { Object.assign(chart.gesture, { now: x, nowY: y }); GESTURES[chart.gesture.kind](chart, chart.gesture, x, y); }
    canvas.style.cursor = SHAPES[(chart.gesture || graspedAt(chart, x, y))?.kind] || "";
    chart.setHover(chart.gesture?.kind === "zoom" || chart.gesture?.kind === "edge" ? null : hoverAt(chart, x, y, event));
    refine(chart, x, y, event);
  });
  canvas.addEventListener("pointerup", (event) => {
    const drag = chart.gesture;
    chart.gesture = null;
    chart.clicked = null;
    if (!drag) return;
    if (isDrag(drag)) { if (drag.kind === "zoom") zoomTo(chart, drag); } else chart.clicked = drag;
    chart.redraw();
  });
  // after `pointerup`; the second click of a double-click sets no cursor, and the first one is taken back
  canvas.addEventListener("click", (event) => {
    const drag = chart.clicked;
    if (!drag || event.detail > 1) return;
    chart.cursorsBefore = [...chart.cursors];
    if (drag.kind === "cursor") chart.removeCursor(drag.index);
    else if (drag.kind !== "edge") chart.placeCursor(snapped(chart, drag.now, drag.y), event.shiftKey);
  });
  canvas.addEventListener("pointercancel", () => { chart.gesture = null; chart.redraw(false); });
  canvas.addEventListener("pointerleave", () => chart.setHover(null));
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const factor = Math.pow(1.0015, event.deltaY), [x, y] = place(event), index = paneAt(chart, y), box = chart.boxes[index];
    if (!box?.across) return;
    const about = (scale, ends, at) => ends.map((end) => scale.inverse(at + (scale(end) - at) * factor)), isOwn = chart.panes[index].own;
    const range = { range: about(box.down, [box.low, box.high], y) }, across = about(box.across, [box.from, box.to], x);
    if (x < LEFT) chart.zoomPane(index, range);
    else if (isOwn) { const [low, high] = ownExtent(box.shown); chart.zoomPane(index, { domain: across.map((end) => Math.min(Math.max(end, low), high)), ...(y <= box.top + box.height && !box.logX ? range : {}) }); }
    else if (chart.follow) { chart.span = Math.min(Math.max(chart.span * factor, 0.05), 3600); chart.notify("window", chart.seen()); }
    else chart.zoom(...across);
  }, { passive: false });
  canvas.addEventListener("dblclick", (event) => {
    if (chart.cursorsBefore) { chart.cursors = chart.cursorsBefore; chart.notifyCursors(); }
    chart.showAll(paneAt(chart, place(event)[1]));
  });
  chart.element.addEventListener("dragover", (event) => event.preventDefault());
  chart.element.addEventListener("drop", (event) => {
    event.preventDefault();
    const name = event.dataTransfer.getData("text/plain");
    if (name) chart.notify("drop", { name, pane: paneAt(chart, place(event)[1]) });
  });
}

const SHAPES = { cursor: "ew-resize", time: "ew-resize", edge: "row-resize", move: "grabbing" };

const isDrag = ({ begin, now, y, nowY }) => Math.max(Math.abs(now - begin), Math.abs(nowY - y)) > FAR;

// along which axes a drag zooms: along both if it is long in both
function axesOf(drag) {
  const wide = Math.abs(drag.now - drag.begin), tall = Math.abs(drag.nowY - drag.y);
  return { across: wide > FAR && (wide >= LONG || wide >= tall), down: tall > FAR && tall > wide / 4 && (tall >= LONG || tall > wide) };
}

function zoomTo(chart, { begin, now, y, nowY, pane, box, along }) {
  if (!box?.across) return;
  const sorted = (scale, ...ends) => ends.map(scale.inverse).sort((a, b) => a - b), isOwn = chart.panes[pane].own, across = along.across && sorted(box.across, begin, now);
  const inside = (at) => Math.min(Math.max(at, box.top), box.top + box.height);
  if (across && !isOwn) chart.zoom(...across);
  if (along.down || (across && isOwn)) chart.zoomPane(pane, { ...(across && isOwn ? { domain: across } : {}), ...(along.down ? { range: sorted(box.down, inside(y), inside(nowY)) } : {}) });
}

const GESTURES = {
  zoom(chart, drag) { drag.along = axesOf(drag); chart.redraw(false); },
  move(chart, drag) {
    const { box, pane } = drag, own = chart.panes[pane];
    if (!box?.across || !isDrag(drag)) return;
    const moved = (scale, ends, by) => ends.map((end) => scale.inverse(scale(end) - by)), across = moved(box.across, [box.from, box.to], drag.now - drag.begin);
    if (!own.own) chart.zoom(...across);
    if (own.own || own.range) chart.zoomPane(pane, { ...(own.own ? { domain: across } : {}), range: moved(box.down, [box.low, box.high], drag.nowY - drag.y) });
  },
  cursor(chart, drag, x) {
    chart.cursors = chart.cursors.map((one, k) => (k === drag.index ? snapped(chart, x, drag.y) : one));
    chart.notifyCursors();
  },
  time(chart, _, x) {
    const [from, to] = chart.full;
    chart.setTime(Math.min(Math.max(timeAt(chart, x), from), to));
    chart.notify("time", { at: chart.time });
  },
  edge(chart, drag, _, y) { chart.resizePanes(drag.index, y - drag.y, drag.weights); },
};

const timeAt = (chart, x) => { const [from, to] = chart.axis(); return from + ((x - LEFT) / (chart.width - LEFT - RIGHT)) * (to - from); };
const paneAt = (chart, y) => chart.boxes.findIndex((box) => y >= box.head && y <= box.edge);

// what is under the pointer: a cursor, the time cursor, or the border between two panes
function graspedAt(chart, x, y) {
  const edge = chart.boxes.findIndex((box, k) => k < chart.boxes.length - 1 && Math.abs(y - box.edge) <= GAP / 2);
  if (edge >= 0) return { kind: "edge", index: edge };
  const index = paneAt(chart, y), box = chart.boxes[index];
  if (!box?.across || chart.panes[index].own || y < box.top) return null;
  const cursor = chart.cursors.findIndex((at) => Math.abs(box.across(at) - x) <= NEAR);
  if (cursor >= 0) return { kind: "cursor", index: cursor };
  return chart.time !== null && Math.abs(box.across(chart.time) - x) <= NEAR ? { kind: "time" } : null;
}

// the samples nearest to the pointer: over time those at its time, of spectra those at its frequency, of loops the points that are nearest to it
function samplesAt(chart, index, x, y, all = chart.samples) {
  const box = chart.boxes[index], pane = chart.panes[index], found = [], time = pane.own ? 0 : chart.snap(timeAt(chart, x), index);
  pane.curves.forEach((curve, c) => {
    const data = all[curve.name];
    if (!data?.x.length || chart.dimmed.has(curve.name)) return;
    if (!pane.own) { const k = nearest(data.x, time); found.push({ curve: c, k, far: Math.abs(box.across(data.x[k]) - x) }); return; }
    const near = { curve: c, k: -1, far: Infinity };
    for (let k = 0; k < data.x.length; k++) {
      const far = Math.hypot(box.across(data.x[k]) - x, box.logX ? 0 : box.down(data.y[k]) - y);
      if (far < near.far) Object.assign(near, { k, far });
    }
    if (near.k >= 0) found.push(near);
  });
  return found.sort((a, b) => a.far - b.far);
}

// the time of the sample nearest to a place; of the place itself where nothing is drawn, before the first sample or after the last; null: of a spectrum
function snapped(chart, x, y) {
  const index = paneAt(chart, y), pane = chart.panes[index], time = timeAt(chart, x);
  const [first] = pane ? samplesAt(chart, index, x, y) : [];
  if (pane?.own) return (first && chart.samples[pane.curves[first.curve].name].t?.[first.k]) ?? null;
  if (!first) return time;
  const times = chart.samples[pane.curves[first.curve].name].x, inside = times[0] <= time && time <= times[times.length - 1];
  return inside || first.far <= NEAR ? times[first.k] : time;
}

// `all`: samples of the pane's curves
function hoverAt(chart, x, y, event, all = chart.samples) {
  const index = paneAt(chart, y), box = chart.boxes[index];
  if (!box?.across || y < box.top || y > box.top + box.height || x < LEFT || x > chart.width - RIGHT) return null;
  const pane = chart.panes[index], found = samplesAt(chart, index, x, y, all);
  if (!found.length) return null;
  const first = found[0], data = all[pane.curves[first.curve].name], at = data.x[first.k], time = pane.own ? data.t?.[first.k] ?? null : at;
  const samples = !pane.own || box.logX ? found : time === null ? [first] : found.flatMap(({ curve }) => {  // of loops over time: all curves at the time of the nearest point
    const { t } = all[pane.curves[curve].name];
    return time < t[0] || time > t[t.length - 1] ? [] : [{ curve, k: nearest(t, time) }];
  });
  const title = pane.own ? (time === null ? titleOf(pane, box, at) : `${readableTime(time, ...chart.axis())} s`) : titleOf(pane, box, at) + spreadOf(pane, at, samples, all);
  const dots = samples.sort((a, b) => a.curve - b.curve).map(({ curve, k }) => { const { x, y } = all[pane.curves[curve].name]; return { curve, x: x[k], y: y[k] }; });
  return { pane: index, box, x, clientX: event.clientX, at: time, dots, title, notes: pane.own ? [] : notesAt(pane, at),
           rows: samples.map(({ curve, k }) => rowOf(pane, box, pane.curves[curve], k, all)) };
}

// the values of the curves of a pane at a time that its curves reach
export function rowsAt(chart, index, time) {
  const pane = chart.panes[index], box = chart.boxes[index], all = chart.samples, { reach = [-Infinity, Infinity] } = pane;
  const curves = pane.own || time < reach[0] || time > reach[1] ? [] : pane.curves.filter(({ name }) => all[name]?.x.length && !chart.dimmed.has(name));
  return curves.map((curve) => rowOf(pane, box, curve, nearest(all[curve.name].x, time), all));
}

// once the pointer rests, read the samples at it where only extremes of them are drawn
function refine(chart, x, y, event) {
  clearTimeout(chart.resting);
  const { hover } = chart, pane = chart.panes[hover?.pane];
  if (!pane || pane.own || chart.follow || chart.samples !== chart.data) return;
  const names = pane.curves.flatMap((curve) => [curve.name, curve.low, curve.high]).filter(Boolean), at = timeAt(chart, x);
  if (names.some((name) => chart.data[name]?.count > chart.data[name]?.x.length)) chart.resting = setTimeout(async () => {
    const frame = await chart.source({ names, points: 16, from: at, to: at });
    if (frame && chart.hover === hover) chart.setHover(hoverAt(chart, x, y, event, Object.fromEntries(names.map((name, k) => [name, frame.curves[k]]))));
  }, REST);
}

// texts of the failed spans at a time, each once
function notesAt(pane, at) { return [...new Set((pane.spans || []).filter((one) => one.text && one.from <= at && at <= one.to).map((one) => one.text))]; }

function titleOf(pane, box, at) {
  if (!pane.own) return `${readableTime(at, box.from, box.to)} s`;
  const text = box.logX ? number(at, 0) : readable(at, box.from, box.to, 1000, 0);
  return `${pane.x?.label || "x"} ${text} ${(pane.x?.unit || "").replace(/[[\]]/g, "")}`;
}

// how far the shown samples are from the time above them: of a thinned curve only extremes are drawn
function spreadOf(pane, at, samples, all) {
  const far = Math.max(...samples.flatMap(({ curve, k }) => {
    const { name, low, high } = pane.curves[curve], x = all[name].x[k];
    return [x, ...[low, high].map((edge) => all[edge]?.x).filter((own) => own?.length).map((own) => own[nearest(own, x)])].map((one) => Math.abs(one - at));
  }));
  return far > 1e-9 ? `, within ${Number((1e3 * far).toPrecision(2))} ms` : "";
}

function rowOf(pane, box, curve, k, all) {
  const value = (data, index) => curve.codes?.[data.y[index]] ?? (box.logY ? number(data.y[index], 0) : readable(data.y[index], box.low, box.high)), own = all[curve.name], edges = [all[curve.low], all[curve.high]];
  const over = own.t ? ` over ${readable(own.x[k], box.from, box.to)} ${(pane.x?.unit || "").replace(/[[\]]/g, "")}` : "", band = edges.every((edge) => edge?.x.length) ? ` (seeds${curve.codes ? ":" : ""} ${[...new Set(edges.map((edge) => value(edge, nearest(edge.x, own.x[k]))))].join(" to ")})` : "";
  return { color: curve.color, dash: curve.dash, opacity: curve.opacity, width: curve.width, label: curve.short || curve.label || curve.name, text: `${value(own, k)} ${curve.codes ? "" : pane.unit ?? ""}${over}${band}`.replace(/ +/g, " ") };
}

// Gestures on a chart: zoom, move, cursors and time cursor that are dragged and snap to samples, heights of panes, read-out under the pointer.

import { nearest, number, readable, readableTime } from "./scale.js";
import { LEFT, RIGHT, GAP } from "./painter.js";

const NEAR = 6, FAR = 4; // [px]: to grasp a line; to be a drag rather than a click

export function listenTo(chart) {
  const { canvas } = chart;
  const place = (event) => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button > 1) return;
    canvas.setPointerCapture(event.pointerId);
    const [x, y] = place(event), grasped = graspedAt(chart, x, y) || { kind: event.shiftKey || event.button === 1 ? "move" : "zoom" };
    chart.gesture = { ...grasped, begin: x, now: x, y, axis: [...chart.axis()], weights: chart.panes.map((pane) => pane.weight || 1) };
  });
  canvas.addEventListener("pointermove", (event) => {
    const [x, y] = place(event);
    if (chart.gesture) { chart.gesture.now = x; GESTURES[chart.gesture.kind](chart, chart.gesture, x, y); }
    canvas.style.cursor = SHAPES[(chart.gesture || graspedAt(chart, x, y))?.kind] || "";
    chart.setHover(chart.gesture?.kind === "zoom" || chart.gesture?.kind === "edge" ? null : hoverAt(chart, x, y, event));
  });
  canvas.addEventListener("pointerup", (event) => {
    const drag = chart.gesture, far = drag && Math.abs(drag.now - drag.begin) > FAR;
    chart.gesture = null;
    if (!drag) return;
    if (drag.kind === "zoom" && far) chart.zoom(...[timeAt(chart, drag.begin), timeAt(chart, drag.now)].sort((a, b) => a - b));
    else if ((drag.kind === "zoom" || drag.kind === "move") && !far) chart.placeCursor(snapped(chart, drag.now, drag.y), event.shiftKey);
    chart.redraw();
  });
  canvas.addEventListener("pointercancel", () => { chart.gesture = null; chart.redraw(false); });
  canvas.addEventListener("pointerleave", () => chart.setHover(null));
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const factor = Math.pow(1.0015, event.deltaY), [from, to] = chart.axis(), at = timeAt(chart, place(event)[0]);
    if (chart.follow) { chart.span = Math.min(Math.max(chart.span * factor, 0.05), 3600); chart.notify("window", chart.seen()); return; }
    chart.zoom(at - (at - from) * factor, at + (to - at) * factor);
  }, { passive: false });
  canvas.addEventListener("dblclick", () => chart.showAll());
  chart.element.addEventListener("dragover", (event) => event.preventDefault());
  chart.element.addEventListener("drop", (event) => {
    event.preventDefault();
    const name = event.dataTransfer.getData("text/plain");
    if (name) chart.notify("drop", { name, pane: paneAt(chart, place(event)[1]) });
  });
}

const SHAPES = { cursor: "ew-resize", time: "ew-resize", edge: "row-resize", move: "grabbing" };

const GESTURES = {
  zoom(chart) { chart.redraw(false); },
  move(chart, drag) {
    if (Math.abs(drag.now - drag.begin) <= FAR) return;
    const [from, to] = drag.axis, by = ((drag.begin - drag.now) / (chart.width - LEFT - RIGHT)) * (to - from);
    chart.zoom(from + by, to + by);
  },
  cursor(chart, drag, x, y) {
    chart.cursors = chart.cursors.map((one, k) => (k === drag.index ? snapped(chart, x, y) : one));
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
function samplesAt(chart, index, x, y) {
  const box = chart.boxes[index], pane = chart.panes[index], found = [];
  pane.curves.forEach((curve, c) => {
    const data = chart.data[curve.name];
    if (!data?.x.length || chart.dimmed.has(curve.name)) return;
    if (!pane.own) { const k = nearest(data.x, timeAt(chart, x)); found.push({ curve: c, k, far: Math.abs(box.across(data.x[k]) - x) }); return; }
    const near = { curve: c, k: -1, far: Infinity };
    for (let k = 0; k < data.x.length; k++) {
      const far = Math.hypot(box.across(data.x[k]) - x, box.logX ? 0 : box.down(data.y[k]) - y);
      if (far < near.far) Object.assign(near, { k, far });
    }
    if (near.k >= 0) found.push(near);
  });
  return found.sort((a, b) => a.far - b.far);
}

// the time of the sample nearest to a place; of the place itself where nothing is drawn, before the first sample or after the last
function snapped(chart, x, y) {
  const index = paneAt(chart, y), pane = chart.panes[index], time = timeAt(chart, x);
  const [first] = pane && !pane.own ? samplesAt(chart, index, x, y) : [];
  if (!first) return time;
  const times = chart.data[pane.curves[first.curve].name].x, inside = times[0] <= time && time <= times[times.length - 1];
  return inside || first.far <= NEAR ? times[first.k] : time;
}

function hoverAt(chart, x, y, event) {
  const index = paneAt(chart, y), box = chart.boxes[index];
  if (!box?.across || y < box.top || y > box.top + box.height || x < LEFT || x > chart.width - RIGHT) return null;
  const pane = chart.panes[index], found = samplesAt(chart, index, x, y), samples = pane.own && !box.logX ? found.slice(0, 1) : found;
  if (!samples.length) return null;
  const first = samples[0], at = chart.data[pane.curves[first.curve].name].x[first.k];
  return { pane: index, clientX: event.clientX, clientY: event.clientY, at: pane.own ? null : at, samples: samples.sort((a, b) => a.curve - b.curve), title: titleOf(pane, box, at) + (pane.own ? "" : spreadOf(chart, pane, box, at, samples)), notes: pane.own ? [] : notesAt(pane, at),
           rows: samples.map(({ curve, k }) => rowOf(chart, pane, box, pane.curves[curve], k)) };
}

// texts of the failed spans at a time, each once
function notesAt(pane, at) { return [...new Set((pane.spans || []).filter((one) => one.text && one.from <= at && at <= one.to).map((one) => one.text))]; }

function titleOf(pane, box, at) {
  if (!pane.own) return `${readableTime(at, box.from, box.to)} s`;
  const text = box.logX ? number(at, 0) : readable(at, box.from, box.to, 1000, 0);
  return `${pane.x?.label || "x"} ${text} ${(pane.x?.unit || "").replace(/[[\]]/g, "")}`;
}

// how far the shown samples are from the time above them: of a thinned curve only extremes are drawn, of a range those of a pixel are shown
function spreadOf(chart, pane, box, at, samples) {
  const far = Math.max(...samples.flatMap(({ curve, k }) => {
    const { name, low, high } = pane.curves[curve], x = chart.data[name].x[k], edges = [[chart.data[low], -1], [chart.data[high], 1]];
    return [x, ...edges.filter(([data]) => data?.x.length).map(([data, sign]) => data.x[extremeAt(data, x, box, sign)])].map((one) => Math.abs(one - at));
  }));
  return far > 1e-9 ? ` ± ${Number((1e3 * far).toPrecision(2))} ms` : "";
}

function rowOf(chart, pane, box, curve, k) {
  const value = (data, index) => (box.logY ? number(data.y[index], 0) : readable(data.y[index], box.low, box.high));
  const own = chart.data[curve.name], [low, high] = [chart.data[curve.low], chart.data[curve.high]];
  const band = low?.x.length && high?.x.length ? ` (${value(low, extremeAt(low, own.x[k], box, -1))} to ${value(high, extremeAt(high, own.x[k], box, 1))})` : "";
  return { color: curve.color, dash: curve.dash, opacity: curve.opacity, label: curve.label || curve.name, text: `${value(own, k)} ${pane.unit || ""}${band}` };
}

// index of the lowest (-1) or highest (1) of the samples that are drawn on the pixel of an x
function extremeAt({ x, y }, at, box, sign) {
  let found = nearest(x, at);
  for (const step of [-1, 1]) {
    for (let k = found + step; k >= 0 && k < x.length && Math.abs(box.across(x[k]) - box.across(at)) <= 1; k += step) if (sign * (y[k] - y[found]) > 0) found = k;
  }
  return found;
}

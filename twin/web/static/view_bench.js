// The bench of paper B: slides of handle, wires and needle, the injection catheter that they bend, and its tip from the front.

import { clamp, contactForce, make, millimeters, parts, say, set, sheet, wall } from "./draw.js";

const PX = 9000;                // [px/m] of the tip
const GUIDE = 560, LEVEL = 150; // end of the guide
const FRONT = [905, 150, 68];   // the view from the front: middle, radius
const TRAIL = 240;

export function bench(place, view) {
  const svg = sheet(place, 1000, 250, `the bench ${view.title}`);
  const axes = parts(view, "axis"), tip = parts(view, "tip")[0], site = parts(view, "site")[0];
  const heart = parts(view, "heart")[0], wallPart = parts(view, "wall")[0], sensor = parts(view, "force")[0];
  if (view.title) make(svg, "text", { x: 14, y: 16, class: "title" }, view.title);
  const gap = Math.min(40, 216 / Math.max(axes.length, 1));
  const slides = axes.map((axis, k) => slide(svg, axis, 26 + gap * (k + 0.5)));
  if (!tip) return (of) => slides.forEach((move) => move(of));

  const front = wallPart && wall(svg, LEVEL, 815);
  make(svg, "rect", { x: 385, y: LEVEL - 11, width: GUIDE - 385, height: 22, rx: 5, class: "guide" });
  const body = make(svg, "path", { class: "catheter" }), needle = make(svg, "line", { class: "needle" }), end = make(svg, "circle", { r: 4, class: "tip" });
  make(svg, "circle", { cx: FRONT[0], cy: FRONT[1], r: FRONT[2], class: "base" });
  make(svg, "path", { d: `M${FRONT[0] - FRONT[2]} ${FRONT[1]}h${2 * FRONT[2]}M${FRONT[0]} ${FRONT[1] - FRONT[2]}v${2 * FRONT[2]}`, class: "axis" });
  make(svg, "text", { x: 990, y: FRONT[1] - FRONT[2] - 17, class: "small end note" }, "tip from the front, radius 15 mm");
  const trail = make(svg, "polyline", { class: "trail" }), dot = make(svg, "circle", { r: 5, class: "tip" });
  const bar = (sensor || wallPart) && contactForce(place, view, sensor, sensor ? undefined : wallPart);
  const text = make(svg, "text", { x: 385, y: 238, class: "small note" });
  const been = [];

  return (of) => {
    slides.forEach((move) => move(of));
    const flat = !("tip_x" in tip.signals);
    const x = of(tip, "tip_x") ?? 0, y = of(tip, "tip_y") ?? 0, z = of(tip, "tip_z") ?? 0, out = of(tip, "needle_length") ?? 0;
    const across = flat ? y : x, angle = of(tip, "tip_angle") ?? Math.atan2(Math.hypot(x, y), 0.02);
    const lean = Math.sign(across || 1) * Math.abs(angle) * (flat ? 1 : Math.abs(across) / (Math.hypot(x, y) || 1));
    const at = [clamp(GUIDE + 70 + PX * z * 0.8, GUIDE + 20, 800), clamp(LEVEL - PX * 0.6 * across, 60, 236)];
    const pull = (at[0] - GUIDE) * 0.55;
    set(body, { d: `M${GUIDE} ${LEVEL} C${GUIDE + pull} ${LEVEL} ${at[0] - pull * Math.cos(lean)} ${at[1] + pull * Math.sin(lean)} ${at[0]} ${at[1]}` });
    const long = Math.max(out, 0) * PX * 0.8;
    set(needle, { x1: at[0], y1: at[1], x2: at[0] + long * Math.cos(lean), y2: at[1] - long * Math.sin(lean) });
    set(end, { cx: at[0], cy: at[1] });
    const load = of(sensor, "measured_force") ?? of(wallPart, "force") ?? 0;
    if (front) front(clamp(GUIDE + 70 + PX * 0.8 * ((wallPart.sizes.surface_position ?? 0) + (of(heart, "position") ?? 0)), GUIDE + 60, 800), clamp(load * 40, 0, 20));
    if (bar) bar(of);
    const scale = FRONT[2] / 0.015, seen = [FRONT[0] + clamp(flat ? 0 : x, -0.016, 0.016) * scale, FRONT[1] - clamp(y, -0.016, 0.016) * scale];
    set(dot, { cx: seen[0], cy: seen[1] });
    const last = been[been.length - 1];
    if (!last || Math.hypot(last[0] - seen[0], last[1] - seen[1]) > 0.5) { been.push(seen); if (been.length > TRAIL) been.shift(); set(trail, { points: been.map((one) => one.map((v) => v.toFixed(1)).join()).join(" ") }); }
    const given = of(site, "given");
    say(text, `tip ${flat ? "" : `x ${millimeters(x)}, `}y ${millimeters(y)}, z ${millimeters(z)} mm · needle ${millimeters(out)} mm${given === undefined ? "" : ` · given ${(given * 1e9).toFixed(1)} µL`}`);
  };
}

function slide(svg, axis, y) {
  const left = 96, right = 330, middle = (left + right) / 2;
  let range = 0.012;
  make(svg, "text", { x: 14, y: y + 4, class: "small" }, axis.member.replaceAll("_", " "));
  make(svg, "rect", { x: left, y: y - 3, width: right - left, height: 6, rx: 3, class: "rail" });
  make(svg, "line", { x1: middle, x2: middle, y1: y - 7, y2: y + 7, class: "tick" });
  const block = make(svg, "rect", { y: y - 9, width: 20, height: 18, rx: 3, class: "block" }), text = make(svg, "text", { x: right + 44, y: y + 4, class: "small end" });
  return (of) => {
    const at = of(axis, "position") ?? 0;
    range = Math.max(range, Math.abs(at) * 1.1);
    set(block, { x: middle - 10 + (at / range) * ((right - left) / 2 - 12), class: of(axis, "moving") ? "block moving" : "block" });
    say(text, `${millimeters(at)}`);
  };
}

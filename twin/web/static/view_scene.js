// A scene of the scenario: walls of its environment, lines and points of signals, arrows of forces. Millimeters, y up.

import { contactForce, legend, make, parts, say, set, sheet } from "./draw.js";

const MARGIN = 6, ARROW = 12;  // [mm]: around the scene; of the longest arrow so far

export function scene(place, view) {
  const { walls, lines, points, arrows, axes, motions } = view.scene, part = parts(view, "scene")[0];
  const svg = sheet(place, 1000, 300, view.title), picture = make(svg, "g");
  make(svg, "text", { x: 14, y: 18, class: "title" }, view.title);
  const sensor = parts(view, "force")[0], wallPart = parts(view, "wall")[0], bar = (sensor || wallPart) && contactForce(place, view, sensor, wallPart);
  const named = [...lines.map((one) => ["--line-0", one.label]), ...arrows.map((one) => ["--accent", one.label]),
    ...walls.map((one) => (one.closed ? ["--tissue", "wall"] : ["--metal", "tube"]))].filter(([, text]) => text);
  legend(place, [...new Map(named.map((one) => [one.join(), one])).values()]);
  const outlines = walls.map((wall) => make(picture, wall.closed ? "polygon" : "polyline", { class: wall.closed ? "tissue" : "tube", points: pairs(wall.points) }));
  const curves = lines.map((line) => make(picture, "polyline", { class: "catheter", style: `stroke-width: ${Math.max(line.width, 0.6)}` }));
  const dots = points.map(() => make(picture, "circle", { r: 1.5, class: "tip" })), labels = points.map((one) => make(svg, "text", { class: "small middle" }, one.label));
  const loads = arrows.map(() => make(picture, "path", { class: "load" }));
  walls.forEach((wall, k) => { if (!wall.closed) outlines[k].style.strokeWidth = Math.max(wall.thickness, 0.5); });
  let bounds = null, longest = 1e-9, scale = 1, origin = [0, 0];
  const flat = (values) => (values || []).filter((one) => one && one[0] !== null).map((one) => [1e3 * one[axes[0] % one.length], 1e3 * one[axes[1] % one.length]]);

  return (of) => {
    const shapes = lines.map((line) => flat(of(part, line.signal)));
    const seen = [...walls.flatMap((wall) => split(wall.points)), ...shapes.flat()];
    if (!bounds && seen.length) fit(seen);
    walls.forEach((wall, k) => {
      const along = 1e3 * (of(part, motions[wall.moves]) ?? 0);
      if (wall.moves) set(outlines[k], { transform: `translate(${along * wall.direction[0]} ${along * wall.direction[1]})` });
    });
    shapes.forEach((shape, k) => set(curves[k], { points: shape.map((one) => one.join()).join(" ") }));
    points.forEach(({ signal }, k) => {
      const value = of(part, signal), at = flat(Array.isArray(value?.[0]) ? value : [value])[0];
      if (!at || !bounds) return;
      set(dots[k], { cx: at[0], cy: at[1] });
      set(labels[k], { x: origin[0] + scale * at[0], y: origin[1] - scale * at[1] - 10 });
    });
    arrows.forEach((arrow, k) => {
      const at = flat(of(part, arrow.at)), vectors = flat(of(part, arrow.signal));
      longest = Math.max(longest, ...vectors.map((one) => Math.hypot(...one)));
      set(loads[k], { d: at.map((from, i) => [from, vectors[i]]).filter(([, v]) => v && Math.hypot(...v) > 0.02 * longest)
        .map(([from, v]) => `M${from.join()}l${v.map((one) => ((ARROW * one) / longest).toFixed(2)).join()}`).join("") });
    });
    if (bar) bar(of);
  };

  function fit(seen) {
    const xs = seen.map((one) => one[0]), ys = seen.map((one) => one[1]);
    bounds = [Math.min(...xs) - MARGIN, Math.max(...xs) + MARGIN, Math.min(...ys) - MARGIN, Math.max(...ys) + MARGIN];
    const [left, right, bottom, top] = bounds;
    scale = Math.min(980 / (right - left), 290 / (top - bottom));
    origin = [500 - (scale * (left + right)) / 2, 150 + (scale * (bottom + top)) / 2];
    set(picture, { transform: `translate(${origin.join(" ")}) scale(${scale} ${-scale})` });
    const step = [1, 2, 5, 10, 20, 50, 100].find((one) => one * scale > 60) || 100;
    make(svg, "path", { d: `M${985 - step * scale} 280v8h${step * scale}v-8`, class: "scale" });
    say(make(svg, "text", { x: 985, y: 274, class: "small end" }), `${step} mm`);
  }
}

function split(flat) { return flat.flatMap((_, k) => (k % 2 ? [] : [[flat[k], flat[k + 1]]])); }
function pairs(flat) { return split(flat).map((one) => one.join()).join(" "); }

// The vessel as the fluoroscope sees it, with catheter and guidewire in it, targets of the operator, and the force on the wall.

import { force, make, parts, placeText, set, sheet } from "./draw.js";

export function vessel(place, view) {
  const one = parts(view, "fluoroscope")[0], friction = parts(view, "friction")[0], svg = sheet(place, 1000, 300, "the vessel");
  const outline = make(svg, "polygon", { class: "lumen" });
  const marks = view.targets.map((target) => [target, make(svg, "circle", { class: "target" }), make(svg, "text", { class: "small middle" }, target.name)]);
  const catheter = make(svg, "polyline", { class: "catheter" }), wire = make(svg, "polyline", { class: "guidewire" });
  const tips = [["catheter_tip", "tip", "catheter"], ["wire_tip", "tip small", "guidewire"]]
    .map(([name, kind, label]) => [name, make(svg, "circle", { r: 5, class: kind }), make(svg, "text", { class: "small middle" }, label)]);
  const limit = friction && view.limits[friction.signals.wall_force];
  const bar = limit && force(svg, 14, 34, 260, [0, limit], 2 * limit, "force on the wall");
  const ruler = make(svg, "path", { class: "scale" });
  make(svg, "text", { x: 970, y: 34, class: "small end edge" }, "50 mm");
  let seen = null, fit = null, tall = 0;
  new ResizeObserver(() => { seen = null; }).observe(svg);  // letters are larger on a narrow page: names are placed again
  const names = [];  // boxes of the names of targets

  // the longer side of the vessel is horizontal
  function fitted(points) {
    const all = points.filter(whole);
    const [xs, ys] = [all.map((p) => p[0]), all.map((p) => p[1])], box = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const [width, height] = [box[1] - box[0], box[3] - box[2]], turned = height > width;
    const [long, short] = turned ? [height, width] : [width, height], scale = Math.min(940 / long, 260 / short), top = bar ? 64 : 20;
    tall = Math.round(short * scale) + top + 20;
    set(svg, { viewBox: `0 0 1000 ${tall}` });
    const to = (p) => (turned ? [30 + (p[1] - box[2]) * scale, top + (p[0] - box[0]) * scale] : [30 + (p[0] - box[0]) * scale, tall - 20 - (p[1] - box[2]) * scale]);
    names.length = 0;
    for (const [target, circle, text] of marks) {
      const [cx, cy] = to(target.at);
      set(circle, { cx, cy, r: Math.max(target.tolerance * scale, 6) });
      names.push(placeText(text, [cx, cy], tall, names, true));
    }
    set(ruler, { d: `M${970 - 0.05 * scale} 14v6h${0.05 * scale}v-6` });
    return to;
  }
  const drawn = (points) => (points || []).filter(whole).map((p) => fit(p).map((v) => v.toFixed(1)).join()).join(" ");

  return (of, reached) => {
    const points = of(one, "vessel");
    if (points && points.length !== seen && points.filter(whole).length > 2) { seen = points.length; fit = fitted(points); set(outline, { points: drawn(points) }); }
    if (!fit) return;
    set(catheter, { points: drawn(of(one, "catheter")) });
    set(wire, { points: drawn(of(one, "wire")) });
    const taken = [...names];
    for (const [name, circle, text] of tips) {
      const at = of(one, name);
      if (at && whole(at)) { const [cx, cy] = fit(at); set(circle, { cx, cy }); taken.push(placeText(text, [cx, cy], tall, taken)); }
    }
    for (const [target, circle] of marks) set(circle, { class: reached.includes(target.name) ? "target reached" : "target" });
    if (bar) bar(Math.abs(of(friction, "wall_force") ?? 0));
  };
}

function whole(point) { return point && point[0] !== null && point[1] !== null; }

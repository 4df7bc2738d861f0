// The vessel as the fluoroscope sees it, with catheter and guidewire in it, targets of the operator, and the force on the wall.

import { clamp, force, legend, make, millimeters, parts, placeText, set, sheet } from "./draw.js";

const NARROW = 520, PART = 460;  // width of a picture [px] below which it shows a part around the tips, and width of this part of 1000
const INSTRUMENTS = ["catheter", "wire"], NAMES = ["catheter", "guidewire"];

export function vessel(place, view) {
  const one = parts(view, "fluoroscope")[0], friction = parts(view, "friction")[0], svg = sheet(place, 1000, 300, "the vessel");
  const limit = friction && view.limits[friction.signals.wall_force], bar = limit && force(place, [0, limit], 3 * limit, "force on the wall");
  const readings = one.signals.catheter_location && legend(place, NAMES.map((name, k) => [`--line-${k}`, name]));
  const outline = make(svg, "polygon", { class: "lumen" });
  const marks = view.targets.map((target) => [target, make(svg, "circle", { class: "target" }), make(svg, "text", { class: "small middle" }, target.name)]);
  const shafts = NAMES.map((name) => make(svg, "polyline", { class: name }));
  const tips = NAMES.map((name) => [make(svg, "circle", { r: 5, class: `tip tip-${name}` }), make(svg, "text", { class: "small middle" }, name)]);
  const ruler = make(svg, "path", { class: "scale" }), length = make(svg, "text", { y: 14, class: "small end" }, "50 mm");
  let seen = null, fit = null, tall = 0, part = [0, 1000];
  new ResizeObserver(() => { seen = null; }).observe(svg);  // letters are larger on a narrow page: names are placed again
  const names = [];  // boxes of targets and of their names

  // the longer side of the vessel is horizontal
  function fitted(points) {
    const all = points.filter(whole);
    const [xs, ys] = [all.map((p) => p[0]), all.map((p) => p[1])], box = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const [width, height] = [box[1] - box[0], box[3] - box[2]], turned = height > width;
    const [long, short] = turned ? [height, width] : [width, height], scale = Math.min(940 / long, 260 / short);
    tall = Math.round(short * scale) + 60;
    const to = (p) => (turned ? [30 + (p[1] - box[2]) * scale, 30 + (p[0] - box[0]) * scale] : [30 + (p[0] - box[0]) * scale, tall - 30 - (p[1] - box[2]) * scale]);
    to.scale = scale;
    return to;
  }
  // show the part around x, and place the names of the targets in it
  function show(x) {
    const wide = svg.clientWidth && svg.clientWidth < NARROW ? PART : 1000, left = clamp(x - wide / 2, 0, 1000 - wide);
    part = [left, left + wide];
    set(svg, { viewBox: `${left} 0 ${wide} ${tall}` });
    names.length = 0;
    for (const [target, circle] of marks) {
      const [cx, cy] = fit(target.at), r = Math.max(target.tolerance * fit.scale, 6);
      set(circle, { cx, cy, r });
      names.push({ left: cx - r, right: cx + r, top: cy - r, bottom: cy + r });
    }
    for (const [target, , text] of marks) {
      const at = fit(target.at), visibility = at[0] > part[0] && at[0] < part[1] ? "visible" : "hidden";
      set(text, { visibility });
      if (visibility === "visible") names.push(placeText(text, at, tall, names, true, part));
    }
    const right = part[1] - 0.03 * wide;
    set(ruler, { d: `M${right - 0.05 * fit.scale} 20v6h${0.05 * fit.scale}v-6` });
    set(length, { x: right });
  }
  const drawn = (points) => (points || []).filter(whole).map((p) => fit(p).map((v) => v.toFixed(1)).join()).join(" ");

  return (of, reached) => {
    const points = of(one, "vessel"), ends = INSTRUMENTS.map((name) => of(one, `${name}_tip`));
    const isNew = points && points.length !== seen && points.filter(whole).length > 2;
    if (isNew) { seen = points.length; fit = fitted(points); set(outline, { points: drawn(points) }); }
    if (!fit) return;
    const at = ends.map((end) => end && whole(end) && fit(end)), front = Math.max(30, ...at.filter(Boolean).map(([x]) => x));
    if (isNew || Math.abs(front - (part[0] + part[1]) / 2) > (part[1] - part[0]) / 4) show(front);
    INSTRUMENTS.forEach((name, k) => set(shafts[k], { points: drawn(of(one, name)) }));
    const taken = [...names, ...at.filter(Boolean).map(([x, y]) => ({ left: x - 6, right: x + 6, top: y - 6, bottom: y + 6 }))];
    tips.forEach(([circle, text], k) => {
      if (at[k]) { set(circle, { cx: at[k][0], cy: at[k][1] }); taken.push(placeText(text, at[k], tall, taken, false, part)); }
    });
    for (const [target, circle] of marks) set(circle, { class: reached.includes(target.name) ? "target reached" : "target" });
    if (bar) bar(Math.abs(of(friction, "wall_force") ?? 0));
    if (readings) readings.forEach((write, k) => write(`${NAMES[k]} ${millimeters(of(one, `${INSTRUMENTS[k]}_location`) ?? 0)} mm${k ? ` from the entry${part[1] - part[0] < 1000 ? "" : " in the image"}` : ""}`));
  };
}

function whole(point) { return point && point[0] !== null && point[1] !== null; }

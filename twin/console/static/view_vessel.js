// The vessel as the fluoroscope sees it, with catheter and guidewire in it.

import { make, parts, set, sheet } from "/console/draw.js";

export function vessel(place, view) {
  const one = parts(view, "fluoroscope")[0], svg = sheet(place, 1000, 300, "the vessel");
  const outline = make(svg, "polygon", { class: "lumen" });
  const catheter = make(svg, "polyline", { class: "catheter" }), wire = make(svg, "polyline", { class: "guidewire" });
  const tips = [["catheter_tip", "tip"], ["wire_tip", "tip small"]].map(([name, kind]) => [name, make(svg, "circle", { r: 5, class: kind })]);
  let seen = null, fit = null;

  // the longer side of the vessel is horizontal
  function fitted(points) {
    const all = points.filter(whole);
    const [xs, ys] = [all.map((p) => p[0]), all.map((p) => p[1])], box = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const [width, height] = [box[1] - box[0], box[3] - box[2]], turned = height > width;
    const [long, short] = turned ? [height, width] : [width, height], scale = Math.min(940 / long, 260 / short);
    const tall = Math.round(short * scale) + 40;
    set(svg, { viewBox: `0 0 1000 ${tall}` });
    return (p) => (turned ? [30 + (p[1] - box[2]) * scale, 20 + (p[0] - box[0]) * scale] : [30 + (p[0] - box[0]) * scale, tall - 20 - (p[1] - box[2]) * scale]);
  }
  const drawn = (points) => (points || []).filter(whole).map((p) => fit(p).map((v) => v.toFixed(1)).join()).join(" ");

  return (of) => {
    const points = of(one, "vessel");
    if (points && points.length !== seen && points.filter(whole).length > 2) { seen = points.length; fit = fitted(points); set(outline, { points: drawn(points) }); }
    if (!fit) return;
    set(catheter, { points: drawn(of(one, "catheter")) });
    set(wire, { points: drawn(of(one, "wire")) });
    for (const [name, circle] of tips) { const at = of(one, name); if (at && whole(at)) { const [cx, cy] = fit(at); set(circle, { cx, cy }); } }
  };
}

function whole(point) { return point && point[0] !== null && point[1] !== null; }

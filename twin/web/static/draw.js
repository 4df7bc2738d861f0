// Drawing functions shared by the views.

const SVG = "http://www.w3.org/2000/svg";

export function make(parent, tag, attributes = {}, text = "") {
  const one = parent.appendChild(document.createElementNS(SVG, tag));
  set(one, attributes);
  if (text) one.textContent = text;
  return one;
}
// an attribute that is set to the value it has costs the browser a layout
export function set(one, attributes) {
  for (const name in attributes) if (one.getAttribute(name) !== String(attributes[name])) one.setAttribute(name, attributes[name]);
}
export function sheet(place, width, height, label) {
  const svg = make(place, "svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": label });
  return svg;
}
export function parts(view, kind) { return view.parts.filter((one) => one.kind === kind); }
export function clamp(value, low, high) { return Math.min(Math.max(value, low), high); }
export function millimeters(value) { return (Math.round(value * 1e4) / 10 + 0).toFixed(1); }  // never -0.0
const newtons = (value) => (Math.round(value * 1e3) / 1e3 + 0).toFixed(3);
export function say(one, text) { if (one.textContent !== text) one.textContent = text; }

// a row above the picture of a view with the color and text of each item; returns functions that change the texts
export function legend(place, items) {
  const row = document.createElement("div");
  row.className = "twin-readings";
  place.lastElementChild.before(row);
  return items.map(([color, text]) => {
    const item = row.appendChild(document.createElement("span"));
    item.appendChild(document.createElement("i")).style.background = `var(${color})`;
    const word = item.appendChild(document.createTextNode(text));
    return (now) => say(word, now);
  });
}

// put a text beside a point, inside the picture, where it covers none of the boxes placed before
export function placeText(text, [cx, cy], tall, taken, below = false, [left, right] = [0, 1000]) {
  const { width, height } = text.getBBox(), x = clamp(cx, left + 4 + width / 2, right - 4 - width / 2);
  const over = [0, 1.3, 2.6].map((row) => cy - 12 - row * height), under = [0.8, 2.1, 3.4].map((row) => cy + 12 + row * height);
  const boxes = [0, 1, 2].flatMap((k) => (below ? [under[k], over[k]] : [over[k], under[k]])).map((y) => ({ y, left: x - width / 2, right: x + width / 2, top: y - 0.8 * height, bottom: y + 0.2 * height }));
  const inside = boxes.filter((one) => one.top >= 0 && one.bottom <= tall);
  const box = inside.find((one) => !taken.some((two) => one.left < two.right && two.left < one.right && one.top < two.bottom && two.top < one.bottom)) || inside[0] || boxes[0];
  set(text, { x, y: box.y });
  return box;
}

// a force as a bar with its band, in a picture of its own above the view, so that it is read beside a scene in three dimensions
// and on a telephone too; `isJudged`: whether a value is said to be in the band or above it
export function force(place, band, most = 0.6, label = "contact force", isJudged = true) {
  const x = 8, y = 20, width = 260, at = (value) => x + (clamp(value, 0, most) / most) * width;
  const svg = sheet(place, 380, 50, label);
  svg.classList.add("twin-gauge");
  place.prepend(svg);
  make(svg, "rect", { x, y, width, height: 14, rx: 3, class: "track" });
  make(svg, "rect", { x: at(band[0]), y, width: at(band[1]) - at(band[0]), height: 14, class: "band" });
  const bar = make(svg, "rect", { x, y: y + 3, width: 0, height: 8, rx: 2, class: "bar" });
  for (const edge of new Set([0, ...band, most])) make(svg, "text", { x: at(edge), y: y + 27, class: "small middle" }, String(edge));
  const text = make(svg, "text", { x, y: y - 6, class: "label" }, label);
  return (value, name = label, more = "") => {
    const above = isJudged && value > band[1], inside = isJudged && value >= band[0] && value <= band[1];
    set(bar, { width: at(value) - x, class: `bar ${above ? "bad" : inside ? "good" : ""}` });
    say(text, `${name} ${newtons(value)} N${above ? ", too high" : inside ? ", in range" : ""}${more}`);
  };
}

// the contact force: measured where a sensor measures it, and the true one; returns (of) => void
export function contactForce(place, { band, is_judged: isJudged }, sensor, wallPart) {
  const bar = force(place, band, Math.max(0.6, +(1.5 * band[1]).toPrecision(2)), undefined, isJudged);
  return (of) => {
    const measured = of(sensor, "measured_force"), actual = of(wallPart, "force"), both = measured !== undefined && actual !== undefined;
    bar(measured ?? actual ?? 0, `${measured === undefined ? "true" : "measured"} contact force`, both ? `; true ${newtons(actual)} N` : "");
  };
}

// the wall, dented where the tip presses on it; returns (x, dent) => void
export function wall(svg, y, right) {
  const body = make(svg, "path", { class: "tissue" }), skin = make(svg, "path", { class: "skin" });
  return (x, dent) => {
    const top = y - 78, bottom = y + 48;
    const edge = `M${x + 16} ${top} C${x} ${top + 26} ${x} ${y - 26} ${x} ${y - 16} C${x} ${y - 8} ${x + dent} ${y - 7} ${x + dent} ${y} C${x + dent} ${y + 7} ${x} ${y + 8} ${x} ${y + 16} C${x} ${y + 26} ${x} ${bottom - 20} ${x + 12} ${bottom}`;
    set(body, { d: `${edge} L${right} ${bottom} L${right} ${top} Z` });
    set(skin, { d: edge });
  };
}

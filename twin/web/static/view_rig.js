// The rig of paper A: carriages with their grippers, the instrument in its sheath, the wall at its end.

import { clamp, contactForce, make, millimeters, parts, say, set, sheet, wall } from "./draw.js";

const MM = 2000;              // [px/m] along the carriages
const LINE = 96, RAIL = 196;  // height of the instrument, of the rail
const VALVE = 612, END = 800, OUT = 186;  // begin and end of the sheath, height of its end
const SHEATH = `M${VALVE} ${LINE} H705 A45 45 0 0 1 750 ${LINE + 45} A45 45 0 0 0 795 ${LINE + 90} H${END}`;
const DRAWN = [93, 70.7, 75.7];  // lengths of its straight part and bends as drawn
const LENS = 20, SEEN = 4;    // [px/mm] of the magnified scale of a carriage, and [mm] to both sides of its middle
const NEAR_LENS = 8;          // [mm] beyond which a carriage would cover the scale on that side
const STILL = 5e-5;           // speed that is no motion [m/s]
const SECTIONS = [0.343, 0.0785, 0.0785];
const TIP = 3000, TOUCH = 900;   // [px/m] at the wall; where it is at rest

let count = 0;

export function rig(place, view) {
  const one = (kind) => parts(view, kind)[0];
  const svg = sheet(place, 1000, 250, `the rig ${view.title}`), braid = `braid${++count}`;
  const defs = make(svg, "defs"), pattern = make(defs, "pattern", { id: braid, width: 8, height: 8, patternUnits: "userSpaceOnUse" });
  make(pattern, "path", { d: "M0 0L8 8M8 0L0 8", class: "yarn" });

  if (view.title) make(svg, "text", { x: 14, y: 22, class: "title" }, view.title);
  const head = make(svg, "text", { x: 14, y: view.title ? 42 : 24, class: "label" });
  const drives = parts(view, "carriage").slice(0, 2);
  const instrument = one("instrument"), sheath = one("sheath"), heart = one("heart"), wallPart = one("wall");
  const centers = drives.length > 1 ? [180, 440] : [310];
  if (wallPart && drives.length === 1) place.classList.add("twin-at-wall");
  if (view.title === "guidewire") place.classList.add("twin-guidewire");

  make(svg, "rect", { x: 60, y: RAIL, width: 520, height: 9, rx: 3, class: "rail" });
  for (const center of centers) for (let mm = -50; mm <= 50; mm += 10) {  // each carriage has its own zero
    const x = center + (mm / 1000) * MM, long = mm % 50 === 0;
    make(svg, "line", { x1: x, x2: x, y1: RAIL + 9, y2: RAIL + (long ? 17 : 13), class: "tick" });
    if (long) make(svg, "text", { x, y: RAIL + 30, class: "small middle rail-number" }, mm === 50 ? "50 mm" : String(mm));
  }
  const carriages = drives.map((drive, k) => carriage(svg, drive, centers[k], parts(view, "cylinder")[k], parts(view, "sleeve")[k], braid));

  const guided = instrument || sheath || wallPart, until = guided ? VALVE : 640;
  // the instrument: a line with moving marks, then along the sheath to its insertion depth
  if (guided) make(svg, "path", { d: SHEATH, class: "sheath" });
  if (guided) make(svg, "rect", { x: VALVE - 12, y: LINE - 15, width: 20, height: 30, rx: 4, class: "holder" });
  make(svg, "line", { x1: 0, x2: until, y1: LINE, y2: LINE, class: "shaft" });
  const marks = make(svg, "line", { x1: 0, x2: until, y1: LINE, y2: LINE, class: "marks" });
  const inside = make(svg, "path", { d: guided ? SHEATH : "", class: "shaft", pathLength: 1000 });
  const front = wallPart && wall(svg, OUT, 990);
  const tip = make(svg, "path", { class: "shaft" }), end = make(svg, "circle", { r: 5, class: "tip", visibility: "hidden" });
  const bar = (wallPart || one("force")) && contactForce(place, view, one("force"), wallPart);
  const dial = one("rotation") && rotation(svg, 960, 44);
  const state = make(svg, "text", { x: wallPart ? 880 : 985, y: 244, class: "small end" });
  carriages.forEach((part) => part.raise());
  const magnify = drives.length === 1 && lens(svg, centers[0]);

  return (of) => {
    const moved = drives.map((drive, k) => carriages[k].move(of));
    const along = of(instrument, "proximal_position") ?? moved[0] ?? 0;
    if (magnify) magnify(moved[0]);
    set(marks, { "stroke-dashoffset": -along * MM });
    if (dial) dial(of(one("rotation"), "angle") ?? 0);
    const depth = of(instrument, "insertion_depth"), lengths = instrument?.sizes.section_length || SECTIONS;
    const whole = lengths.reduce((a, b) => a + b, 0);
    set(inside, { "stroke-dasharray": `${depth === undefined ? 1000 : passed(depth, lengths)} 2000` });
    if (bar) bar(of);
    const sequencer = one("sequencer");
    if (sequencer) say(head, `step ${of(sequencer, "step_number") ?? "–"} · gripper ${of(sequencer, "leading") ?? "–"} leads · hand-overs: ${of(sequencer, "regrip_count") ?? 0}`);
    if (!guided) return;

    const place = of(instrument, "tip_position") ?? of(sheath, "tip_position") ?? 0, surface = wallPart?.sizes.surface_position ?? 0;
    const load = of(wallPart, "force") ?? 0, beat = of(heart, "position") ?? 0;
    const at = wallPart ? clamp(TOUCH + TIP * beat, END + 30, 975) : 0, dent = clamp(load * 40, 0, 22);
    if (front) front(at, dent);
    const out = depth === undefined || depth >= whole;
    let x = wallPart ? TOUCH + TIP * (place - surface) : END + Math.max((depth ?? whole) - whole, 0) * MM;
    if (wallPart && (load > 0 || x > at)) x = at + dent;
    x = clamp(x, END, 985);
    const bow = clamp((of(wallPart, "displacement") ?? 0) * 1500, -26, 26);
    set(tip, { d: out ? `M${END} ${OUT} C${END + (x - END) / 3} ${OUT} ${END + (x - END) / 2} ${OUT - bow} ${x} ${OUT}` : "" });
    set(end, { cx: x, cy: OUT, visibility: out ? "visible" : "hidden" });
    // without a sheath the depth counts from the entry, as the vessel's picture and charts do; else from the start, as charts of the tip do
    const fromEntry = depth !== undefined && whole === 0;
    say(state, wallPart ? `${moved.length === 1 ? `gripper at ${millimeters(moved[0])} mm, ` : ""}tip at ${millimeters(place)} mm` : `${millimeters(fromEntry ? depth : place)} mm from the ${fromEntry ? "entry, true" : "start"}`);
  };
}

// part of the sheath's path behind a tip at a depth [of 1000]
function passed(depth, lengths) {
  let left = Math.max(depth, 0), drawn = 0;
  lengths.slice(0, 3).forEach((length, k) => { drawn += DRAWN[k] * (length > 0 ? clamp(left / length, 0, 1) : left > 0 ? 1 : 0); left -= length; });
  return (1000 * drawn) / (DRAWN[0] + DRAWN[1] + DRAWN[2]);
}

function carriage(svg, drive, center, cylinder, sleeve, braid) {
  const group = make(svg, "g", { class: "drive" }), way = sleeve?.sizes.orientation < 0 ? -1 : 1;
  make(group, "rect", { x: -54, y: RAIL - 24, width: 108, height: 24, rx: 4, class: "block" });
  make(group, "circle", { cx: -36, cy: RAIL, r: 5, class: "wheel" }); make(group, "circle", { cx: 36, cy: RAIL, r: 5, class: "wheel" });
  const name = make(group, "text", { x: 0, y: RAIL - 7, class: "small middle on" });
  const root = -way * 46;
  make(group, "rect", { x: root - 5, y: LINE - 22, width: 10, height: RAIL - 24 - LINE + 22, rx: 2, class: "holder" });
  const rod = cylinder && make(group, "line", { y1: LINE + 46, y2: LINE + 46, class: "rod" });
  const air = cylinder && make(group, "rect", { x: Math.min(root, root + way * 44), y: LINE + 36, width: 44, height: 20, rx: 3, class: "air" });
  const holder = make(group, "rect", { y: LINE - 22, width: 10, height: 78, rx: 2, class: "holder" });
  if (!sleeve) {  // a plain clamp
    set(holder, { visibility: "hidden" });
    make(group, "rect", { x: root - 5, y: LINE - 12, width: way * 92 + 5, height: 24, rx: 5, class: "holder" });
  }
  const tube = sleeve && make(group, "path", { class: "sleeve" }), yarns = sleeve && make(group, "path", { fill: `url(#${braid})` });
  const speed = make(group, "line", { y1: RAIL + 34, y2: RAIL + 34, x1: 0, class: "speed" });
  const figure = make(svg, "text", { x: center, y: RAIL + 48, class: "small middle" });  // where no other one comes
  return {
    raise() { if (tube) { const front = make(svg, "g"); this.front = front; front.append(tube, yarns); } },
    move(of) {
      const position = of(drive, "position") ?? 0, extension = of(cylinder, "extension") ?? 0;
      const at = `translate(${center + position * MM} 0)`;
      set(group, { transform: at });
      if (this.front) set(this.front, { transform: at });
      const far = way * (34 + Math.min(extension, 0.008) * MM);
      set(holder, { x: far - 5 });
      if (rod) set(rod, { x1: root + way * 44, x2: far });
      if (air) set(air, { opacity: 0.45 + 0.55 * clamp((of(cylinder, "pressure_extend") ?? 0) / 6e5, 0, 1) });
      if (tube) {
        const { relaxed_diameter: relaxed, instrument_diameter: closed } = sleeve.sizes, diameter = of(sleeve, "diameter") ?? relaxed;
        const open = clamp((diameter - closed) / (relaxed - closed), 0, 1), half = 5 + 13 * open, holds = !!of(sleeve, "gripping");
        const [a, b] = [root, far].sort((p, q) => p - q), d = `M${a} ${LINE - 14} C${a + 18} ${LINE - 14} ${a + 14} ${LINE - half} ${a + 30} ${LINE - half} H${b - 30} C${b - 14} ${LINE - half} ${b - 18} ${LINE - 14} ${b} ${LINE - 14} V${LINE + 14} C${b - 18} ${LINE + 14} ${b - 14} ${LINE + half} ${b - 30} ${LINE + half} H${a + 30} C${a + 14} ${LINE + half} ${a + 18} ${LINE + 14} ${a} ${LINE + 14} Z`;
        set(tube, { d, class: `sleeve ${holds ? "holds" : ""}` }); set(yarns, { d });
      }
      const velocity = of(drive, "velocity") ?? 0, visibility = Math.abs(velocity) < STILL ? "hidden" : "visible";
      set(speed, { x2: clamp(velocity * 1500, -75, 75), visibility, class: of(drive, "limited") ? "speed bad" : "speed" });
      set(figure, { visibility });
      say(figure, `${millimeters(velocity)} mm/s`);
      say(name, `${millimeters(position)} mm`);
      return position;
    },
  };
}

// the position of a carriage ten times as large, on the side where it is not: strokes of a millimeter would not be seen
function lens(svg, center) {
  const group = make(svg, "g", { class: "drive" }), half = LENS * SEEN, y = 158;
  make(group, "rect", { x: -half - 8, y: y - 26, width: 2 * half + 16, height: 30, rx: 4, class: "base" });
  for (let mm = -SEEN; mm <= SEEN; mm++) make(group, "line", { x1: mm * LENS, x2: mm * LENS, y1: y, y2: y - (mm % SEEN ? 6 : 12), class: "tick" });
  const hand = make(group, "line", { y1: y - 22, y2: y, class: "hand" });
  const numbers = [-SEEN, 0, SEEN].map((mm) => [mm, make(group, "text", { x: mm * LENS, y: y + 17, class: "small middle rail-number" })]);
  make(group, "text", { x: 0, y: y - 32, class: "small middle" }, `${(1000 * LENS) / MM} \u00d7`);
  let middle = 0, side = 160;
  return (position) => {
    const mm = 1000 * position;
    if (Math.abs(mm - middle) > SEEN) middle = Math.round(mm);
    set(hand, { x1: (mm - middle) * LENS, x2: (mm - middle) * LENS });
    if (Math.abs(mm) > NEAR_LENS) side = mm > 0 ? -170 : 160;
    set(group, { transform: `translate(${center + side} 0)` });
    for (const [offset, text] of numbers) say(text, `${middle + offset}${offset === SEEN ? " mm" : ""}`);
  };
}

function rotation(svg, x, y) {
  make(svg, "circle", { cx: x, cy: y, r: 18, class: "base" });
  const hand = make(svg, "line", { x1: x, y1: y, x2: x, y2: y - 15, class: "hand" }), text = make(svg, "text", { x: x - 26, y: y + 4, class: "small end" });
  return (angle) => { set(hand, { transform: `rotate(${(angle * 180) / Math.PI} ${x} ${y})` }); say(text, `rotation ${((angle * 180) / Math.PI).toFixed(0)}°`); };
}

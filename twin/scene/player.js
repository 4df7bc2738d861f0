"use strict";
// Player of films: walls, lines, points and arrows on one canvas, curves over time on another.
const films = JSON.parse(document.getElementById("data").textContent);
const get = (id) => document.getElementById(id);
const view = get("view"), plot = get("plot"), slider = get("time");
let film, instant = 0, playing = false, clock = 0, last = 0, zoom = 1, shift = [0, 0];

function unpackTrack(track) {
  const text = atob(track.data), values = new Float64Array(text.length / 2);
  for (let i = 0; i < values.length; i++) {
    const code = text.charCodeAt(2 * i) | (text.charCodeAt(2 * i + 1) << 8);
    values[i] = code === 65535 ? NaN : track.low + code * track.step;
  }
  return { ...track, values };
}

function unpackFilm(film) {
  if (film.ready) return film;
  for (const key of ["time", "when"]) film[key] = unpackTrack(film[key]).values;
  for (const key of ["lines", "points", "curves"]) film[key] = film[key].map(unpackTrack);
  film.arrows = film.arrows.map((track) => ({ ...unpackTrack(track), origins: unpackTrack(track.at).values }));
  for (const name in film.motions) film.motions[name] = unpackTrack(film.motions[name]).values;
  film.ready = true;
  return film;
}

const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

function themeColor(hex) { // brighten colors in dark mode
  const part = parseFloat(color("--lift"));
  const mixed = [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16)).map((x) => Math.round(x + (255 - x) * part));
  return `rgb(${mixed.join(",")})`;
}

function resizeCanvas(canvas, height) {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth;
  canvas.style.height = `${height}px`;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = "12px sans-serif";
  return [pen, width, height];
}

function sceneScale() { // pixels per mm, and the center of the scene
  const [left, bottom, right, top] = film.bounds, width = view.clientWidth;
  const height = Math.min(Math.max(width * (top - bottom) / (right - left), 160), Math.max(window.innerHeight * 0.62, 260));
  const fit = Math.min(width / (right - left), height / (top - bottom));
  return { width, height, scale: fit * zoom, middle: [(left + right) / 2, (bottom + top) / 2] };
}

function tracePath(pen, values, from, count, toPixels, dx = 0, dy = 0) {
  pen.beginPath();
  let down = false;
  for (let i = 0; i < count; i++) {
    const x = values[from + 2 * i] + dx, y = values[from + 2 * i + 1] + dy;
    if (Number.isNaN(x + y)) { down = false; continue; }
    const [px, py] = toPixels(x, y);
    if (down) pen.lineTo(px, py); else pen.moveTo(px, py);
    down = true;
  }
}

function drawWalls(pen, toPixels, scale) {
  for (const wall of film.walls) {
    const displacement = film.motions[wall.moves] ? film.motions[wall.moves][instant] : 0;
    tracePath(pen, wall.points, 0, wall.points.length / 2, toPixels, displacement * wall.direction[0], displacement * wall.direction[1]);
    const ink = color(wall.moves ? "--pad" : "--wall");
    if (wall.closed) {
      pen.closePath();
      pen.fillStyle = ink; pen.globalAlpha = 0.45; pen.fill(); pen.globalAlpha = 1;
    }
    pen.strokeStyle = ink; pen.lineWidth = Math.max(wall.thickness * scale, 1.2);
    pen.stroke();
  }
  if (!film.lines.length && film.path.length) {
    tracePath(pen, film.path, 0, film.path.length / 2, toPixels);
    pen.setLineDash([7, 5]); pen.strokeStyle = color("--accent"); pen.lineWidth = 1.5; pen.stroke(); pen.setLineDash([]);
  }
}

function drawArrow(pen, x, y, dx, dy) {
  const size = Math.hypot(dx, dy);
  if (size < 0.5) return;
  const head = Math.min(9, 0.5 * size + 2), ux = dx / size, uy = dy / size;
  pen.beginPath(); pen.moveTo(x, y); pen.lineTo(x + dx - ux * head * 0.6, y + dy - uy * head * 0.6); pen.stroke();
  pen.beginPath(); pen.moveTo(x + dx, y + dy);
  pen.lineTo(x + dx - ux * head - uy * head * 0.4, y + dy - uy * head + ux * head * 0.4);
  pen.lineTo(x + dx - ux * head + uy * head * 0.4, y + dy - uy * head - ux * head * 0.4);
  pen.closePath(); pen.fill();
}

function drawArrows(pen, toPixels, fit) { // their length does not depend on the zoom
  for (const arrow of film.arrows) {
    if (!arrow.longest) continue;
    const unit = film.arrow * fit / arrow.longest, from = instant * arrow.count;
    pen.strokeStyle = pen.fillStyle = themeColor(arrow.color); pen.lineWidth = 2;
    for (let i = 0; i < arrow.count; i += 2) {
      const [x, y] = toPixels(arrow.origins[from + i], arrow.origins[from + i + 1]);
      const dx = arrow.values[from + i] * unit, dy = -arrow.values[from + i + 1] * unit;
      if (!Number.isNaN(x + y + dx + dy)) drawArrow(pen, x, y, dx, dy);
    }
  }
}

function drawScaleBar(pen, width, height, scale) {
  const rough = 0.22 * width / scale, power = 10 ** Math.floor(Math.log10(rough));
  const length = [5, 2, 1].map((n) => n * power).find((n) => n <= rough) || power;
  pen.strokeStyle = pen.fillStyle = color("--soft"); pen.lineWidth = 2;
  pen.beginPath(); pen.moveTo(8, height - 8); pen.lineTo(8 + length * scale, height - 8); pen.stroke();
  pen.fillText(`${+length.toPrecision(2)} mm`, 8, height - 14);
}

function draw() {
  const { width, height, scale, middle } = sceneScale(), [pen] = resizeCanvas(view, height);
  const toPixels = (x, y) => [width / 2 + (x - middle[0]) * scale + shift[0], height / 2 - (y - middle[1]) * scale + shift[1]];
  pen.lineJoin = pen.lineCap = "round";
  drawWalls(pen, toPixels, scale);
  for (const line of film.lines) {
    tracePath(pen, line.values, instant * line.count, line.count / 2, toPixels);
    pen.strokeStyle = themeColor(line.color); pen.lineWidth = Math.max(line.width * scale, 1.6);
    pen.stroke();
  }
  for (const mark of film.points) {
    pen.strokeStyle = themeColor(mark.color); pen.lineWidth = 2;
    for (let i = 0; i < mark.count; i += 2) {
      const [x, y] = toPixels(mark.values[instant * mark.count + i], mark.values[instant * mark.count + i + 1]);
      if (Number.isNaN(x + y)) continue;
      pen.beginPath(); pen.arc(x, y, 4.5, 0, 7); pen.stroke();
    }
  }
  drawArrows(pen, toPixels, scale / zoom);
  drawScaleBar(pen, width, height, scale);
  drawCurves();
  slider.value = instant;
  get("now").textContent = `${film.time[instant].toFixed(3)} s`;
}

function lastInstant(times, t) { // index of the last time that is not after t, within rounding
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= t + 1e-9) low = middle; else high = middle - 1;
  }
  return low;
}

function range(curves) {
  let low = Infinity, high = -Infinity;
  for (const curve of curves) for (const y of curve.values) { if (y < low) low = y; if (y > high) high = y; }
  if (!(low <= high)) [low, high] = [0, 0];
  return low === high ? [low - 1, high + 1] : [low - 0.05 * (high - low), high + 0.05 * (high - low)];
}

function ticks(low, high, count) {
  const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((n) => n * power >= rough), positions = [];
  for (let i = Math.ceil(low / step); i * step <= high * (1 + 1e-12); i++) positions.push(+(i * step).toPrecision(10));
  return positions;
}

const MARGINS = [52, 8, 8, 24]; // left, top, right and bottom of the curves [px]

function drawCurves() {
  if (!film.curves.length || film.time.length < 2) return;
  const [pen, width, height] = resizeCanvas(plot, 190), [low, high] = film.range;
  const first = film.time[0], length = film.time[film.time.length - 1] - first;
  const now = lastInstant(film.when, film.time[instant]);
  const x = (t) => MARGINS[0] + (width - MARGINS[0] - MARGINS[2]) * (t - first) / length;
  const y = (value) => height - MARGINS[3] - (height - MARGINS[1] - MARGINS[3]) * (value - low) / (high - low);
  pen.strokeStyle = color("--line"); pen.fillStyle = color("--soft"); pen.lineWidth = 1;
  pen.textAlign = "right"; pen.textBaseline = "middle";
  for (const value of ticks(low, high, 4)) {
    pen.beginPath(); pen.moveTo(MARGINS[0], y(value)); pen.lineTo(width - MARGINS[2], y(value)); pen.stroke();
    pen.fillText(String(value), MARGINS[0] - 6, y(value));
  }
  pen.textAlign = "center"; pen.textBaseline = "top";
  for (const t of ticks(first, first + length, Math.max(width / 110, 3))) pen.fillText(`${t} s`, x(t), height - MARGINS[3] + 6);
  for (const curve of film.curves) {
    pen.strokeStyle = themeColor(curve.color); pen.lineWidth = 1.5; pen.beginPath();
    curve.values.forEach((value, i) => { if (!Number.isNaN(value)) pen.lineTo(x(film.when[i]), y(value)); });
    pen.stroke();
    const value = curve.values[now];
    if (Number.isNaN(value)) continue;
    pen.fillStyle = themeColor(curve.color); pen.beginPath(); pen.arc(x(film.time[instant]), y(value), 3.5, 0, 7); pen.fill();
  }
  pen.strokeStyle = color("--ink"); pen.lineWidth = 1;
  pen.beginPath(); pen.moveTo(x(film.time[instant]), MARGINS[1]); pen.lineTo(x(film.time[instant]), height - MARGINS[3]); pen.stroke();
}

function legendEntry(text, ink, ring) {
  const item = document.createElement("span"), mark = document.createElement("i");
  mark.style.borderColor = themeColor(ink);
  if (ring) mark.className = "ring";
  item.append(mark, text);
  return item;
}

function updateLegends() {
  get("legend").replaceChildren(
    ...film.lines.map((track) => legendEntry(track.label, track.color)),
    ...film.points.map((track) => legendEntry(track.label, track.color, true)),
    ...film.arrows.map((track) => legendEntry(`${track.label}, longest ${+track.longest.toPrecision(3)} ${track.unit}`, track.color)));
  const unit = film.unit ? ` [${film.unit}]` : "";
  get("curves").replaceChildren(...film.curves.map((track) => legendEntry(track.label + unit, track.color)));
}

function selectFilm(number) {
  film = films[number];
  if (!film.ready) {
    unpackFilm(film);
    film.range = range(film.curves);
  }
  const moving = film.time.length > 1;
  get("controls").hidden = get("keys").hidden = !moving;
  get("curves-panel").hidden = !(moving && film.curves.length);
  slider.max = film.time.length - 1;
  showInstant(Math.min(instant, film.time.length - 1));
  updateLegends();
}

function showInstant(to) {
  instant = Math.min(Math.max(to, 0), film.time.length - 1);
  clock = film.time[instant];
  draw();
}

function setPlaying(isPlaying) {
  if (isPlaying && instant === film.time.length - 1) showInstant(0);
  playing = isPlaying;
  get("play").textContent = isPlaying ? "Pause" : "Play";
  last = performance.now();
  if (isPlaying) requestAnimationFrame(tick);
}

function tick(now) {
  if (!playing) return;
  clock += (now - last) / 1000 * parseFloat(get("speed").value);
  last = now;
  const next = lastInstant(film.time, clock);
  if (next !== instant) { instant = next; draw(); }
  if (instant === film.time.length - 1) setPlaying(false); else requestAnimationFrame(tick);
}

function zoomBy(factor, px, py) {
  const previous = zoom;
  zoom = Math.min(Math.max(zoom * factor, 1), 200);
  const { width, height } = sceneScale(), part = zoom / previous;
  shift = [px - width / 2 - (px - width / 2 - shift[0]) * part, py - height / 2 - (py - height / 2 - shift[1]) * part];
  if (zoom === 1) shift = [0, 0];
  draw();
}

const pointers = new Map();
view.addEventListener("wheel", (event) => { event.preventDefault(); zoomBy(Math.exp(-event.deltaY / 400), event.offsetX, event.offsetY); }, { passive: false });
view.addEventListener("pointerdown", (event) => { pointers.set(event.pointerId, [event.offsetX, event.offsetY]); view.setPointerCapture(event.pointerId); });
view.addEventListener("pointermove", (event) => {
  const from = pointers.get(event.pointerId), to = [event.offsetX, event.offsetY];
  if (!from) return;
  pointers.set(event.pointerId, to);
  if (pointers.size === 2) {
    const other = [...pointers].find(([id]) => id !== event.pointerId)[1], distance = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
    zoomBy(distance(to) / distance(from), (to[0] + other[0]) / 2, (to[1] + other[1]) / 2);
  } else if (zoom > 1) { shift = [shift[0] + to[0] - from[0], shift[1] + to[1] - from[1]]; draw(); }
});
for (const end of ["pointerup", "pointercancel"]) view.addEventListener(end, (event) => pointers.delete(event.pointerId));
function seek(event) {
  const part = (event.offsetX - MARGINS[0]) / (plot.clientWidth - MARGINS[0] - MARGINS[2]), first = film.time[0];
  const t = first + part * (film.time[film.time.length - 1] - first);
  showInstant(lastInstant(film.time, t));
}
plot.addEventListener("pointerdown", seek);
plot.addEventListener("pointermove", (event) => { if (event.buttons) seek(event); });
slider.addEventListener("input", () => { setPlaying(false); showInstant(+slider.value); });
get("play").addEventListener("click", () => setPlaying(!playing));
get("fit").addEventListener("click", () => { zoom = 1; shift = [0, 0]; draw(); });
if (get("film")) get("film").addEventListener("change", (event) => selectFilm(+event.target.value));
document.addEventListener("keydown", (event) => {
  const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (["SELECT", "INPUT", "BUTTON"].includes(event.target.tagName) || film.time.length < 2) return;
  if (event.key === " ") { event.preventDefault(); setPlaying(!playing); } else if (step) { setPlaying(false); showInstant(instant + step); }
});
window.addEventListener("resize", draw);
window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { updateLegends(); draw(); });
selectFilm(0);

// Film of a scene: walls, lines, points and arrows on one canvas, at any of its instants.
//
//   new Film(canvas, data, highest)   data: of `film_data` (page.py); highest: () -> limit of the height [px]
//   show(time): draw the instant that is nearest to a time [s]      legend(): its entries, as elements
// Wheel or pinch: zoom. Drag: move what is zoomed in.

import { nearest } from "./scale.js";

class Film {
  constructor(canvas, data, highest) {
    Object.assign(this, data, { canvas, picture: canvas, highest, instant: 0, pointers: new Map() });
    for (const key of ["lines", "points"]) this[key] = data[key].map((track) => ({ ...track, values: unpackTrack(track) }));
    this.arrows = data.arrows.map((track) => ({ ...track, values: unpackTrack(track), origins: unpackTrack(track.at) }));
    this.motions = Object.fromEntries(Object.entries(data.motions).map(([name, track]) => [name, unpackTrack(track)]));
    this.fit();
  }

  show(time) { this.instant = nearest(this.time, time); this.draw(); }
  fit() { this.zoom = 1; this.shift = [0, 0]; }

  legend() {
    return [
      ...this.lines.map((track) => legendEntry(track.label, track.color)),
      ...this.points.map((track) => legendEntry(track.label, track.color, true)),
      ...this.arrows.map((track) => legendEntry(`${track.label}, longest ${+track.longest.toPrecision(3)} ${track.unit}`, track.color))];
  }

  scale() { // pixels per mm, and the center of the scene
    const [left, bottom, right, top] = this.bounds, width = this.canvas.clientWidth;
    const height = Math.min(Math.max(width * (top - bottom) / (right - left), 160), this.highest());
    const fit = Math.min(width / (right - left), height / (top - bottom));
    return { width, height, scale: fit * this.zoom, middle: [(left + right) / 2, (bottom + top) / 2] };
  }

  draw() {
    const { width, height, scale, middle } = this.scale(), pen = resizeCanvas(this.canvas, width, height);
    if (!width) return;
    const style = getComputedStyle(this.canvas), color = (name) => style.getPropertyValue(`--${name}`).trim();
    const toPixels = (x, y) => [width / 2 + (x - middle[0]) * scale + this.shift[0], height / 2 - (y - middle[1]) * scale + this.shift[1]];
    pen.lineJoin = pen.lineCap = "round";
    this.drawWalls(pen, toPixels, scale, color);
    for (const line of this.lines) {
      tracePath(pen, line.values, this.instant * line.count, line.count / 2, toPixels);
      pen.strokeStyle = color(`line-${line.color}`); pen.lineWidth = Math.max(line.width * scale, 1.6);
      pen.stroke();
    }
    for (const mark of this.points) {
      pen.strokeStyle = color(`line-${mark.color}`); pen.lineWidth = 2;
      for (let i = 0; i < mark.count; i += 2) {
        const [x, y] = toPixels(mark.values[this.instant * mark.count + i], mark.values[this.instant * mark.count + i + 1]);
        if (Number.isNaN(x + y)) continue;
        pen.beginPath(); pen.arc(x, y, 4.5, 0, 7); pen.stroke();
      }
    }
    this.drawArrows(pen, toPixels, scale / this.zoom, color);
    drawScaleBar(pen, width, height, scale, color("soft"));
  }

  drawWalls(pen, toPixels, scale, color) {
    for (const wall of this.walls) {
      const displacement = this.motions[wall.moves] ? this.motions[wall.moves][this.instant] : 0;
      tracePath(pen, wall.points, 0, wall.points.length / 2, toPixels, displacement * wall.direction[0], displacement * wall.direction[1]);
      const ink = color(wall.moves ? "tissue" : "soft");
      if (wall.closed) {
        pen.closePath();
        pen.fillStyle = ink; pen.globalAlpha = 0.45; pen.fill(); pen.globalAlpha = 1;
      }
      pen.strokeStyle = ink; pen.lineWidth = Math.max(wall.thickness * scale, 1.2);
      pen.stroke();
    }
    if (!this.lines.length && this.path.length) {
      tracePath(pen, this.path, 0, this.path.length / 2, toPixels);
      pen.setLineDash([7, 5]); pen.strokeStyle = color("wire"); pen.lineWidth = 1.5; pen.stroke(); pen.setLineDash([]);
    }
  }

  drawArrows(pen, toPixels, fit, color) { // their length does not depend on the zoom
    for (const arrow of this.arrows) {
      const unit = this.arrow * fit / arrow.longest, from = this.instant * arrow.count;
      pen.strokeStyle = pen.fillStyle = color(`line-${arrow.color}`); pen.lineWidth = 2;
      for (let i = 0; i < arrow.count; i += 2) {
        const [x, y] = toPixels(arrow.origins[from + i], arrow.origins[from + i + 1]);
        const dx = arrow.values[from + i] * unit, dy = -arrow.values[from + i + 1] * unit;
        if (!Number.isNaN(x + y + dx + dy)) drawArrow(pen, x, y, dx, dy);
      }
    }
  }

  zoomBy(factor, px, py) {
    const previous = this.zoom;
    this.zoom = Math.min(Math.max(previous * factor, 1), 200);
    const { width, height } = this.scale(), part = this.zoom / previous, [x, y] = this.shift;
    this.shift = this.zoom === 1 ? [0, 0] : [px - width / 2 - (px - width / 2 - x) * part, py - height / 2 - (py - height / 2 - y) * part];
    this.draw();
  }

  // user actions on the canvas, which several films share; `isShown`: whether it shows this one
  listen(isShown) {
    const { canvas, pointers } = this;
    canvas.addEventListener("wheel", (event) => {
      if (!isShown()) return;
      event.preventDefault();
      this.zoomBy(Math.exp(-event.deltaY / 400), event.offsetX, event.offsetY);
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => { pointers.set(event.pointerId, [event.offsetX, event.offsetY]); canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointermove", (event) => {
      const from = pointers.get(event.pointerId), to = [event.offsetX, event.offsetY];
      if (!from || !isShown()) return;
      pointers.set(event.pointerId, to);
      if (pointers.size === 2) {
        const other = [...pointers].find(([id]) => id !== event.pointerId)[1], distance = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
        this.zoomBy(distance(to) / distance(from), (to[0] + other[0]) / 2, (to[1] + other[1]) / 2);
      } else if (this.zoom > 1) { this.shift = [this.shift[0] + to[0] - from[0], this.shift[1] + to[1] - from[1]]; this.draw(); }
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => pointers.delete(event.pointerId));
  }
}

// numbers of `pack_values` (page.py): two bytes each, 65535 for NaN
function unpackTrack({ data, low, step }) {
  const codes = new Uint16Array(Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0)).buffer);
  return Float64Array.from(codes, (code) => (code === 65535 ? NaN : low + code * step));
}

function resizeCanvas(canvas, width, height) {
  const ratio = window.devicePixelRatio || 1;
  canvas.style.height = `${height}px`;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = "12px system-ui, sans-serif";
  return pen;
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

function drawScaleBar(pen, width, height, scale, ink) {
  const rough = 0.22 * width / scale, power = 10 ** Math.floor(Math.log10(rough));
  const length = [5, 2, 1].map((n) => n * power).find((n) => n <= rough) || power;
  pen.strokeStyle = pen.fillStyle = ink; pen.lineWidth = 2;
  pen.beginPath(); pen.moveTo(8, height - 8); pen.lineTo(8 + length * scale, height - 8); pen.stroke();
  pen.fillText(`${+length.toPrecision(2)} mm`, 8, height - 14);
}

function legendEntry(text, color, isRing) {
  const item = document.createElement("span"), mark = document.createElement("i");
  mark.style.borderColor = `var(--line-${color})`;
  if (isRing) mark.className = "ring";
  item.append(mark, text);
  return item;
}

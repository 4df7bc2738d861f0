// Samples that are embedded in a page: little-endian Float64, deflated, base64, one script element for each array.

import { before } from "./scale.js";

const unpacked = [];

// the numbers of an embedded array, by its index in the page
export function unpack(index) {
  unpacked[index] ??= inflate(document.querySelectorAll("script.packed")[index].textContent);
  return unpacked[index];
}

async function inflate(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Float64Array(await new Response(stream).arrayBuffer());
}

// interpolate linearly; where samples are not real numbers, the last one holds
export function valueAt({ x, y, head }, time) {
  const k = before(x, time);
  if (k < 0 || time > x[x.length - 1]) return null;
  const value = !head.real || k === x.length - 1 || x[k + 1] === x[k] ? y[k] : y[k] + ((y[k + 1] - y[k]) * (time - x[k])) / (x[k + 1] - x[k]);
  return Number.isFinite(value) ? value : null;
}

// minimum and maximum of equal parts, each at its time: at most `points` of the samples from `begin` to `end`
export function extremes(x, y, begin, end, points) {
  if (end - begin <= points) return { x: x.subarray(begin, end), y: y.subarray(begin, end) };
  const indices = [], size = (2 * (end - begin)) / points;
  for (let part = begin; Math.ceil(part) < end; part += size) {
    let low = -1, high = -1;
    for (let k = Math.ceil(part); k < Math.min(part + size, end); k++) {
      if (!(y[k] === y[k])) continue;
      if (low < 0 || y[k] < y[low]) low = k;
      if (high < 0 || y[k] > y[high]) high = k;
    }
    if (low < 0) indices.push(Math.ceil(part)); // a gap stays one
    else indices.push(Math.min(low, high), ...(low === high ? [] : [Math.max(low, high)]));
  }
  return { x: Float64Array.from(indices, (k) => x[k]), y: Float64Array.from(indices, (k) => y[k]) };
}

// the samples of a window, with one more on both sides so that a line reaches the edge
export function visible({ x, y }, from, to, points) {
  const begin = Math.max(before(x, from), 0), end = Math.min(before(x, to) + 2, x.length);
  return { ...extremes(x, y, begin, end, points), count: end - begin };
}

// Ticks and numbers of axes.

export function ticks(low, high, count) {
  const span = high - low;
  if (!(span > 0) || !isFinite(span)) return { at: [low], step: 0 };
  const raw = span / Math.max(count, 1), power = Math.pow(10, Math.floor(Math.log10(raw)));
  const step = power * [1, 2, 5, 10].find((one) => one * power >= raw * 0.999);
  const at = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + step * 1e-9; k++) at.push(k * step);
  return { at, step };
}

// 1, 2 and 5 times the powers of ten of a range
function halves(low, high) {
  const at = [];
  for (let k = Math.floor(Math.log10(low)); k <= Math.log10(high); k++) at.push(...[1, 2, 5].map((one) => one * Math.pow(10, k)));
  return at.filter((one) => one >= low && one <= high);
}

export function decades(low, high) {
  const at = [];
  if (!(low > 0) || !isFinite(high)) return { at, step: 0 };
  for (let k = Math.ceil(Math.log10(low)); k <= Math.floor(Math.log10(high) + 1e-9); k++) at.push(Math.pow(10, k));
  if (at.length < 3) return high / low > 20 ? { at: halves(low, high), step: 0 } : ticks(low, high, 4);
  return { at: at.length > 8 ? at.filter((_, k) => k % Math.ceil(at.length / 8) === 0) : at, step: 0 };
}

// format with the digits of a step, that of an axis or a resolution; without a step: four significant digits
export function number(value, step) {
  if (!isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value), power = (digits) => value.toExponential(digits).replace(/(\.\d*?)0+e/, "$1e").replace(/\.?e\+?/, "e");
  if (!step) return size >= 1e6 || size < 1e-4 ? power(3) : String(+value.toPrecision(4));
  const place = Math.floor(Math.log10(step) + 1e-9), decimals = Math.max(0, -place);
  if (size >= 1e7 || (size < 1e-3 && decimals > 4)) return Math.floor(Math.log10(size)) < place ? "0" : power(Math.min(Math.floor(Math.log10(size)) - place, 12));
  const text = value.toFixed(Math.min(decimals, 12));
  return +text === 0 ? "0" : text;
}

// a value with the digits that a screen can show of a range, at most to a part of the largest value; a time has those of a sample
export const readable = (value, low, high, parts = 1000, finest = 1e-5) =>
  number(value, high > low ? Math.max((high - low) / parts, finest * Math.max(Math.abs(low), Math.abs(high))) : 0);
export const readableTime = (time, from, to) => readable(time, from, to, 10000, 0);

// positions [px] of the values of an axis that begins at `start`; `inverse`: the values of positions
export function axis(begin, end, isLog, start, length) {
  const [of, back] = isLog ? [Math.log10, (exponent) => 10 ** exponent] : [(value) => value, (value) => value], low = of(begin), span = of(end) - low;
  return Object.assign((value) => start + ((of(value) - low) / span) * length, { inverse: (at) => back(low + ((at - start) / length) * span) });
}

// extent of the visible values, with a margin, never empty
export function extent(series, from, to, extra) {
  let low = Infinity, high = -Infinity;
  for (const { x, y } of series) {
    for (let k = 0; k < x.length; k++) {
      if (x[k] < from || x[k] > to) continue;
      const value = y[k];
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  for (const one of extra) { if (one < low) low = one; if (one > high) high = one; }
  if (low > high) return [0, 1];
  const size = Math.max(Math.abs(low), Math.abs(high));
  if (size < 1e-9) return [-1, 1];  // zero, apart from rounding
  if (high - low < size * 1e-6) return [low - size * 0.05, high + size * 0.05];
  const margin = (high - low) * 0.06;
  return [low - margin, high + margin];
}

// index of the last x that is not above a value
export function before(x, at) {
  let low = 0, high = x.length;
  while (low < high) { const middle = (low + high) >> 1; if (x[middle] <= at) low = middle + 1; else high = middle; }
  return low - 1;
}

// index of the nearest x; -1 if there is none
export function nearest(x, at) {
  const k = before(x, at);
  return k + 1 < x.length && (k < 0 || x[k + 1] - at < at - x[k]) ? k + 1 : k;
}

// An answer of the server: length and text of a header, then float64 numbers.
export function decodeArrays(buffer) {
  const length = new DataView(buffer).getUint32(0, true), header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, length)));
  return { header, numbers: new Float64Array(buffer, 8 + Math.ceil(length / 8) * 8) };
}

// Curves of the server: x and y of each, and `t` of those that are `timed`.
export function decode(buffer) {
  const { header, numbers } = decodeArrays(buffer);
  let place = 0;
  const take = (count) => numbers.subarray(place, (place += count));
  header.curves = header.counts.map((count, k) => ({ x: take(count), y: take(count), ...(header.timed?.[k] ? { t: take(count) } : {}) }));
  return header;
}

// Power spectral density of embedded samples, equal to that of the server (curve_data.py): one-sided,
// Welch's method with Hann windows, mean removed. IEEE Trans. AU-15, 1967.

const LEAST = 16, SEGMENTS = 2, EVEN = 0.01; // samples; of Welch's method, with one between them; part by which distances may differ

function spectrumOf(x, y, name) {
  const [time, value] = evenly(x, y);
  if (value.length < LEAST) throw new Error(`${name}: ${value.length} samples in view, a spectrum needs ${LEAST}. Show more time.`);
  return density(value, (time.length - 1) / (time[time.length - 1] - time[0]));
}

// equidistant times and interpolated values; non-finite values are bridged
function evenly(x, y) {
  const there = [...x.keys()].filter((k) => Number.isFinite(y[k])), time = there.map((k) => x[k]), value = there.map((k) => y[k]);
  if (time.length < 2) return [time, value];
  const steps = time.slice(1).map((one, k) => one - time[k]), sorted = [...steps].sort((a, b) => a - b), half = sorted.length >> 1;
  const typical = sorted.length % 2 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
  if (typical > 0 && steps.every((one) => Math.abs(one - typical) <= EVEN * typical)) return [time, value];
  const first = time[0], span = time[time.length - 1] - first, own = { x: time, y: value, head: { real: true } };
  const count = Math.floor(Math.min(span / Math.max(typical, 1e-12), 4 * time.length)) + 1;
  const times = Array.from({ length: count }, (_, k) => Math.min(first + (span * k) / Math.max(count - 1, 1), first + span));
  return [times, times.map((one) => valueAt(own, one))];
}

// frequencies without zero, and the density, of samples at a rate [Hz]
function density(value, rate) {
  const length = Math.max(LEAST, Math.min(value.length, Math.floor((2 * value.length) / (SEGMENTS + 1)))), step = length - (length >> 1);
  const hann = Float64Array.from({ length }, (_, k) => 0.5 - 0.5 * Math.cos((2 * Math.PI * k) / length)), transform = chirp(length);
  const power = new Float64Array(Math.floor(length / 2) + 1);
  let count = 0;
  for (let begin = 0; begin + length <= value.length; begin += step, count++) {
    const part = value.slice(begin, begin + length), mean = part.reduce((sum, one) => sum + one, 0) / length;
    const [re, im] = transform(part.map((one, k) => (one - mean) * hann[k]));
    power.forEach((_, k) => { power[k] += re[k] ** 2 + im[k] ** 2; });
  }
  const scale = 1 / (rate * count * hann.reduce((sum, one) => sum + one * one, 0)), both = (k) => (2 * k === length ? 1 : 2);
  return { x: Float64Array.from(power.keys(), (k) => (k * rate) / length).slice(1), y: power.map((one, k) => one * scale * both(k)).slice(1) };
}

// the discrete Fourier transform of any length, as a convolution by transforms of a power of two. Bluestein, IEEE Trans. AU-18, 1970.
function chirp(length) {
  const size = 2 ** Math.ceil(Math.log2(2 * length)), turns = Array.from({ length }, (_, k) => (Math.PI * ((k * k) % (2 * length))) / length);
  const cos = turns.map(Math.cos), sin = turns.map(Math.sin), re = new Float64Array(size), im = new Float64Array(size);
  for (let k = 0; k < length; k++) { re[k] = re[(size - k) % size] = cos[k]; im[k] = im[(size - k) % size] = sin[k]; }
  turned(re, im);
  return (values) => {
    const a = new Float64Array(size), b = new Float64Array(size);
    values.forEach((one, k) => { a[k] = one * cos[k]; b[k] = -one * sin[k]; });
    turned(a, b);
    for (let k = 0; k < size; k++) [a[k], b[k]] = [a[k] * re[k] - b[k] * im[k], -(a[k] * im[k] + b[k] * re[k])]; // conjugate: the way back
    turned(a, b);
    return [cos.map((one, k) => (a[k] * one - b[k] * sin[k]) / size), cos.map((one, k) => (-b[k] * one - a[k] * sin[k]) / size)];
  };
}

// the Fourier transform of a power of two, in place. Cooley and Tukey, Math. Comp. 19, 1965.
function turned(re, im) {
  const size = re.length;
  for (let k = 1, other = 0; k < size; k++) {
    let bit = size >> 1;
    for (; other & bit; bit >>= 1) other ^= bit;
    other ^= bit;
    if (k < other) { [re[k], re[other]] = [re[other], re[k]]; [im[k], im[other]] = [im[other], im[k]]; }
  }
  for (let half = 1; half < size; half *= 2) {
    for (let turn = 0; turn < half; turn++) {
      const cos = Math.cos((-Math.PI * turn) / half), sin = Math.sin((-Math.PI * turn) / half);
      for (let k = turn; k < size; k += 2 * half) {
        const a = re[k + half] * cos - im[k + half] * sin, b = re[k + half] * sin + im[k + half] * cos;
        re[k + half] = re[k] - a; im[k + half] = im[k] - b;
        re[k] += a; im[k] += b;
      }
    }
  }
}

// the unit of a density: N²/Hz
function squared(unit) { return unit ? `${/^\p{L}+$/u.test(unit) ? unit : `(${unit})`}²/Hz` : "1/Hz"; }

// Sources of samples: a server that reads the runs' folders (server_source.js), or the page itself. Both have:
//
//   lines(specs, points)   -> [{x, y, t, head}]; a spec is {kind, signal, case, minus, shift, x, seeds, partners, part, window: [from, to]} in the run's own time
//   values(specs, times)   -> [[value, ...], ...], null where not recorded
//   statistics(specs)      -> [{count, unit, mean, std, rms, low, high, peak_to_peak, slope, rate}] of the window
//   scene(case, window)    -> {views, times, signals: [{name, shape, values}]}
//
// A server also reports the progress of running runs: progress() -> {over, problem: [text], cases: [[begin, end, samples], ...]}

import { before } from "./scale.js";
import { extremes, unpack, valueAt, visible } from "./samples.js";

const LOOP = 10_000; // samples of an x-y plot at most

class EmbeddedSource {
  constructor(about) {
    this.curves = new Map(about.embedded.map((one) => [`${one.case} ${one.signal}`, one]));
    this.merged = new Map();
    this.film = about.film;
  }

  async samples(signal, number) {
    const one = this.curves.get(`${number} ${signal}`);
    if (!one) throw new Error(`${signal}: is not in this page.`);
    return { x: await unpack(one.x), y: await unpack(one.y), head: one.head };
  }

  async whole(spec) {
    if (spec.seeds?.length) return this.acrossSeeds(spec);
    const own = await this.samples(spec.signal, spec.case);
    if (spec.minus === null || spec.minus === undefined) return own;
    await this.requireSamples(spec, "difference");
    const less = await this.samples(spec.signal, spec.minus), x = [], y = [];
    own.x.forEach((time, k) => {
      const value = valueAt(less, time - spec.shift);
      if (value !== null) { x.push(time); y.push(own.y[k] - value); }
    });
    return { x: Float64Array.from(x), y: Float64Array.from(y), head: own.head };
  }

  // mean, lowest or highest value of several cases, or of their differences from others, at the times of the first
  async acrossSeeds({ seeds, partners, part, ...spec }) {
    const name = JSON.stringify([spec.signal, seeds, partners, spec.shift]), own = await this.whole(spec);
    if (!this.merged.has(name)) {
      const all = await Promise.all(seeds.map((seed, k) => this.whole({ ...spec, case: seed, minus: partners?.[k] ?? null }))), found = { mean: [], low: [], high: [] };
      for (const time of own.x) {
        const values = all.map((one) => valueAt(one, time)).filter((value) => value !== null);
        found.mean.push(values.length ? values.reduce((a, b) => a + b, 0) / values.length : NaN);
        found.low.push(values.length ? Math.min(...values) : NaN);
        found.high.push(values.length ? Math.max(...values) : NaN);
      }
      this.merged.set(name, Object.fromEntries(Object.entries(found).map(([key, list]) => [key, Float64Array.from(list)])));
    }
    return { x: own.x, y: this.merged.get(name)[part], head: own.head };
  }

  async lines(specs, points) {
    return Promise.all(specs.map(async (spec) => {
      try {
        const { x, y, head } = await this.whole(spec);
        if (spec.kind === "time") return { ...visible({ x, y }, ...spec.window, points), head };
        if (spec.kind === "spectrum") return await this.spectrum(spec, { x, y, head }, points);
        await this.requireSamples(spec, "x-y plot");
        const begin = Math.max(before(x, spec.window[0]), 0), end = Math.min(before(x, spec.window[1]) + 2, x.length);
        const across = await this.whole({ ...spec, signal: spec.x, minus: null }); // of a difference, x of its own case
        const times = x.slice(begin, end), of = (one) => Float64Array.from(times, (time) => valueAt(one, time) ?? NaN);
        const step = Math.ceil(times.length / LOOP), [u, v, t] = [of(across), of({ x, y, head }), times].map((all) => all.filter((_, k) => k % step === 0));
        return { x: u, y: v, t, count: times.length, head: { ...head, x_unit: across.head.unit } };
      } catch (error) {
        return { x: [], y: [], head: { error: error.message } };
      }
    }));
  }

  async spectrum(spec, { x, y, head }, points) {
    await this.requireSamples(spec, "spectrum");
    const [from, to] = spec.window, begin = x.findIndex((time) => time >= from), end = before(x, to) + 1; // no sample outside the window
    const whole = spectrumOf(...[x, y].map((all) => all.slice(begin < 0 ? end : begin, end)), spec.signal);
    return { ...extremes(whole.x, whole.y, 0, whole.x.length, points), head: { ...head, unit: squared(head.unit), x_unit: "Hz" } };
  }

  // whether the page has the extremes of a curve's samples alone
  async isThinned(spec) {
    const all = await Promise.all([spec.case, spec.minus ?? spec.case, ...(spec.seeds ?? []), ...(spec.partners ?? [])].map((number) => this.samples(spec.signal, number)));
    return all.some((own) => own.head.count > own.x.length);
  }

  async requireSamples(spec, what) {
    if (await this.isThinned(spec)) throw new Error(`${spec.signal}: the page has the extremes of its samples alone. Look at its ${what} with twin view.`);
  }

  async values(specs, times) {
    return Promise.all(specs.map(async (spec, k) => {
      try { const own = await this.whole(spec); return times[k].map((time) => valueAt(own, time)); } catch { return times[k].map(() => null); }
    }));
  }

  async statistics(specs) {
    return Promise.all(specs.map(async (spec) => {
      try {
        const { x, y, head } = await this.whole(spec), [from, to] = spec.window;
        const found = summaryOf(x, y, from, to), thinned = await this.isThinned(spec);
        return { ...found, unit: head.unit, thinned, ...(thinned ? { mean: null, std: null, rms: null, slope: null, rate: null } : {}) };
      } catch { return { count: 0 }; }
    }));
  }

  async scene(number) {
    const film = this.film?.case === number ? this.film : null;
    if (!film) return { views: [], times: [], signals: [] };
    const signals = await Promise.all(film.signals.map(async (signal) => ({ ...signal, values: await unpack(signal.y) })));
    return { views: film.views, times: await unpack(film.x), signals };
  }
}

// statistics of the finite samples of a window
function summaryOf(x, y, from, to) {
  const found = { count: 0, low: Infinity, high: -Infinity, sum: 0, squares: 0, times: 0, first: -1, last: -1 }, start = () => y[found.first];
  for (let k = Math.max(before(x, from), 0); k < x.length && x[k] <= to; k++) {
    if (x[k] < from || !Number.isFinite(y[k])) continue;
    if (found.first < 0) found.first = k;
    found.last = k; found.count++; found.times += x[k]; found.sum += y[k] - start(); found.squares += y[k] * y[k];
    found.low = Math.min(found.low, y[k]); found.high = Math.max(found.high, y[k]);
  }
  const { count, low, high, first, last } = found, mean = start() + found.sum / count, middle = found.times / count, span = x[last] - x[first];
  if (!count) return { count };
  let deviations = 0, spread = 0, rise = 0;
  for (let k = first; k <= last; k++) {
    if (!Number.isFinite(y[k])) continue;
    deviations += (y[k] - mean) ** 2; spread += (x[k] - middle) ** 2; rise += (x[k] - middle) * (y[k] - mean);
  }
  return { count, mean, std: Math.sqrt(deviations / count), rms: Math.sqrt(found.squares / count), low, high, peak_to_peak: high - low,
           slope: span > 0 ? (high > low ? rise / spread : 0) : null, rate: span > 0 ? (count - 1) / span : null };
}

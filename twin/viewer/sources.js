// Sources of samples: a server that reads the runs' folders, or the page itself. Both have:
//
//   lines(specs, points)   -> [{x, y, head}]; a spec is {kind, signal, case, minus, shift, x, window: [from, to]} in the run's own time
//   values(specs, times)   -> [[value, ...], ...], null where not recorded
//
// A server also reports the progress of running runs: progress() -> {over, problem: [text], cases: [[begin, end, samples], ...]}

class ServerSource {
  async request(path, body) {
    const answer = await fetch(path, { method: "POST", body: JSON.stringify(body), headers: { "content-type": "application/json" } });
    if (!answer.ok) throw new Error(await answer.text());
    return answer;
  }

  async lines(curves, points) {
    const found = decode(await (await this.request("/lines", { curves, points })).arrayBuffer());
    return found.curves.map((one, k) => ({ ...one, head: found.heads[k] }));
  }

  async progress() { return (await this.request("/progress", {})).json(); }

  async values(curves, times) {
    return (await (await this.request("/values", { curves, times })).json()).values;
  }
}

class EmbeddedSource {
  constructor(about) {
    this.curves = new Map(about.embedded.map((one) => [`${one.case} ${one.signal}`, one]));
  }

  async samples(signal, number) {
    const one = this.curves.get(`${number} ${signal}`);
    if (!one) throw new Error(`${signal}: is not in this page.`);
    return { x: await unpack(one.x), y: await unpack(one.y), head: one.head };
  }

  async whole(spec) {
    const own = await this.samples(spec.signal, spec.case);
    if (spec.minus === null || spec.minus === undefined) return own;
    const less = await this.samples(spec.signal, spec.minus), x = [], y = [];
    own.x.forEach((time, k) => {
      const value = valueAt(less, time - spec.shift);
      if (value !== null) { x.push(time); y.push(own.y[k] - value); }
    });
    return { x: Float64Array.from(x), y: Float64Array.from(y), head: own.head };
  }

  async lines(specs, points) {
    return Promise.all(specs.map(async (spec) => {
      try {
        const { x, y, head } = await this.whole(spec);
        const begin = Math.max(before(x, spec.window[0]), 0), end = Math.min(before(x, spec.window[1]) + 2, x.length);
        if (spec.kind === "time") return { ...extremes(x, y, begin, end, points), head };
        if (spec.kind === "spectrum") return await this.spectrum(spec, { x: x.slice(begin, end), y: y.slice(begin, end), head }, points);
        const across = await this.whole({ ...spec, signal: spec.x });
        const times = [...x.slice(begin, end)].filter((_, k, all) => k % Math.max(Math.ceil(all.length / points), 1) === 0);
        const of = (one) => Float64Array.from(times, (time) => valueAt(one, time) ?? NaN);
        return { x: of(across), y: of({ x, y, head }), head: { ...head, x_unit: across.head.unit } };
      } catch (error) {
        return { x: [], y: [], head: { error: error.message } };
      }
    }));
  }

  async spectrum(spec, { x, y, head }, points) {
    for (const number of [spec.case, spec.minus ?? spec.case]) {
      const own = await this.samples(spec.signal, number);
      if (own.head.count > own.x.length) throw new Error(`${spec.signal}: the page has the extremes of its samples alone. Look at its spectrum with twin view.`);
    }
    const whole = spectrumOf(x, y, spec.signal);
    return { ...extremes(whole.x, whole.y, 0, whole.x.length, points), head: { ...head, unit: squared(head.unit), x_unit: "Hz" } };
  }

  async values(specs, times) {
    return Promise.all(specs.map(async (spec, k) => {
      try { const own = await this.whole(spec); return times[k].map((time) => valueAt(own, time)); } catch { return times[k].map(() => null); }
    }));
  }
}

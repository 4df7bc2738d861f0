// The source of samples of a page that is served; a page of one file is smaller without it. See sources.js.

import { decode, decodeArrays } from "./scale.js";

class ServerSource {
  async request(path, body) {
    const number = new URLSearchParams(location.search).get("case"); // of a study
    const answer = await fetch(number ? `${path}?case=${encodeURIComponent(number)}` : path, { method: "POST", body: JSON.stringify(body), headers: { "content-type": "application/json" } });
    if (!answer.ok) throw new Error(await answer.text());
    return answer;
  }

  async lines(curves, points) {
    const found = decode(await (await this.request("/lines", { curves, points })).arrayBuffer());
    return found.curves.map((one, k) => ({ ...one, head: found.heads[k] }));
  }

  async statistics(curves) { return (await (await this.request("/statistics", { curves })).json()).statistics; }

  async scene(number, window) {
    const { header, numbers } = decodeArrays(await (await this.request("/scene", { case: number, window })).arrayBuffer());
    let place = header.count;
    const signals = header.signals.map((signal) => {
      const size = signal.shape.reduce((a, b) => a * b, header.count);
      place += size;
      return { ...signal, values: numbers.subarray(place - size, place) };
    });
    return { views: header.views, times: numbers.subarray(0, header.count), signals };
  }

  async progress() { return (await this.request("/progress", {})).json(); }

  async values(curves, times) {
    return (await (await this.request("/values", { curves, times })).json()).values;
  }
}

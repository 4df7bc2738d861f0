// Animation of the machine: SVG views, moved with the values of each tick. Warnings have a row above it and are felt in a gamepad.

import { channel } from "/console/channel.js";
import { keyText } from "/console/desk.js";
import { drawViews, movingSignals } from "/web/views.js";

const RUMBLE = { duration: 200, strongMagnitude: 0.8, weakMagnitude: 0.4 };  // [ms], parts of the largest

export default {
  template: `<div class="twin-views"><div class="twin-alert" v-if="warnings.length"><p class="twin-warning" role="alert" v-show="warning">{{ warning }}</p></div></div>`,
  props: { views: Array, warnings: Array, reached: Array, controls: Array },
  data: () => ({ warning: "" }),
  mounted() {
    const move = drawViews(this.$el, this.views), moving = movingSignals(this.views);
    const hide = (is_hidden) => { this.$el.style.visibility = is_hidden ? "hidden" : ""; };
    hide(moving.length > 0);  // until its values are there: those of the start are no result
    this.onTick = (state) => {
      if (!state.values || document.hidden) return;
      for (const one of this.controls) if (state.held?.[one.input]) this.moved = { ...this.moved, [one.input]: Number(state.held[one.input] > 0) };
      hide(moving.length && !moving.some((name) => name in state.values));
      move(state.values, this.reached);
      this.warn(state);
    };
    channel.listeners.add(this.onTick);
    channel.watch(this, [...new Set([...moving, ...this.warnings.flatMap((one) => [one.signal, one.minus || []].flat())])]);
  },
  unmounted() { channel.listeners.delete(this.onTick); channel.watch(this, []); },
  methods: {
    // which controls end a warning, by the state: of a force on both those that have last moved against it
    ways(one, value) {
      const forward = value < one.below ? "back" : "forward", moved = this.moved || {};
      const all = Object.entries(one.remedy || {}).map(([input, way]) => ({ ...this.controls.find((each) => each.input === input), way: Number(way === forward) })).filter((each) => each.keys);
      const causes = all.filter((each) => moved[each.input] === 1 - each.way);
      return one.below !== undefined && causes.length ? causes : all;
    },
    advice(ways) {
      const text = ({ label, keys, way }) => `${label} ${["back", "forward"][way]} ${matchMedia("(hover: none)").matches ? `(${"−+"[way]})` : `with ${keyText(keys[1 - way])}`}`;
      return ways.length ? `: ${ways.map(text).join(", or ")}` : "";
    },
    warn(state) {
      const valueOf = (one) => Number(state.values[one.signal]) - (one.minus ? Number(state.values[one.minus]) : 0);
      const shown = this.warnings.filter((one) => valueOf(one) > one.above || valueOf(one) < one.below).map((one) => [one.text, this.ways(one, valueOf(one))]);
      const all = shown.flatMap(([, ways]) => ways), fits = (way) => all.every((other) => other.input !== way.input || other.way === way.way);  // no warning advises what another one advises against
      this.warning = ["finishing", "stopped", "failed"].includes(state.phase) ? "" : shown.map(([text, ways]) => text + this.advice(ways.some(fits) ? ways.filter(fits) : ways)).join(" · ");
      const now = performance.now();
      if (!this.warning || !channel.operator || state.phase !== "running" || now < (this.felt || 0) + RUMBLE.duration) return;
      this.felt = now;
      for (const pad of navigator.getGamepads?.() || []) pad?.vibrationActuator?.playEffect("dual-rumble", RUMBLE);
    },
  },
};

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
      for (const one of this.controls) if (state.held?.[one.input]) this.moved = { ...this.moved, [one.input]: [state.time, state.held[one.input] > 0 ? 1 : 0] };
      hide(moving.length && !moving.some((name) => name in state.values));
      move(state.values, this.reached);
      this.warn(state);
    };
    channel.listeners.add(this.onTick);
    channel.watch(this, [...new Set([...moving, ...this.warnings.flatMap((one) => [one.signal, one.minus || []].flat())])]);
  },
  unmounted() { channel.listeners.delete(this.onTick); channel.watch(this, []); },
  methods: {
    // what to do: move back what was moved last, of the instruments that a warning names, or of all
    remedy(text) {
      const named = this.controls.filter((one) => text.includes(one.label)), moved = this.moved || {};
      const last = (named.length ? named : this.controls).filter((one) => one.input in moved).sort((a, b) => moved[b.input][0] - moved[a.input][0])[0];
      if (!last) return "";
      const way = moved[last.input][1];
      return matchMedia("(hover: none)").matches ? `: hold ${last.label} ${"+−"[way]}` : `: ${last.label} back with ${keyText(last.keys[way])}`;
    },
    warn(state) {
      const valueOf = (one) => Number(state.values[one.signal]) - (one.minus ? Number(state.values[one.minus]) : 0);
      const shown = this.warnings.filter((one) => valueOf(one) > one.above || valueOf(one) < one.below);
      this.warning = ["finishing", "stopped", "failed"].includes(state.phase) ? "" : shown.map((one) => one.text + this.remedy(one.text)).join(" · ");
      const now = performance.now();
      if (!this.warning || !channel.operator || state.phase !== "running" || now < (this.felt || 0) + RUMBLE.duration) return;
      this.felt = now;
      for (const pad of navigator.getGamepads?.() || []) pad?.vibrationActuator?.playEffect("dual-rumble", RUMBLE);
    },
  },
};

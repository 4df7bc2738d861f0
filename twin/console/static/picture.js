// Animation of the machine: SVG views, updated with the values of each tick. Warnings are shown above it and felt in a gamepad.

import { channel } from "/console/channel.js";
import { rig } from "/console/view_rig.js";
import { bench } from "/console/view_bench.js";
import { vessel } from "/console/view_vessel.js";
import { scene } from "/console/view_scene.js";

const VIEWS = { rig, bench, vessel, scene };
const RUMBLE = { duration: 200, strongMagnitude: 0.8, weakMagnitude: 0.4 };  // [ms], parts of the largest

export default {
  template: `<div class="twin-views"><p class="twin-warning" role="alert" v-show="warning">{{ warning }}</p></div>`,
  props: { views: Array, warnings: Array, reached: Array },
  data: () => ({ warning: "" }),
  mounted() {
    this.moved = this.views.map((view) => {
      const place = this.$el.appendChild(document.createElement("div"));
      place.className = `twin-view twin-view-${view.view}`;
      return VIEWS[view.view](place, view);
    });
    const names = this.views.flatMap((view) => view.parts.flatMap((part) => Object.values(part.signals)));
    names.push(...this.warnings.map((one) => one.signal));
    this.onTick = (state) => {
      if (!state.values || document.hidden) return;
      const of = (part, name) => (part && part.signals[name] in state.values ? state.values[part.signals[name]] : undefined);
      for (const move of this.moved) move(of, this.reached);
      this.warn(state);
    };
    channel.listeners.add(this.onTick);
    channel.watch(this, [...new Set(names)]);
  },
  unmounted() { channel.listeners.delete(this.onTick); channel.watch(this, []); },
  methods: {
    warn(state) {
      this.warning = this.warnings.filter((one) => Number(state.values[one.signal]) > one.above).map((one) => one.text).join(" · ");
      const now = performance.now();
      if (!this.warning || !channel.operator || state.phase !== "running" || now < (this.felt || 0) + RUMBLE.duration) return;
      this.felt = now;
      for (const pad of navigator.getGamepads?.() || []) pad?.vibrationActuator?.playEffect("dual-rumble", RUMBLE);
    },
  },
};

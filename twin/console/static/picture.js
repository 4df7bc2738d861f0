// Animation of the machine: SVG views, updated with the values of each tick.

import { channel } from "/console/channel.js";
import { rig } from "/console/view_rig.js";
import { bench } from "/console/view_bench.js";
import { vessel } from "/console/view_vessel.js";
import { scene } from "/console/view_scene.js";

const VIEWS = { rig, bench, vessel, scene };

export default {
  template: `<div class="twin-views"></div>`,
  props: { views: Array },
  mounted() {
    this.moved = this.views.map((view) => {
      const place = this.$el.appendChild(document.createElement("div"));
      place.className = `twin-view twin-view-${view.view}`;
      return VIEWS[view.view](place, view);
    });
    const names = this.views.flatMap((view) => view.parts.flatMap((part) => Object.values(part.signals)));
    this.onTick = (state) => {
      if (!state.values || document.hidden) return;
      const of = (part, name) => (part && part.signals[name] in state.values ? state.values[part.signals[name]] : undefined);
      for (const move of this.moved) move(of);
    };
    channel.listeners.add(this.onTick);
    channel.watch(this, [...new Set(names)]);
  },
  unmounted() { channel.listeners.delete(this.onTick); channel.watch(this, []); },
};

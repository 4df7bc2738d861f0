// A page is there: it opens the wire, shows what the server tells, and stops everything at STOP or Esc.

import { channel } from "/console/channel.js";

export default {
  template: `<div><button id="twin-stop" type="button" title="Stop: drives by their one stop path, the session ends. Esc" @click="stop">STOP</button></div>`,
  props: { page: String, attends: Boolean },
  mounted() {
    channel.listeners.add(this.heard);
    addEventListener("keydown", this.key, true);  // first of all: a field that has the focus keeps Esc for itself
    channel.open(this.page);
  },
  unmounted() { channel.listeners.delete(this.heard); removeEventListener("keydown", this.key, true); },
  methods: {
    stop() { channel.send({ stop: true }); },
    key(event) { if (event.code === "Escape") this.stop(); },
    heard(told) {
      if (told.lost) { this.say("no connection to the server", ""); return; }
      if (told.refused) { this.say(null, told.refused); return; }
      if (this.attends && told.attend && channel.operator && !document.hidden) channel.send({ here: true, tick: told.tick });
      const pace = told.achieved === null || told.achieved === undefined ? "" : `${told.achieved.toFixed(told.achieved < 10 ? 2 : 0)} × real time`;
      const late = told.lag > 0.05 ? `, ${told.lag.toFixed(2)} s late` : "";
      this.say(told.phase && told.time !== undefined ? `${told.phase} · ${told.time.toFixed(3)} s${told.phase === "running" ? ` · ${pace}${late}` : ""}` : "", told.message || "");
    },
    say(how, message) {
      const place = document.getElementById("twin-how"), below = document.getElementById("twin-message");
      if (place && how !== null && place.textContent !== how) place.textContent = how;
      if (below && below.textContent !== message) { below.textContent = message; below.title = message; }
    },
  },
};

// Presence of a page: opens the socket, shows the status, has the stop button. Esc stops drives; it never ends a simulation.

import { channel } from "/console/channel.js";

const READ = 10000;  // time for which a message of a simulation is shown [ms]
const EXPIRED = "Release and press again.";  // end of a message on an expired hold, which is also said beside the controls

export default {
  template: `<div><button id="twin-stop" :style="{ visibility: label ? 'visible' : 'hidden' }" type="button" :class="{ 'twin-end': label && label !== 'STOP' }" :title="about" :disabled="!connected || (lost && !silent)"
    @click="stop">{{ label || "STOP" }}</button><p class="twin-disconnected" role="alert" v-if="lost">{{ warning }}</p></div>`,
  props: { page: String, attends: Boolean, hardware: Boolean, stop_label: String },
  data() { return { label: this.stop_label, connected: false, lost: false, silent: false }; },
  watch: { lost(lost) { document.body.classList.toggle("twin-lost", lost); } },
  computed: {
    warning() {
      const what = this.silent ? "No answer from the server" : "Connection lost", reach = this.silent ? "may not" : "does not";
      return `${what}: ${this.hardware ? `STOP ${reach} reach the drives. Use the hardware emergency stop.` : `${this.silent ? "it is busy or has ended" : "the console has ended, or the network is down"}. Values are old.`} Reload this page if it stays.`;
    },
    about() { return this.hardware ? "Stop the drives and end the session (Esc)" : "End the session and keep its results"; },
  },
  mounted() {
    channel.listeners.add(this.update);
    addEventListener("keydown", this.key, true);  // in the capture phase: a focused field consumes Esc
    channel.open(this.page);
  },
  unmounted() { channel.listeners.delete(this.update); removeEventListener("keydown", this.key, true); },
  methods: {
    stop() { if (!channel.send({ stop: true })) channel.lost(); },
    key(event) { if (event.code === "Escape" && this.hardware) this.stop(); },
    update(state) {
      if (state.refused) { this.say(null, state.refused); return; }
      this.lost = Boolean(state.lost);
      this.silent = Boolean(state.silent);
      if (this.lost) { this.say("no connection to the server", ""); return; }
      this.connected = true;
      document.body.classList.toggle("twin-watches", !state.operator);
      this.label = state.stop;
      if (this.attends && channel.operator && !document.hidden) channel.send({ here: true, tick: state.tick });
      const pace = state.achieved === null || state.achieved === undefined ? "" : `${state.achieved.toFixed(state.achieved < 10 ? 2 : 0)} × real time`;
      const lag = state.lag > 0.05 ? `, ${state.lag.toFixed(2)} s behind the wanted pace` : "";
      const writing = /^writing /.test(state.message) ? state.message : "";
      const phase = { finishing: `Ended: ${writing || "writing the results"} ...`, stopped: "ended" }[state.phase] || state.phase;
      this.say(state.phase && state.time !== undefined ? `${phase} · ${state.time.toFixed(state.phase === "running" ? 1 : 3)} s${state.phase === "running" ? ` · ${pace}${lag}` : ""}` : "", writing ? "" : state.message || "");
    },
    say(how, message) {
      const place = document.getElementById("twin-how"), below = document.getElementById("twin-message");
      if (place && how !== null && place.textContent !== how) place.textContent = how;
      const now = performance.now();
      if (message !== this.message) { this.message = message; this.since = now; }
      const isSaid = message.endsWith(EXPIRED) && document.querySelector(".twin-control") !== null;
      const text = this.hardware || (now - this.since < READ && !isSaid) ? message : "";  // of drives it stays
      if (below && below.textContent !== text) below.textContent = text;
    },
  },
};

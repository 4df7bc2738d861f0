// Operator controls. Motion lasts while a control is held: each tick of the server is answered with the held controls, and
// nothing else sustains motion. After a release, in a hidden page or without network there is no answer, and the loop moves
// the input to rest.

import { channel } from "/console/channel.js";

const DROPPED = 10;      // ticks after which a held control that moves nothing counts as stopped
// where keys type; a closed list, which keeps the focus after a choice, is none of these
const TYPED = "input:not(.q-select__focus-target), .q-select__focus-target[aria-expanded=true], textarea, select, [contenteditable]";
const DEVICES = ["stick", "button", "pad"];  // sources of deflections that are no keys
const NEAR = 0.02;       // deflection of a gamepad below which it is at rest

// a key as it is written on a keyboard
export function keyText(key) {
  return key.replace(/^Key|^Digit/, "").replace("Arrow", "").replace(/^(Up|Down|Left|Right)$/, (way) => ({ Up: "↑", Down: "↓", Left: "←", Right: "→" })[way]);
}

class HeldControls {
  constructor(controls) {
    this.controls = new Map(controls.map((one) => [one.name, one]));
    this.held = new Map();   // control -> Map(source -> deflection)
    this.press = new Map();  // control -> number of the press
  }
  // report the deflection of a control by a device; 0 or null: released
  move(name, source, at) {
    const sources = this.held.get(name) || new Map(), before = this.deflection(name);
    at ? sources.set(source, Math.max(-1, Math.min(1, at))) : sources.delete(source);
    this.held.set(name, sources);
    const now = this.deflection(name);
    if (now !== null && before === null) this.press.set(name, Date.now());
    if (now === null && before !== null) channel.send({ release_hold: name });
    if (now !== null) this.renew(name);
    this.onChange?.(name, now);
  }
  deflection(name) {
    const all = [...(this.held.get(name)?.values() || [])];
    return all.length ? all.reduce((a, b) => (Math.abs(b) > Math.abs(a) ? b : a)) : null;
  }
  renew(name) {
    const at = this.deflection(name);
    if (at !== null && channel.operator && !document.hidden) channel.send({ hold: name, at, press: this.press.get(name), tick: channel.tick });
  }
  renewAll() { for (const name of this.held.keys()) this.renew(name); }
  keys() { return [...this.held.values()].flatMap((sources) => [...sources.keys()]).filter((source) => !DEVICES.includes(source)); }
  releaseAll() {
    const any = [...this.held.keys()].some((name) => this.deflection(name) !== null);
    this.held.clear();
    if (any) channel.send({ release_hold: "" });
    for (const name of this.controls.keys()) this.onChange?.(name, null);
  }
}

export default {
  template: `<div class="twin-hands">
    <div class="twin-sticks" v-show="!over">
      <div v-for="stick in sticks" :key="stick.key" class="twin-stick" :class="{ off: !operator }">
        <svg viewBox="-60 -60 120 120" :aria-label="stick.label" role="application" @pointerdown="grab($event, stick)" @pointermove="drag($event, stick)"
             @pointerup="release(stick)" @pointercancel="release(stick)" @lostpointercapture="release(stick)">
          <circle r="52" class="base" />
          <line v-if="stick.x" x1="-44" x2="44" y1="0" y2="0" class="axis" /><line v-if="stick.y" y1="-44" y2="44" x1="0" x2="0" class="axis" />
          <circle r="19" class="knob" :cx="36 * at(stick.x)" :cy="-36 * at(stick.y)" />
        </svg>
        <div class="twin-soft">{{ stick.label }}</div>
      </div>
    </div>
    <div v-for="one in controls" :key="one.name" v-show="!over" class="twin-control" :title="one.about">
      <button type="button" class="way" :disabled="!operator" v-if="one.kind === 'hold'" :aria-label="one.label + ' back'"
              @pointerdown.prevent="push($event, one, -1)" @pointerup="pull(one)" @pointercancel="pull(one)" @lostpointercapture="pull(one)">−</button>
      <span class="name">{{ one.label }} <kbd v-for="key in one.keys.filter(Boolean).reverse()" :key="key">{{ short(key) }}</kbd></span>
      <b class="twin-figures">{{ figure(one) }}</b>
      <button type="button" class="way" :disabled="!operator" :aria-label="one.label" @pointerdown.prevent="push($event, one, 1)"
              @pointerup="pull(one)" @pointercancel="pull(one)" @lostpointercapture="pull(one)">{{ one.kind === "hold" ? "+" : "press" }}</button>
    </div>
    <p v-if="!controls.length && !over" class="twin-soft">Runs by itself: press Run, change values while it runs.</p>
    <p v-else-if="controls.length" :class="stopped || early || idle.length ? 'twin-warn' : 'twin-soft'" role="status">{{ over ? "The session is over: controls have no effect." : !operator ? watching : paused ? "Paused: press Run, then hold a control." : early ? "Held since before Run: release and press again." : stopped ? "Stopped by the dead-man switch. Release and hold again." : idle.length ? "Stopped. Release and hold again." : "Motion lasts while you hold a control." }}</p>
    <p v-if="pad && !over" class="twin-soft">{{ pad }}</p>
  </div>`,
  props: { controls: Array, session: Boolean, space_runs: Boolean },
  data: () => ({ operator: false, watching: "Connecting ...", over: false, paused: false, held: {}, deflections: {}, dropped: 0, early: false, idle: [], pad: "" }),  // idle: keys that are held and move nothing
  computed: {
    stopped() { return this.dropped > DROPPED; },
    sticks() {
      const of = (stick) => this.controls.find((one) => one.stick === stick);
      return [["x", "y"], ["x2", "y2"]].map(([x, y]) => ({ key: x, x: of(x), y: of(y) })).filter((one) => one.x || one.y)
        .map((one) => ({ ...one, label: [one.y?.label, one.x?.label].filter(Boolean).join(" · ") }));
    },
  },
  watch: { over(isOver) { if (isOver) document.querySelector(".twin-desk").scrollIntoView(); } },  // the result is at its top
  mounted() {
    this.hands = new HeldControls(this.controls);
    this.hands.onChange = (name, at) => { this.deflections = { ...this.deflections, [name]: at ?? 0 }; };
    this.onTick = (state) => this.update(state);
    channel.listeners.add(this.onTick);
    this.on = [
      [window, "keydown", (event) => this.key(event, true)], [window, "keyup", (event) => this.key(event, false)],
      [window, "blur", () => { this.hands.releaseAll(); this.idle = []; }], [window, "offline", () => this.hands.releaseAll()],
      [document, "visibilitychange", () => { if (document.hidden) this.hands.releaseAll(); }],
      [document, "freeze", () => this.hands.releaseAll()],
      [document.getElementById("twin-stop"), "click", () => this.hands.releaseAll()],
    ];
    for (const [where, what, does] of this.on) where?.addEventListener(what, does, what === "keydown");
    window.twinHands = this.hands;  // for tests
  },
  unmounted() {
    this.hands.releaseAll();
    channel.listeners.delete(this.onTick);
    for (const [where, what, does] of this.on) where?.removeEventListener(what, does, what === "keydown");
  },
  methods: {
    update(state) {
      if (state.lost) {
        this.operator = false;
        this.watching = `${state.silent ? "No answer from the server" : "No connection to the server"}: controls have no effect.`;
        this.idle = [...new Set([...this.idle, ...this.hands.keys()])];
        this.hands.releaseAll();
        return;
      }
      if (state.refused) return;
      this.over = this.session && ["finishing", "stopped", "failed"].includes(state.phase);
      this.operator = Boolean(state.operator) && !this.over;
      this.watching = state.watching;
      this.paused = state.phase === "paused";
      const held = JSON.stringify(state.held || {});
      if (held !== this.heldText) { this.heldText = held; this.held = state.held || {}; }
      const dropped = this.controls.some((one) => this.deflections[one.name] && !(one.input in this.held));
      this.early = dropped && (this.paused || this.early);  // a press that began while paused moves nothing
      this.dropped = dropped && !this.paused && this.operator && (state.phase || !this.session) ? this.dropped + 1 : 0;
      this.gamepad();
      this.hands.renewAll();
    },
    key(event, down) {
      if (event.code === "Escape") { this.idle = this.hands.keys(); this.hands.releaseAll(); return; }
      if (!down) this.idle = this.idle.filter((code) => code !== event.code);
      if (down && (event.target.closest?.(TYPED) || event.ctrlKey || event.altKey || event.metaKey)) return;
      if (this.runs(event, down)) return;
      for (const one of this.controls) {
        const way = one.keys.indexOf(event.code);
        if (way < 0) continue;
        event.preventDefault();
        event.stopPropagation();  // a slider or a closed list that was used before would change as well
        if (!event.repeat) this.hands.move(one.name, event.code, down ? (way === 0 ? 1 : -1) : 0);
        else if (!this.hands.keys().includes(event.code) && !this.idle.includes(event.code)) this.idle.push(event.code);  // held since before it was released
      }
    },
    // Space presses Run or Pause, without drives only, and not where it presses the focused button
    runs(event, down) {
      if (event.code !== "Space" || !this.space_runs || this.controls.some((one) => one.keys.includes("Space")) || event.target.closest?.("button, a, [role=button]")) return false;
      event.preventDefault();  // the page would scroll
      if (down && !event.repeat) [...document.querySelectorAll(".twin-run[aria-label]")].find((button) => button.checkVisibility())?.click();
      return true;
    },
    // called on every tick: a stick that springs back is a dead-man switch by itself
    gamepad() {
      const pad = [...(navigator.getGamepads?.() || [])].find(Boolean);
      this.pad = pad ? `Gamepad: ${pad.id.replace(/ *\(.*/, "").slice(0, 40)}.` : "";
      for (const one of this.controls) {
        const axis = pad && one.axis !== null ? (pad.axes[one.axis] || 0) * (one.reverse ? -1 : 1) : 0;
        const [up, down] = one.buttons.map((button) => button !== null && button >= 0 && pad?.buttons[button]?.pressed);
        const at = up ? 1 : down ? -1 : Math.abs(axis) > Math.max(one.dead, NEAR) ? axis : 0;
        if (at || this.hands.held.get(one.name)?.has("pad")) this.hands.move(one.name, "pad", at);
      }
    },
    grab(event, stick) { event.preventDefault(); event.currentTarget.setPointerCapture(event.pointerId); this.grabbed = stick.key; this.box = event.currentTarget.getBoundingClientRect(); this.drag(event, stick); },
    drag(event, stick) {
      if (this.grabbed !== stick.key) return;
      const { box } = this, half = box.width * 0.3;  // of the grab: a text that grows above moves the joystick, not the knob in it
      if (stick.x) this.hands.move(stick.x.name, "stick", (event.clientX - box.left - box.width / 2) / half || 1e-6);
      if (stick.y) this.hands.move(stick.y.name, "stick", (box.top + box.height / 2 - event.clientY) / half || 1e-6);
    },
    release(stick) {
      if (this.grabbed !== stick.key) return;
      this.grabbed = null;
      for (const one of [stick.x, stick.y]) if (one) this.hands.move(one.name, "stick", 0);
    },
    push(event, one, way) { event.currentTarget.setPointerCapture(event.pointerId); this.hands.move(one.name, "button", way); },
    pull(one) { if (this.hands.held.get(one.name)?.has("button")) this.hands.move(one.name, "button", 0); },
    at(one) { return one && !this.stopped && !this.early ? this.deflections[one.name] || 0 : 0; },
    short: keyText,
    figure(one) {
      const value = this.held[one.input];
      if (one.kind !== "hold") return value ? "on" : "off";
      return `${value === undefined ? "0" : +(one.factor * value + one.offset).toPrecision(3)} ${one.unit}`;
    },
  },
};

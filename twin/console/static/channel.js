// Web socket of the page: distributes ticks of the server to listeners, and sends held controls. One per page.

const SILENT = 2000;  // time without a tick after which a page says that the server does not answer [ms]
const RENEWED = 6000; // time without a tick after which it opens another socket; the present one stays until then, for STOP [ms]

class Channel {
  constructor() { this.listeners = new Set(); this.watched = new Map(); this.tick = 0; this.operator = false; }

  open(page) {
    if (this.page === page) return;
    this.page = page;
    this.connect();
    // A computer without a network is offline, too, for a server of its own: the page connects again.
    addEventListener("offline", () => { this.drop(); this.reconnect(); });
    addEventListener("online", () => this.connect());
    addEventListener("pagehide", () => { this.closed = true; this.drop(); });
    addEventListener("pageshow", () => { this.closed = false; this.connect(); });
    setInterval(() => {
      if (!this.socket || document.hidden) return;
      const now = performance.now(), open = this.socket.readyState === WebSocket.OPEN;
      if (now - this.seen > SILENT) this.lost(open);
      if (open && now - Math.max(this.seen, this.begun) > RENEWED) this.connect(true);
    }, SILENT / 4);
  }

  connect(again = false) {
    if ((this.socket && !again) || this.closed) return;
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/wire?client=${encodeURIComponent(this.page)}`);
    this.begun = performance.now();
    if (!again) { this.socket = socket; this.seen = this.begun; }
    socket.onopen = () => {
      if (this.closed || (this.socket !== socket && !again)) { socket.close(); return; }
      const before = this.socket;
      this.socket = socket;
      if (before !== socket) before?.close();
      this.subscribed = ""; this.values = {}; this.subscribe(); this.show(this.space);
    };
    socket.onmessage = (event) => {
      if (this.socket !== socket) return;
      const state = JSON.parse(event.data);
      if (state.values && state.run !== this.run) { this.run = state.run; this.values = {}; }  // those of another run
      if (state.values) state.values = Object.assign(this.values, state.values);  // the server sends those that have changed
      if (state.dropped) { location.reload(); return; }
      if (state.tick) { this.tick = state.tick; this.operator = state.operator; this.seen = performance.now(); }
      for (const one of this.listeners) one(state);
    };
    socket.onclose = () => { if (this.socket === socket) { this.socket = null; this.lost(); this.reconnect(); } };
  }

  reconnect() { setTimeout(() => this.connect(), 500); }
  drop() { const socket = this.socket; this.socket = null; socket?.close(); this.lost(); }
  // silent: the socket is open, so that a message may still arrive
  lost(silent = false) { this.operator = false; for (const one of this.listeners) one({ lost: true, silent }); }
  send(message) {
    const open = this.socket?.readyState === WebSocket.OPEN;
    if (open) this.socket.send(JSON.stringify(message));
    return open;
  }

  show(space) { this.space = space ?? null; this.send({ space: this.space }); }  // number of a scene in three dimensions
  watch(who, names) { names.length ? this.watched.set(who, names) : this.watched.delete(who); this.subscribe(); }
  subscribe() {
    const names = [...new Set([...this.watched.values()].flat())], text = names.join();
    if (text !== this.subscribed && this.socket?.readyState === WebSocket.OPEN) { this.subscribed = text; this.send({ watch: names }); }
  }
}

export const channel = new Channel();

// The page of a scene: a player, and its curves with the same cursor of time.

import { Player } from "/scene/player.js";
import { Chart } from "/web/chart.js";
import { unpack } from "/web/scale.js";

const films = JSON.parse(document.getElementById("data").textContent);
const box = document.getElementById("curves");
let shown = null;

const chart = new Chart(box, {
  source: async ({ names }) => {
    const { time, curves, when } = shown, x = unpack(when);
    return { from: time[0], to: time.at(-1), last: time.at(-1), curves: names.map((_, k) => ({ x, y: unpack(curves[k]) })) };
  },
  notify: (event, { a, b }) => { if (event === "cursors" && a !== undefined) player.show(b ?? a); },
});

const player = new Player(document.querySelector(".player"), films, () => Math.max(innerHeight * 0.62, 260), (time, film) => {
  if (film !== shown) {
    shown = film;
    box.hidden = !(film.time.length > 1 && film.curves.length);
    chart.setPanes([{ title: "", unit: film.unit, curves: film.curves.map(({ label, color }) => ({ name: label, label, color })) }]);
  }
  chart.setCursors([time]);
});

addEventListener("keydown", (event) => {
  if (event.target.closest("select, input, button")) return;
  const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (event.key === " ") { event.preventDefault(); player.play(!player.playing); }
  if (step) { player.play(false); player.step(step); }
});

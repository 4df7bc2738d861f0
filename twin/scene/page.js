// The page of a scene: a player, and its curves with the same cursor of time. After player.js.

import { Chart } from "./chart.js";

const films = JSON.parse(document.getElementById("data").textContent);
const box = document.getElementById("curves");
let shown = null;

const chart = new Chart(box, {
  source: async ({ names }) => {
    const { time, curves, when } = shown, x = unpackTrack(when);
    return { from: time[0], to: time.at(-1), last: time.at(-1), curves: names.map((_, k) => ({ x, y: unpackTrack(curves[k]) })) };
  },
  notify: (event, { at }) => { if (event === "time") player.show(at); },
});

const stage = document.querySelector(".player"), highest = () => Math.max(innerHeight * 0.62, 260);
const player = new Player(stage, films.map((data) => new Film(stage.querySelector(".view"), data, highest)), (time, film) => {
  if (film !== shown) {
    shown = film;
    box.hidden = !(film.time.length > 1 && film.curves.length);
    chart.setPanes([{ title: "", unit: film.unit, curves: film.curves.map(({ label, color }) => ({ name: label, label, color })) }]);
  }
  chart.setTime(time);
});

addEventListener("keydown", (event) => {
  if (event.target.closest("select, input, button")) return;
  const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (event.key === " ") { event.preventDefault(); player.play(!player.playing); }
  if (step) { player.play(false); player.step(step); }
});

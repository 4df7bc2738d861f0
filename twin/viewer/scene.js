// One time cursor for the scene and all curves, with playback.

import { drawViews, elementOf } from "./views.js";

const SETTLED = 150; // after the last change of a window, until its values are requested [ms]
let film = null, playing = 0;

// ---- the picture of a case

// a page of one file has the picture of one case
function pictureCase() { return about.embedded ? about.film?.case ?? null : state.scene !== null && state.cases.includes(state.scene) ? state.scene : state.cases[0] ?? null; }

function pictured() {
  clearTimeout(pictured.due);
  pictured.due = setTimeout(load, film ? SETTLED : 0);
}

// read the values of the visible window; the views are drawn anew for another case
async function load() {
  const place = pictureCase(), select = find("pictured");
  const options = (about.embedded ? [place] : state.cases).filter((k) => k !== null).map((k) => element("option", about.cases[k].label, { value: k, selected: k === place }));
  select.replaceChildren(...options);
  select.hidden = state.cases.length < 2;
  if (place === null) { film = null; find("scene").hidden = true; return; }
  const window = windowOf(), wanted = JSON.stringify([place, window, about.cases[place].samples, offset(place)]);
  if (film?.wanted === wanted) return;
  let found;
  try { found = await source.scene(place, window.map((time) => time - offset(place))); } catch { return; }
  if (pictureCase() !== place) return;
  const views = film?.place === place ? film.move : null;
  const isNew = find("scene").hidden && found.views.length > 0;
  find("scene").hidden = !found.views.length;
  if (isNew) find("stage").scrollTop = 0; // the browser stays at the panes, which were there before
  film = { place, wanted, ...found, move: views };
  if (!film.move) {
    find("picture").replaceChildren();
    film.move = drawViews(find("picture"), found.views);
  }
  moved();
}

// move the picture to the time cursor, or to the begin of the window
function moved() {
  if (!film?.times.length || find("scene").hidden) return;
  const at = (state.time ?? windowOf()[0]) - offset(film.place), { times } = film, k = Math.max(before(times, at + 1e-9), 0), next = times[k + 1];
  const part = next > times[k] ? Math.max((at - times[k]) / (next - times[k]), 0) : 0;
  film.move(Object.fromEntries(film.signals.map((signal) => [signal.name, elementOf(instant(signal, k, part), 0, signal.shape)])), [], at);
}

// the values of an instant and a part of the way to the next one; whole numbers may be codes and stay
function instant({ values, shape }, k, part) {
  const size = shape.reduce((a, b) => a * b, 1), [now, later] = [k, k + 1].map((index) => values.subarray(index * size, (index + 1) * size));
  return now.map((value, i) => (part && Number.isFinite(later[i]) && value % 1 ? value + part * (later[i] - value) : value));
}

// ---- the time cursor

function goToTime(at) {
  state.time = chart.time = at;
  if (playing) chart.draw(chart.changed); else chart.redraw(false); // at once: in a frame, curves, scene and values have one time
  placed();
  moved();
  refresh();
  if (!playing) { tabulate(); keep(); }
}

function placed() {
  const [from, to] = windowOf(), at = state.time;
  find("time").value = Math.min(Math.max(at ?? from, from), to);
  find("now").textContent = at === null ? "" : `${readableTime(at, from, to)} s`;
  find("unset").hidden = at === null;
}

function played(from, to) {
  Object.assign(find("time"), { min: from, max: to });
  if (chart) chart.time = state.time;
  placed();
}

function play() {
  const [from, to] = windowOf();
  if (state.time === null || state.time < from || state.time >= to) goToTime(from);
  if (play.unfolds) find("scene").open = true;
  play.unfolds = false;
  let last = performance.now();
  const advance = (now) => {
    const [begin, end] = windowOf(), next = state.time + ((now - last) / 1000) * Number(find("speed").value);
    last = now;
    goToTime(Math.max(Math.min(next, end), begin));
    if (next >= end) pause(); else playing = requestAnimationFrame(advance);
  };
  playing = requestAnimationFrame(advance);
  find("play").ariaLabel = "pause";
}

function pause() {
  if (!playing) return;
  cancelAnimationFrame(playing);
  playing = 0;
  find("play").ariaLabel = "play";
  tabulate();
  keep();
}

find("play").onclick = () => (playing ? pause() : play());
find("time").oninput = () => { pause(); goToTime(Number(find("time").value)); };
find("unset").onclick = () => { pause(); goToTime(null); };
find("pictured").onchange = () => { state.scene = Number(find("pictured").value); pictured(); keep(); };
find("pictured").onclick = (event) => event.preventDefault(); // not the summary

// Player of films with buttons, a slider and the keyboard (player.html). After film.js.
//
//   new Player(root, films, notify)   films: each with time, instant, show(time), draw(), legend(), its element `picture`, fit() if it zooms,
//                                     listen(isShown); notify(time, film): another instant is shown

class Player {
  constructor(root, films, notify) {
    this.find = (name) => root.querySelector(`.${name}:not(.machine *)`); // drawings of machines have classes of their own
    Object.assign(this, { films, notify });
    this.playing = false;
    this.listen();
    this.select(0);
  }

  get moves() { return this.film.time.length > 1; }

  select(number) {
    const time = this.film ? this.clock : this.films[number].time[0];
    this.film = this.films[number];
    this.find("film").value = number;
    for (const film of this.films) film.picture.hidden = true;
    this.film.picture.hidden = false;
    this.find("fit").hidden = !this.film.fit;
    this.find("controls").hidden = !this.moves;
    this.find("time").max = this.film.time.length - 1;
    this.find("tracks").replaceChildren(...this.film.legend());
    this.show(time);
  }

  show(time) {
    const times = this.film.time;
    this.clock = Math.min(Math.max(time, times[0]), times.at(-1));
    this.film.show(this.clock);
    this.find("time").value = this.film.instant;
    const shown = times[this.film.instant]; // the time of what is drawn: a film has fewer instants than the recording
    this.find("now").textContent = `${shown.toFixed(3)} s`;
    this.notify(shown, this.film);
  }

  step(by) { this.show(this.film.time[Math.min(Math.max(this.film.instant + by, 0), this.film.time.length - 1)]); }

  play(isPlaying) {
    const { time } = this.film, isAtEnd = () => this.film.instant === time.length - 1;
    if (isPlaying && isAtEnd()) this.show(time[0]);
    this.playing = isPlaying;
    this.find("play").textContent = isPlaying ? "Pause" : "Play";
    let last = performance.now();
    const tick = (now) => {
      if (!this.playing) return;
      const next = this.clock + (now - last) / 1000 * parseFloat(this.find("speed").value);
      last = now;
      this.show(next);
      if (isAtEnd()) this.play(false); else requestAnimationFrame(tick);
    };
    if (isPlaying) requestAnimationFrame(tick);
  }

  listen() {
    for (const film of this.films) film.listen(() => this.film === film);
    this.find("time").addEventListener("input", (event) => { this.play(false); this.show(this.film.time[+event.target.value]); });
    this.find("play").addEventListener("click", () => this.play(!this.playing));
    this.find("fit").addEventListener("click", () => { this.film.fit(); this.film.draw(); });
    this.find("film").addEventListener("change", (event) => this.select(+event.target.value));
    new ResizeObserver(() => this.film.draw()).observe(this.find("view"));
    new MutationObserver(() => this.film.draw()).observe(document.body, { attributes: true, attributeFilter: ["class"] });
  }
}

// Time: play, pause, slow motion, drag, keys.

const RATES = [1, 1 / 2, 1 / 5, 1 / 10, 1 / 20, 1 / 50, 1 / 100, 1 / 200, 1 / 500];
const MAGNIFICATIONS = [1, 2, 3, 5].flatMap(step => [1, 10, 100, 1000, 1e4].map(power => step * power));
//: Turns a second at which a person sees an exciter turn, and sees it change its speed.
const TURNS = 0.5, TURNS_OF_STARTS = 5;

class Player {
  constructor(runs, machines, curves) {
    this.runs = runs;
    this.machines = machines;
    this.curves = curves;
    this.isPlaying = false;
    this.turn = 1 / (runs[0].turns || 25);
    this.limits = [Math.min(...runs.map(run => run.origin)), Math.max(...runs.map(run => run.end))];
    const wanted = 1.3 * this.turn * (curves.data.transient ? TURNS_OF_STARTS : TURNS);
    this.rate = this.choose("rate", RATES, RATES.find(rate => rate <= wanted) || RATES.at(-1),
      rate => rate === 1 ? "real time" : `1/${Math.round(1 / rate)}`);
    this.magnification = this.choose("magnification", MAGNIFICATIONS.sort((a, b) => a - b),
      Math.min(...machines.map(machine => machine.fitting())), factor => String(factor));
    this.slider = byId("time");
    this.listen();
    this.restrict(curves.view);
    this.seek(this.start);
  }

  // Letters and the cursor have their places again after the page's width has changed.
  fit() {
    for (const machine of this.machines) machine.fitLetters();
    this.curves.point(this.time);
  }

  choose(id, values, first, label) {
    const all = values.includes(first) ? values : [...values, first].sort((a, b) => a - b);
    const box = byId(id);
    box.append(...all.map(value => element("option", {value}, label(value))));
    box.value = String(first);
    box.addEventListener("change", () => { this[id] = Number(box.value); this.seek(this.time); });
    return first;
  }

  // Play what the curves show, as far as the machine moves there.
  restrict([from, to]) {
    [this.start, this.end] = [Math.max(from, this.limits[0]), Math.min(to, this.limits[1])];
    if (!(this.start < this.end)) [this.start, this.end] = this.limits;
    set(this.slider, {min: this.start, max: this.end});
    if (this.time !== undefined && (this.time < this.start || this.time > this.end)) this.seek(this.start);
  }

  seek(t) {
    this.time = Math.min(Math.max(t, this.limits[0]), this.limits[1]);
    for (const machine of this.machines) machine.draw(this.time, this.magnification);
    this.curves.point(this.time);
    this.slider.value = String(this.time);
    byId("clock").textContent = `t = ${this.time.toFixed(4)} s`;
  }

  play(wanted = !this.isPlaying) {
    const button = byId("play");
    this.isPlaying = wanted;
    button.setAttribute("aria-pressed", String(wanted));
    button.textContent = wanted ? "❚❚ Pause" : "▶ Play";
    if (wanted) {
      this.before = performance.now();
      requestAnimationFrame(now => this.frame(now));
    }
  }

  frame(now) {
    if (!this.isPlaying) return;
    const next = this.time + this.rate * Math.min(Math.max(now - this.before, 0), 100) / 1000;
    this.before = now;
    this.seek(next > this.end || next < this.start ? this.start : next);
    requestAnimationFrame(later => this.frame(later));
  }

  listen() {
    byId("play").addEventListener("click", () => this.play());
    this.slider.addEventListener("input", () => { this.play(false); this.seek(Number(this.slider.value)); });
    this.curves.onView.push(view => this.restrict(view));
    document.addEventListener("keydown", event => this.key(event));
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target.closest("select, button, summary, table") || (event.target === this.slider && event.key !== " ")) return;
    const step = event.shiftKey ? this.turn : this.turn / 50;
    const actions = {
      " ": () => this.play(),
      ArrowLeft: () => this.pauseAt(this.time - step),
      ArrowRight: () => this.pauseAt(this.time + step),
      Home: () => this.pauseAt(this.start),
      End: () => this.pauseAt(this.end),
      "+": () => this.faster(-1),
      "-": () => this.faster(1),
    };
    if (!actions[event.key]) return;
    actions[event.key]();
    event.preventDefault();
  }

  pauseAt(t) {
    this.play(false);
    this.seek(t);
  }

  // Go to a time, and show the curves around it.
  visit(t) {
    const [from, to] = this.curves.view, half = 0.5 * (to - from);
    this.pauseAt(t);
    if (t < from || t > to) this.curves.show([t - half, t + half]);
  }

  faster(places) {
    const box = byId("rate");
    box.selectedIndex = Math.min(Math.max(box.selectedIndex + places, 0), box.options.length - 1);
    this.rate = Number(box.value);
  }
}

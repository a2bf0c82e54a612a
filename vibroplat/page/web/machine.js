// Machines that move: turns of a run, or the period of an orbit, over and over. All displacements are magnified alike.

const SECONDS = 2; // in which a person sees a turn
const DEGREES = 180 / Math.PI;

// Whole numbers of 16 bits as parts of a range; 65535 is missing; without any, all are one number.
function opened([low, high, text], count) {
  if (!text) return new Float64Array(count).fill(low);
  const bytes = Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
  return Float64Array.from(new Uint16Array(bytes.buffer), part => part === 65535 ? 0 : low + (high - low) * part / 65534);
}

class Machine {
  constructor(svg, data) {
    this.svg = svg;
    this.data = data;
    this.size = Object.fromEntries(Object.entries(svg.dataset).map(([name, value]) => [name, Number(value)]));
    this.columns = Object.fromEntries(Object.entries(data.columns).map(([name, packed]) => [name, opened(packed, data.frames)]));
    this.largest = Math.max(0, ...(this.columns.contact_force_n ?? []));
    [this.frame, this.moved] = [0, 0]; // the last one drawn, and how far material went in turns before (m)
    this.struck = Math.max(0, ...data.hits.map(([, impulse]) => impulse));
  }

  // The number of the turn at a time.
  at(t) {
    const after = this.data.windows.findIndex(([begin]) => begin > t + 1e-9);
    return (after < 0 ? this.data.windows.length : Math.max(after, 1)) - 1;
  }

  // Draw a part of a turn; one that is played over and over ends where it begins.
  draw(number, share) {
    const [, , first, count] = this.data.windows[number], frame = first + share * count, before = Math.floor(frame);
    const after = before + 1 < first + count || number + 1 < this.data.windows.length ? before + 1 : first;
    const value = (name, turn = 0) => {
      const values = this.columns[name];
      if (!values) return 0;
      const change = values[after] - values[before];
      return values[before] + (frame - before) * (change - (turn && turn * Math.round(change / turn)));
    };
    const k = this.data.k * this.size.scale, turned = this.data.k * value("phi_rad");
    const [dx, dy, gap, upper] = ["x_m", "y_m", "gap_m", "upper_m"].map(name => k * value(name));
    this.put(".body", `translate(${dx} ${-dy}) rotate(${-turned * DEGREES})`);
    this.svg.querySelectorAll(".arm").forEach((arm, place) => arm.setAttribute("transform",
      `rotate(${(turned - value(`phi${place + 1}_rad`, 2 * Math.PI)) * DEGREES})`));
    this.put(".lower", `translate(0 ${-gap})`);
    this.put(".upper", `translate(0 ${-Math.max(gap + upper, gap + 3 - this.size.between)})`);
    for (const coil of this.svg.querySelectorAll(".between")) coil.setAttribute("transform",
      `translate(${coil.dataset.at} ${-coil.parentNode.dataset.base}) scale(1 ${Math.max(this.size.between + upper, 3) / this.size.between})`);
    this.springs(dx, dy, turned);
    this.grains(frame, first, first + count - 1);
    this.signs(value("contact_force_n"), frame, count);
  }

  // Material along the deck: a turn that is played again goes on where it ended.
  grains(frame, first, last) {
    const values = this.columns.along_m, {grain, bed} = this.size, k = this.data.k * this.size.scale;
    if (!values) return;
    const end = 2 * values[last] - values[Math.max(last - 1, first)], before = Math.floor(frame);
    if (frame < this.frame) this.moved += end;
    this.frame = frame;
    const after = before < last ? values[before + 1] : end;
    const moved = k * (this.moved + values[before] + (frame - before) * (after - values[before]));
    const begin = ((moved + 0.5 * grain) % grain + grain) % grain;
    for (const dots of this.svg.querySelectorAll(".grains")) {
      const places = Array.from({length: Math.ceil((2 * bed - begin) / grain)}, (_, n) => begin - bed + n * grain);
      dots.setAttribute("d", places.map(x => `M${x.toFixed(2)} ${dots.dataset.at}h0`).join(""));
    }
  }

  put(which, transform) { for (const part of this.svg.querySelectorAll(which)) part.setAttribute("transform", transform); }

  springs(dx, dy, turned) {
    const {angle, floor} = this.size, [cosine, sine] = [Math.cos(angle), Math.sin(angle)];
    const upright = (x, y) => [x * cosine + y * sine, y * cosine - x * sine];
    for (const spring of this.svg.querySelectorAll(".spring")) {
      const [x, y, length] = ["x", "y", "length"].map(name => Number(spring.dataset[name])), [foot] = upright(x, y);
      const [to, high] = upright(dx + x * Math.cos(turned) - y * Math.sin(turned), dy + x * Math.sin(turned) + y * Math.cos(turned));
      spring.setAttribute("transform", `matrix(1 0 ${-(to - foot) / length} ${(high - floor) / length} ${foot} ${-floor})`);
    }
  }

  // The force of contact as an arrow, and a flash for a tenth of a turn after an impact.
  signs(force, frame, count) {
    const arrow = this.svg.querySelector(".force"), flash = this.svg.querySelector(".flash");
    const length = this.largest > 0 ? this.size.arrow * force / this.largest : 0;
    arrow.setAttribute("visibility", length > 1 ? "visible" : "hidden");
    arrow.querySelector(".shaft").setAttribute("d", `M0 0V${-length}`);
    arrow.querySelector(".head").setAttribute("transform", `translate(0 ${-length})`);
    const turn = count / this.data.turns, age = hit => ((frame - hit) % this.data.frames + this.data.frames) % this.data.frames;
    const last = this.data.hits.find(([hit]) => age(hit) < 0.12 * turn);
    flash.setAttribute("visibility", last ? "visible" : "hidden");
    if (last) flash.setAttribute("opacity", Math.max(0.2, (1 - age(last[0]) / (0.15 * turn)) * Math.min(1, 0.4 + last[1] / this.struck)));
  }
}

const calm = matchMedia("(prefers-reduced-motion: reduce)").matches;

// Plays machines side by side, turn after turn of the whole run or one of them over and over.
class Player {
  constructor(box, machines) {
    Object.assign(this, {box, machines, number: machines[0].data.windows.length - 1, share: 0, whole: false});
    this.button = box.querySelector(".play");
    this.slider = box.querySelector("input");
    this.button.onclick = () => this.play(!this.on);
    if (this.slider) this.slider.oninput = () => { this.whole = false; this.go(Number(this.slider.value)); };
    const whole = box.querySelector(".whole");
    if (whole) whole.onclick = () => { this.whole = true; this.go(0); this.play(true); };
    this.go(this.number);
    this.play(!calm);
  }

  get windows() { return this.machines[0].data.windows; }

  go(number) {
    [this.number, this.share] = [number, 0];
    if (this.slider) this.slider.value = number;
    const [begin, seconds] = this.windows[number], last = number === this.windows.length - 1;
    const turns = last ? this.machines[0].data.turns : 1, slowed = turns * SECONDS / seconds;
    this.lasts = turns * SECONDS / (this.whole ? 2 : 1);
    const clock = this.box.querySelector(".clock");
    if (clock) clock.textContent = `t = ${begin.toPrecision(3)} s, slowed ${Math.round(slowed / (this.whole ? 2 : 1))} times`;
    this.draw();
  }

  draw() {
    const [begin, seconds] = this.windows[this.number];
    for (const machine of this.machines) machine.draw(machine === this.machines[0] ? this.number :
      this.number === this.windows.length - 1 ? machine.data.windows.length - 1 : machine.at(begin + 0.5 * seconds), this.share);
    this.onDraw?.(this.share);
  }

  play(on) {
    const begins = on && !this.on;
    this.on = on;
    this.button.textContent = on ? "Pause" : "Play";
    this.button.setAttribute("aria-pressed", String(on));
    this.before = performance.now();
    if (begins) requestAnimationFrame(now => this.frame(now));
  }

  frame(now) {
    if (!this.on) return;
    this.share += Math.min(Math.max(now - this.before, 0), 100) / 1000 / this.lasts;
    this.before = now;
    if (this.share >= 1 && this.whole && this.number < this.windows.length - 1) this.go(this.number + 1);
    else if (this.share >= 1) [this.share, this.whole] = [this.share % 1, false];
    this.draw();
    requestAnimationFrame(later => this.frame(later));
  }
}

for (const box of document.querySelectorAll("#machines")) {
  const data = JSON.parse(document.getElementById("frames").textContent);
  window.player = new Player(box, [...box.querySelectorAll("svg.machine")].map((svg, number) => new Machine(svg, data[number])));
}

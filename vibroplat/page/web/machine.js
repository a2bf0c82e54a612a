// The machine, drawn in units of which half the platform's width has a hundred.

const HALF = 100, SPRING = 58, LAYER_SPRING = 26, FORCE_LENGTH = 62, ROOM = 22;
const INK = "#333", STEEL = "#c9d3dc", GROUND = "#777", LOWER = "#E9C46A", UPPER = "#F1DCA7", FORCE = "#B2182B";
const EXCITER = [COLOURS[0], COLOURS[1]];

class Machine {
  constructor(run, largest) {
    this.run = run;
    this.largest = largest;
    const {axes, radii} = run.machine, reach = (place, share) =>
      Math.max(...axes.map((axis, number) => place(axis) + share * radii[number]));
    this.scale = HALF / Math.max(reach(([x]) => Math.abs(x), 1.25), 1e-6);
    this.axes = axes.map(axis => axis.map(one => one * this.scale));
    this.radii = radii.map(one => one * this.scale);
    this.top = Math.max(reach(([, y]) => y, 1) * this.scale, 0) + 13;
    this.bottom = Math.min(-reach(([, y]) => -y, 1) * this.scale - 17, -14);
    this.floor = this.bottom - SPRING - ROOM;
    this.build();
  }

  // The magnification with which the largest displacement has the room it needs, a round number.
  fitting() {
    const most = name => (this.run.columns[name] || []).reduce((size, value) => Math.max(size, Math.abs(value)), 0);
    const needs = [most("x_m"), most("y_m"), 0.7 * most("gap_m"), most("upper_m"), most("phi_rad") * HALF / this.scale];
    const free = ROOM / this.scale / Math.max(...needs, 1e-12);
    const power = 10 ** Math.floor(Math.log10(free));
    return power * [5, 3, 2, 1].find(step => step * power <= free * 1.0001);
  }

  build() {
    const {layers, lower_share: share} = this.run.machine;
    this.heights = layers === 2 ? [10 + 14 * share, 10 + 14 * (1 - share)] : [layers ? 22 : 0, 0];
    const stack = this.heights[0] + this.heights[1] + (layers === 2 ? LAYER_SPRING : 0);
    const above = this.top + (layers ? 2.4 : 1) * ROOM + stack + 12;
    this.svg = drawn("svg", {viewBox: `-160 ${-above} 344 ${above - this.floor + 12}`, role: "img",
      "aria-label": `Drawing of the machine: ${this.run.label}`});
    this.ground();
    this.springs = [[-72, 1], [72, 1]].map(([x]) => ({x, line: this.stroke(this.svg, 1.6)}));
    this.dampers = [-46, 46].map(x => ({x, rod: this.stroke(this.svg, 1.6), cup: this.stroke(this.svg, 1.6)}));
    this.side = this.stroke(this.svg, 1.6);
    this.body = drawn("g", {}, this.svg);
    drawn("rect", {x: -HALF, y: -this.top, width: 2 * HALF, height: this.top - this.bottom, rx: 5, fill: STEEL,
      stroke: INK, "stroke-width": 1.4}, this.body);
    drawn("path", {d: "M-5 0H5M0 -5V5", stroke: INK, "stroke-width": 1.2}, this.body);
    drawn("circle", {r: 3.2, fill: "none", stroke: INK, "stroke-width": 1.2}, this.body);
    this.exciters = [0, 1].map(number => this.exciter(number));
    this.layers();
    this.flash = this.burst();
    this.force = this.arrow();
    this.label = drawn("text", {x: -154, y: -above + 13, class: "mode"}, this.svg);
  }

  stroke(parent, width) {
    return drawn("path", {fill: "none", stroke: INK, "stroke-width": width, "stroke-linejoin": "round"}, parent);
  }

  ground() {
    const y = -this.floor;
    let hatch = "";
    for (let x = -90; x <= 90; x += 9) hatch += `M${x} ${y}l-6 7`;
    for (let up = -12; up <= 16; up += 7) hatch += `M-148 ${-up}l-7 6`;
    drawn("path", {d: `M-96 ${y}H96M-148 -18V18${hatch}`, stroke: GROUND, "stroke-width": 1.3, fill: "none"}, this.svg);
  }

  exciter(number) {
    const group = drawn("g", {}, this.svg), radius = this.radii[number], colour = EXCITER[number];
    drawn("circle", {r: radius, fill: "#fff", "fill-opacity": 0.75, stroke: colour, "stroke-dasharray": "3 3"}, group);
    const turn = this.run.machine.directions[number], inner = 0.55 * radius;
    const [x, y] = [inner * Math.cos(0.9), inner * Math.sin(0.9)];
    drawn("path", {d: `M${-x} ${-y}A${inner} ${inner} 0 0 1 ${x} ${-y}`, fill: "none", stroke: "#999",
      "stroke-width": 1.1}, group);
    drawn("path", {d: "M-4 -3L1.5 0L-4 3", fill: "none", stroke: "#999", "stroke-width": 1.1,
      transform: turn < 0 ? `translate(${x} ${-y}) rotate(50)` : `translate(${-x} ${-y}) rotate(130)`}, group);
    const arm = drawn("g", {}, group);
    drawn("line", {x2: radius, stroke: colour, "stroke-width": 2.4}, arm);
    drawn("circle", {cx: radius, r: 6.5, fill: colour, stroke: "#fff", "stroke-width": 1}, arm);
    drawn("circle", {r: 3, fill: INK}, group);
    drawn("text", {y: radius + 11.5, class: "small", "text-anchor": "middle", fill: colour}, group).textContent =
      String(number + 1);
    return {group, arm};
  }

  layers() {
    const slab = (height, fill) => drawn("rect", {x: -78, y: -this.top - height, width: 156, height, rx: 2, fill,
      stroke: INK, "stroke-width": 1.2}, this.svg);
    const [lower, upper] = this.heights;
    this.between = upper ? [-52, 0, 52].map(x => ({x, line: this.stroke(this.svg, 1.2)})) : [];
    this.lower = lower ? slab(lower, LOWER) : null;
    this.upper = upper ? slab(upper, UPPER) : null;
    this.gap = drawn("g", {}, this.svg);
    this.gapLine = drawn("path", {stroke: INK, "stroke-width": 1, fill: "none"}, this.gap);
    this.gapText = drawn("text", {x: 99, class: "small"}, this.gap);
  }

  burst() {
    const group = drawn("g", {visibility: "hidden"}, this.svg);
    let path = "";
    for (let ray = 0; ray < 28; ray++) {
      const angle = Math.PI * ray / 14, size = ray % 2 ? 0.62 : 1;
      path += `${ray ? "L" : "M"}${(102 * size * Math.cos(angle)).toFixed(1)} ${(13 * size * Math.sin(angle)).toFixed(1)}`;
    }
    drawn("path", {d: `${path}Z`, fill: "#FFD400", stroke: "#7a5b00", "stroke-width": 1}, group);
    const text = drawn("text", {x: 106, y: 17, class: "small strong halo"}, group);
    return {group, text};
  }

  arrow() {
    const group = drawn("g", {visibility: "hidden"}, this.svg);
    const back = drawn("path", {stroke: "#fff", "stroke-width": 7, "stroke-linecap": "round"}, group);
    const line = drawn("path", {stroke: FORCE, "stroke-width": 3.6}, group);
    const head = drawn("path", {d: "M-6.5 2L0 -10L6.5 2Z", fill: FORCE, stroke: "#fff", "stroke-width": 0.8}, group);
    const text = drawn("text", {x: 10, class: "small strong halo", fill: FORCE}, group);
    return {group, back, line, head, text};
  }

  // Where a point of the platform is.
  moved(x, y) {
    const [dx, dy, turned] = this.pose;
    return [dx + x * Math.cos(turned) - y * Math.sin(turned), dy + x * Math.sin(turned) + y * Math.cos(turned)];
  }

  // Letters have the same size on every screen, unless the drawing is very small.
  fitLetters() {
    const matrix = this.svg.getScreenCTM();
    if (matrix?.a) this.svg.style.setProperty("--pixel", Math.min(1 / matrix.a, 1.2));
  }

  draw(t, magnification) {
    const inside = Math.min(Math.max(t, this.run.origin), this.run.end), k = magnification * this.scale;
    const value = (name, turn) => valueAt(this.run, name, inside, turn) ?? 0;
    this.pose = [k * value("x_m"), k * value("y_m"), magnification * value("phi_rad")];
    const [dx, dy, turned] = this.pose, carried = `translate(${dx} ${-dy}) rotate(${-turned * 180 / Math.PI})`;
    set(this.body, {transform: carried});
    this.drawSprings();
    this.exciters.forEach(({group, arm}, number) => {
      const [x, y] = this.moved(...this.axes[number]);
      set(group, {transform: `translate(${x} ${-y})`});
      set(arm, {transform: `rotate(${-value(`phi${number + 1}_rad`, 2 * Math.PI) * 180 / Math.PI})`});
    });
    if (this.lower) this.drawMaterial(carried, k * value("gap_m"), k * value("upper_m"), value("gap_m"));
    this.drawForce(carried, value("contact_force_n"));
    this.drawFlash(carried, inside);
    this.drawLabel(t, inside);
  }

  drawSprings() {
    for (const {x, line} of this.springs) set(line, {d: coil([x, this.floor], this.moved(x, this.bottom), 7, 7)});
    set(this.side, {d: coil([-148, 0], this.moved(-HALF, 0), 6, 6)});
    for (const {x, rod, cup} of this.dampers) {
      const [end, high] = this.moved(x, this.bottom), middle = this.floor + 0.42 * (SPRING + ROOM);
      set(rod, {d: `M${end} ${-high}L${x} ${-middle}M${x - 6} ${-middle}H${x + 6}`});
      set(cup, {d: `M${x - 8} ${-middle - 16}V${-middle + 12}H${x + 8}V${-middle - 16}M${x} ${-middle + 12}V${-this.floor}`});
    }
  }

  drawMaterial(carried, gap, upper, metres) {
    const [height] = this.heights, base = this.top + gap + height;
    const lift = Math.max(gap + LAYER_SPRING + upper, gap + 3);
    set(this.lower, {transform: `${carried} translate(0 ${-gap})`});
    if (this.upper) set(this.upper, {transform: `${carried} translate(0 ${-lift - height})`});
    for (const {x, line} of this.between) {
      set(line, {d: coil([x, base], [x, this.top + lift + height], 4, 5), transform: carried});
    }
    set(this.gap, {visibility: gap > 1.5 ? "visible" : "hidden", transform: carried});
    set(this.gapLine, {d: `M81 ${-this.top}H95M81 ${-this.top - gap}H95M90 ${-this.top}V${-this.top - gap}`});
    set(this.gapText, {y: -this.top - 0.5 * gap + 3.5});
    this.gapText.textContent = `${(1e3 * metres).toFixed(2)} mm`;
  }

  drawForce(carried, force) {
    const length = this.largest > 0 ? FORCE_LENGTH * force / this.largest : 0, {group, back, line, head, text} = this.force;
    set(group, {visibility: length > 1 ? "visible" : "hidden", transform: `${carried} translate(-26 ${-this.top})`});
    for (const path of [back, line]) set(path, {d: `M0 0V${-length}`});
    set(head, {transform: `translate(0 ${-length})`});
    set(text, {y: -length - 2});
    text.textContent = `${force.toFixed(force < 10 ? 1 : 0)} N`;
  }

  // An impact flashes for a tenth of a turn.
  drawFlash(carried, t) {
    const {impacts, turns} = this.run, {group, text} = this.flash;
    const last = impacts[place(impacts.map(([time]) => time), t + 1e-12) - 1];
    const age = last ? (t - last[0]) * (turns || 25) : 1;
    set(group, {visibility: age < 0.12 ? "visible" : "hidden", opacity: Math.max(0, 1 - 0.8 * age / 0.12),
      transform: `${carried} translate(0 ${-this.top})`});
    if (last) text.textContent = `${shown(last[1], 2)} N·s`;
  }

  drawLabel(t, inside) {
    const initial = this.run.modes[Math.max(place(this.run.t, inside) - (inside > this.run.origin ? 1 : 0), 0)];
    const mode = {a: "attached", f: "flight", b: ""}[initial] ?? "";
    this.label.textContent = t === inside ? mode : "outside its interval";
    set(this.svg, {opacity: t === inside ? 1 : 0.35});
  }
}

// A spring between two points.
function coil([x1, y1], [x2, y2], turns, width) {
  const length = Math.hypot(x2 - x1, y2 - y1) || 1, along = [(x2 - x1) / length, (y2 - y1) / length];
  const end = Math.min(7, 0.15 * length), step = (length - 2 * end) / (2 * turns);
  const at = (distance, aside) => `${(x1 + along[0] * distance - along[1] * aside).toFixed(2)} ` +
    `${(-(y1 + along[1] * distance + along[0] * aside)).toFixed(2)}`;
  let path = `M${at(0, 0)}L${at(end, 0)}`;
  for (let half = 0; half < 2 * turns; half++) path += `L${at(end + (half + 0.5) * step, half % 2 ? -width : width)}`;
  return `${path}L${at(length - end, 0)}L${at(length, 0)}`;
}

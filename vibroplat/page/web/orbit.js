// The orbit of a point: the machine that moves through it, the platform's speed over its height, the gap over the phase.

//: Seconds in which a person sees a turn of the exciters.
const TURN_SHOWN = 2;
const ORBIT_PLOT = 190;

// Whole numbers of 16 bits as parts of a range; 65535 is missing.
function parts([low, high, text]) {
  const bytes = Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
  return Float64Array.from(new Uint16Array(bytes.buffer), part => part === 65535 ? NaN : low + (high - low) * part / 65534);
}

// An orbit as a run of one period. What struck at its end still flashes when it begins again.
function openedOrbit(motions, place) {
  const packed = motions.list[place];
  const columns = Object.fromEntries(Object.entries(packed.columns).map(([name, found]) => [name, parts(found)]));
  const before = packed.impacts.map(([t, impulse]) => [t - packed.end, impulse]);
  return {...packed, columns, t: columns.t_s, origin: 0, machine: motions.machines[packed.machine], label: "orbit",
    speed: packed.turns / packed.end, turns: packed.turns / packed.end, period: packed.turns,
    impacts: [...before, ...packed.impacts]};
}

// A line of samples that is broken where two have one time, and the jumps between these.
function withJumps(t, x, y) {
  const line = {x: [], y: []}, jumps = {x: [], y: []};
  t.forEach((time, row) => {
    if (row && time === t[row - 1]) {
      add(line, null, null);
      for (const at of [row - 1, row]) add(jumps, x[at], y[at]);
      add(jumps, null, null);
    }
    add(line, x[row], y[row]);
  });
  return [line, jumps];
}

class OrbitView {
  constructor(motions, number) {
    this.motions = motions;
    this.isPlaying = false;
    this.heading = element("p", {class: "hint"});
    this.drawing = element("figure");
    this.button = element("button", {type: "button", class: "play"}, "▶ Play");
    this.slider = element("input", {type: "range", step: "any", min: 0, value: 0, "aria-label": "phase of exciter 1 (turns)"});
    this.note = element("p", {class: "hint"});
    this.plot = element("div", {class: "figure", id: `orbit-${number}`});
    this.dots = [1, 2].map(() => element("div", {class: "dot", "aria-hidden": "true"})); // quicker than Plotly's points
    this.box = element("div", {class: "orbit"}, this.heading, this.drawing,
      element("div", {class: "screen buttons"}, this.button, this.slider), this.note, this.plot);
    this.button.addEventListener("click", () => this.play());
    this.slider.addEventListener("input", () => { this.play(false); this.seek(Number(this.slider.value) / this.run.speed); });
  }

  // Show an orbit; what is told above it says whose it is.
  async show(place, text) {
    [this.run, this.time] = [openedOrbit(this.motions, place), 0];
    const force = (this.run.columns.contact_force_n || []).reduce((size, value) => Math.max(size, value || 0), 0);
    this.machine = new Machine(this.run, force);
    this.magnification = this.machine.fitting();
    this.heading.textContent = text;
    this.drawing.replaceChildren(this.machine.svg);
    set(this.slider, {max: this.run.period});
    const turns = this.run.period === 1 ? "1 turn" : `${this.run.period} turns`;
    this.note.textContent = `Period ${shown(1e3 * this.run.end, 4)} ms, ${turns} of exciter 1. Displacements × ` +
      `${this.magnification}; played at 1/${Math.round(TURN_SHOWN * this.run.speed)} of real time.`;
    await this.draw();
    this.machine.fitLetters();
    this.seek(0);
  }

  async draw() {
    const {t, columns, speed} = this.run, hasGap = "gap_m" in columns, mm = values => Array.from(values, value => 1e3 * value);
    const turns = Array.from(t, time => time * speed), height = (hasGap ? 2 : 1) * ORBIT_PLOT + 70, part = hasGap ? 0.56 : 0;
    const range = values => { // with a margin, in which lines at the edge are seen whole
      const known = Array.from(values).filter(value => !Number.isNaN(value)), [low, high] = [Math.min(...known), Math.max(...known)];
      const more = 0.06 * (high - low) || 1e-3 * Math.abs(high) || 1;
      return [low - more, high + more];
    };
    const axis = {gridcolor: "#eee", zerolinecolor: "#ccc", nticks: 6, exponentformat: "power"};
    const layout = {height, margin: {l: 52, r: 8, t: 8, b: 40}, font: {...FONT, size: 11}, showlegend: false,
      hovermode: "closest", plot_bgcolor: "#fff", dragmode: "zoom",
      xaxis: {...axis, title: {text: "y from rest (mm)", standoff: 4}, anchor: "y", range: range(mm(columns.y_m))},
      yaxis: {...axis, title: {text: "ẏ (m/s)", standoff: 4}, domain: [part, 1], anchor: "x", range: range(columns.y_rate_m_per_s)}};
    const traces = this.lines(t, mm(columns.y_m), columns.y_rate_m_per_s, COLOURS[0], {});
    if (hasGap) {
      layout.xaxis2 = {...axis, title: {text: "phase of exciter 1 (turns)", standoff: 4}, anchor: "y2", domain: [0, 1],
        range: [0, this.run.period]};
      const largest = Math.max(0, ...mm(columns.gap_m).filter(value => !Number.isNaN(value)));
      layout.yaxis2 = {...axis, title: {text: "gap (mm)", standoff: 4}, domain: [0, part - 0.16], anchor: "x2",
        range: [-0.04 * (largest || 1), 1.08 * (largest || 1)]};
      if (!largest) layout.annotations = [{text: "always in contact", xref: "x2 domain", yref: "y2 domain", x: 0.5, y: 0.5,
        showarrow: false}];
      traces.push(...this.lines(turns, turns, mm(columns.gap_m), COLOURS[1], {xaxis: "x2", yaxis: "y2"}));
    }
    const isFirst = !this.plot.data;
    await figure(this.plot, traces, layout, {...CONFIG, displayModeBar: false});
    this.plot.append(...this.dots);
    if (isFirst) this.plot.on("plotly_afterplot", () => this.seek(this.time));
  }

  // A curve and its jumps.
  lines(t, x, y, colour, place) {
    const [line, jumps] = withJumps(t, x, y), look = {...place, type: "scatter", mode: "lines", connectgaps: false};
    return [
      {...look, ...line, line: {color: colour, width: 1.6, shape: "spline"}, hovertemplate: "%{x:.4g}, %{y:.4g}<extra></extra>"},
      {...look, ...jumps, line: {color: colour, width: 1.2, dash: "dot"}, hoverinfo: "skip"},
    ];
  }

  seek(t) {
    const {run} = this, value = name => valueAt(run, name, t);
    this.time = t;
    this.machine.draw(t, this.magnification);
    this.slider.value = String(t * run.speed);
    this.point(this.dots[0], "", 1e3 * value("y_m"), value("y_rate_m_per_s"));
    this.point(this.dots[1], "2", t * run.speed, 1e3 * value("gap_m"));
  }

  // Put a dot onto its curve, or hide it where it has none or lies outside.
  point(dot, number, x, y) {
    const {[`xaxis${number}`]: across, [`yaxis${number}`]: up} = this.plot._fullLayout;
    const [left, top] = across ? [across.l2p(x), up.l2p(y)] : [-1, -1];
    dot.hidden = !(across && left >= 0 && left <= across._length && top >= 0 && top <= up._length);
    if (!dot.hidden) dot.style.transform = `translate(${across._offset + left}px, ${up._offset + top}px)`;
  }

  play(wanted = !this.isPlaying) {
    const begins = wanted && !this.isPlaying;
    this.isPlaying = wanted;
    this.button.setAttribute("aria-pressed", String(wanted));
    this.button.textContent = wanted ? "❚❚ Pause" : "▶ Play";
    if (begins) {
      this.before = performance.now();
      requestAnimationFrame(now => this.frame(now));
    }
  }

  frame(now) {
    if (!this.isPlaying) return;
    const passed = Math.min(Math.max(now - this.before, 0), 100) / 1000;
    this.before = now;
    this.seek((this.time + passed / (TURN_SHOWN * this.run.speed)) % this.run.end);
    requestAnimationFrame(later => this.frame(later));
  }
}

// Curves over time in panels that share their time axis and a cursor.

const BUCKETS = 900;
const PANEL = 92, LEFT = 58, RIGHT = 10, BOTTOM = 40;
// Phases are drawn from −π/2 to 3π/2, so that 0 and π are well inside; their values are told in (−π, π] as in the tables.
const PHASE_TICKS = {tickvals: [0, Math.PI / 2, Math.PI, 3 * Math.PI / 2], ticktext: ["0", "π/2", "±π", "−π/2"],
  range: [-Math.PI / 2 - 0.1, 3 * Math.PI / 2 + 0.45]}; // room for the highest tick's label below the heading
// As wide as any value of a heading.
const WIDEST = "−0.000000";
const CONFIG = {responsive: true, displaylogo: false, displayModeBar: window.innerWidth > 700 ? "hover" : false,
  modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"]};

// What is π but for the rounding of 32-bit floats stays π.
const principal = phase => phase - 2 * Math.PI * Math.ceil((phase - Math.PI - 1e-5) / (2 * Math.PI));
const floats = text => new Float32Array(Uint8Array.from(atob(text), letter => letter.charCodeAt(0)).buffer);

// A run with its packed numbers opened.
function opened(run) {
  const columns = {};
  for (const [name, text] of Object.entries(run.columns)) columns[name] = floats(text);
  const coarse = {};
  for (const [name, {t, values}] of Object.entries(run.coarse || {})) {
    coarse[name] = {t: Float64Array.from(floats(t), value => value + run.first), values: floats(values)};
  }
  const t = Float64Array.from(columns.t_s, value => value + run.origin);
  return {...run, t, columns, coarse, isWhole: run.coarse === null};
}

// The number of the first time that is at least t.
function place(times, t) {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < t) low = middle + 1; else high = middle;
  }
  return low;
}

// A value between rows; angles take the shorter way.
function valueAt(run, name, t, turn = 0) {
  const values = run.columns[name];
  if (!values) return null;
  const after = Math.min(Math.max(place(run.t, t), 1), run.t.length - 1);
  const span = run.t[after] - run.t[after - 1];
  const share = span > 0 ? Math.min(Math.max((t - run.t[after - 1]) / span, 0), 1) : 1;
  let change = values[after] - values[after - 1];
  if (turn) change -= turn * Math.round(change / turn);
  return values[after - 1] + share * change;
}

// The points of a curve in an interval: all of them, or the extremes of many small pieces.
function points(run, {column, factor}, [from, to], buckets = BUCKETS) {
  const isFine = run.isWhole || (from >= run.origin && to <= run.end);
  const source = isFine ? {t: run.t, values: run.columns[column]} : run.coarse[column];
  const found = {x: [], y: []};
  if (!source || !source.values) return found;
  const first = Math.max(place(source.t, from) - 1, 0), after = Math.min(place(source.t, to) + 1, source.t.length);
  const step = Math.max(1, Math.floor((after - first) / buckets));
  let before = null;
  for (let start = first; start < after; start += step) {
    for (const row of step < 3 ? range(start, Math.min(start + step, after)) :
      extremes(source.values, start, Math.min(start + step, after))) {
      const value = source.values[row] * factor;
      if (column === "phase" && before !== null && Math.abs(value - before) > Math.PI) add(found, source.t[row], null);
      add(found, source.t[row], Number.isNaN(value) ? null : value);
      before = value;
    }
  }
  return found;
}

function add(found, x, y) { found.x.push(x); found.y.push(y); }
const range = (from, to) => Array.from({length: to - from}, (_, number) => from + number);

function extremes(values, from, to) {
  let least = from, largest = from;
  for (let row = from; row < to; row++) {
    if (values[row] < values[least]) least = row;
    if (values[row] > values[largest]) largest = row;
  }
  return least < largest ? [least, largest] : largest < least ? [largest, least] : [least];
}

class Curves {
  // onTime is called with a time that a person has pointed at.
  constructor(data, runs, onTime) {
    this.data = data;
    this.runs = runs;
    this.box = byId("curves");
    this.whole = [Math.min(...runs.map(run => run.first)), Math.max(...runs.map(run => run.last))];
    this.view = data.transient ? this.moving() : this.lastTurns();
    this.onTime = onTime;
    this.onView = [];
    this.curves = data.panels.flatMap((panel, number) => panel.curves.flatMap((curve, place) =>
      runs.filter(run => run.columns[curve.column]).map(run => ({...curve, run, panel: number, place}))));
  }

  // Where all machines have samples to move through.
  moving() {
    const from = Math.max(...this.runs.map(run => run.origin)), to = Math.min(...this.runs.map(run => run.end));
    return from < to ? [from, to] : this.whole;
  }

  lastTurns() {
    const last = this.runs.map(run => run.turns ? this.data.turns / run.turns : run.end - run.origin);
    const ends = this.runs.map(run => run.end), starts = this.runs.map(run => run.origin);
    const end = Math.min(...ends) > Math.max(...starts) ? Math.min(...ends) : Math.max(...ends);
    return [Math.max(this.whole[0], end - Math.max(...last)), end];
  }

  // Colours tell results apart, dashes the curves of a panel; where a result has one curve, its dash is its own as well.
  style({run, panel, place}) {
    const several = this.runs.length > 1, isAlone = this.data.panels[panel].curves.length === 1;
    return {color: several ? run.colour : COLOURS[place], dash: several && isAlone ? run.dash : DASHES[place], width: 1.5};
  }

  async draw() {
    const count = this.data.panels.length;
    this.readouts = this.data.panels.map((panel, number) => this.heading(panel, number));
    this.makeRoom();
    const [above] = this.tops, inner = this.tops[count - 1] + PANEL - above, height = above + inner + BOTTOM;
    const layout = {
      height, margin: {l: LEFT, r: RIGHT, t: above, b: BOTTOM}, font: FONT, showlegend: false, hovermode: "x",
      hoversubplots: "axis", dragmode: "zoom", plot_bgcolor: "#fff", paper_bgcolor: "#fff",
      hoverlabel: {font: {size: 11}, namelength: -1},
      xaxis: {title: {text: "t (s)", standoff: 6}, range: this.view, minallowed: this.whole[0],
        maxallowed: this.whole[1], anchor: count > 1 ? `y${count}` : "y", gridcolor: "#eee", zeroline: false,
        hoverformat: ".5f", showspikes: true, spikemode: "across", spikethickness: 1, spikedash: "dot",
        spikecolor: "#888", spikesnap: "cursor"},
    };
    this.data.panels.forEach((panel, number) => {
      const top = 1 - (this.tops[number] - above) / inner;
      layout[number ? `yaxis${number + 1}` : "yaxis"] = {
        domain: [Math.max(top - PANEL / inner, 0), top], anchor: "x", gridcolor: "#eee", zerolinecolor: "#ccc",
        nticks: 5, fixedrange: false, exponentformat: "power", ...(panel.title === "phase difference" ? PHASE_TICKS : {})};
    });
    await figure(this.box, this.traces(), layout);
    this.cursor = element("div", {class: "cursor", "aria-hidden": "true", style: `top:${above}px;height:${inner}px`});
    this.readouts.forEach(({box}, number) => { box.style.bottom = `calc(100% - ${this.tops[number] - 2}px)`; });
    this.box.append(...this.readouts.map(readout => readout.box), this.cursor);
    this.box.on("plotly_relayout", change => this.moved(change));
    this.box.on("plotly_click", ({points: [point]}) => this.onTime(point.x));
    this.drag();
  }

  traces() {
    return this.curves.map(curve => ({curve, found: points(curve.run, curve, this.around(curve.run))})).map(({curve, found}) => ({
      ...found, text: found.y.map(value => told(curve.column, value)), type: "scatter", mode: "lines", line: this.style(curve), xaxis: "x",
      yaxis: curve.panel ? `y${curve.panel + 1}` : "y", connectgaps: false,
      hovertemplate: `${plain([this.runs.length > 1 ? curve.run.label : "", curve.label].filter(Boolean).join(", "))} ` +
        "%{text}<extra></extra>",
    })).concat(this.impulses());
  }

  // Impulses of impacts: stems on an axis of their own.
  impulses() {
    const number = this.data.panels.findIndex(panel => panel.title === "impulse");
    if (number < 0) return [];
    return this.runs.map(run => {
      const x = [], y = [], [from, to] = this.view;
      for (const [t, impulse] of run.impacts) if (t >= from && t <= to) { x.push(t, t, null); y.push(0, impulse, null); }
      return {x, y, type: "scatter", mode: "lines+markers", xaxis: "x", yaxis: number ? `y${number + 1}` : "y",
        line: {color: this.runs.length > 1 ? run.colour : COLOURS[0], width: 1.5},
        marker: {size: y.map((_, place) => place % 3 === 1 ? 5 : 0)}, hovertemplate: "%{y:.4g}<extra></extra>"};
    });
  }

  // A bit more than is seen, so that a curve goes on while it is moved; no more than all samples if those are seen.
  around(run) {
    const [from, to] = this.view, more = 0.2 * (to - from), least = 1e-6 * (to - from);
    const isInside = from >= run.origin - least && to <= run.end + least;
    const [first, last] = isInside ? [run.origin, run.end] : this.whole;
    return [Math.max(from - more, first), Math.min(to + more, last)];
  }

  // Where panels begin, so that each heading has room above its panel; it may take several lines.
  makeRoom() {
    const boxes = this.readouts.map(readout => readout.box);
    for (const {values} of this.readouts) for (const {text} of values) text.textContent = WIDEST;
    this.box.append(...boxes);
    let below = -4;
    this.tops = boxes.map(box => {
      const top = below + box.offsetHeight + 8;
      below = top + PANEL;
      return top;
    });
    for (const box of boxes) box.remove();
  }

  heading(panel, number) {
    const box = element("div", {class: "readout"}, element("b", {}, withUnit(panel.title, panel.unit)));
    const values = this.curves.filter(curve => curve.panel === number).map(curve => {
      const text = element("output"), style = this.style(curve);
      const label = panel.curves.length > 1 ? curve.label.split(" ") : [];
      const words = label.map((word, place) => element("span", {class: label.length === 1 || !place ? "long" : ""}, `${word} `));
      box.append(element("span", {}, sample(style.color, style.dash), ...words, text));
      return {curve, text};
    });
    return {box, values};
  }

  moved(change) {
    const from = change["xaxis.range[0]"] ?? change["xaxis.range"]?.[0], to = change["xaxis.range[1]"] ??
      change["xaxis.range"]?.[1];
    if (change["xaxis.autorange"]) this.show(this.whole);
    else if (from !== undefined && to !== undefined) this.show([Number(from), Number(to)]);
  }

  // Show an interval: its curves are thinned anew.
  async show([from, to]) {
    this.view = [Math.max(from, this.whole[0]), Math.min(to, this.whole[1])];
    const traces = this.traces(), layout = {...this.box.layout};
    layout.xaxis = {...layout.xaxis, range: [...this.view], autorange: false};
    await figure(this.box, traces, layout);
    for (const told of this.onView) told(this.view);
    this.point(this.time);
  }

  // Put the cursor to a time.
  point(t) {
    this.time = t;
    const axis = this.box._fullLayout.xaxis, at = axis._offset + axis.l2p(t);
    this.cursor.style.transform = `translateX(${at}px)`;
    this.cursor.hidden = at < axis._offset - 1 || at > axis._offset + axis._length + 1;
    for (const {values} of this.readouts) for (const {curve, text} of values) {
      const value = valueAt(curve.run, curve.column, t, curve.column === "phase" ? 2 * Math.PI : 0);
      const inside = t >= curve.run.origin && t <= curve.run.end;
      const told = curve.column === "phase" ? principal(value) : value * curve.factor;
      text.textContent = inside && value !== null ? fixed(told, this.data.panels[curve.panel].decimals) : "–";
    }
  }

  drag() {
    const move = event => {
      const axis = this.box._fullLayout.xaxis, left = this.box.getBoundingClientRect().left;
      this.onTime(axis.p2l(event.clientX - left - axis._offset));
    };
    this.cursor.addEventListener("pointerdown", event => {
      this.cursor.setPointerCapture(event.pointerId);
      this.cursor.addEventListener("pointermove", move);
      event.preventDefault();
    });
    this.cursor.addEventListener("pointerup", () => this.cursor.removeEventListener("pointermove", move));
  }
}

// A value of a curve as it is told where one points at it.
const told = (column, value) => value === null ? "" : shown(column === "phase" ? principal(value) : value, 4);

// Digits that do not change their number while they run.
const fixed = (value, decimals) => value.toFixed(decimals).replace(/^-(?=0\.?0*$)/, "").replace("-", "−");

// The whole run in one panel, where an interval is chosen by dragging.
class Overview {
  constructor(curves) {
    this.curves = curves;
    this.box = byId("overview");
  }

  async draw() {
    const curve = {column: "y_m", factor: 1e3};
    const traces = this.curves.runs.map(run => ({...points(run, curve, this.curves.whole, 500), type: "scatter",
      mode: "lines", line: {width: 0.8, color: this.curves.runs.length > 1 ? run.colour : COLOURS[0]}, hoverinfo: "skip"}));
    const layout = {height: 92, margin: {l: LEFT, r: RIGHT, t: 18, b: 22}, font: {...FONT, size: 11}, showlegend: false,
      dragmode: "select", selectdirection: "h", plot_bgcolor: "#fafafa",
      title: {text: "whole run: platform y from rest (mm)", x: 0, xref: "container", y: 0.97,
        font: {size: 11.5}, pad: {l: 4}},
      xaxis: {range: this.curves.whole, fixedrange: true, zeroline: false, showgrid: false},
      yaxis: {fixedrange: true, nticks: 3, zeroline: false, gridcolor: "#eee"}};
    await figure(this.box, traces, layout, {...CONFIG, displayModeBar: false});
    this.box.on("plotly_selected", found => {
      if (found?.range?.x) this.curves.show([Math.min(...found.range.x), Math.max(...found.range.x)]);
    });
    this.curves.onView.push(view => this.mark(view));
    this.mark(this.curves.view);
  }

  mark([from, to]) {
    const window = {type: "rect", xref: "x", yref: "paper", x0: from, x1: to, y0: 0, y1: 1, fillcolor: "#E69F00",
      opacity: 0.25, line: {width: 1, color: "#8a5f00"}};
    Plotly.relayout(this.box, {shapes: [window], selections: []});
  }
}

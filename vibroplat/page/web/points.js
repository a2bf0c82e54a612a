// Sweeps and orbits: points over frequency; a click shows a point's row.

const POINT_PANEL = 138, BETWEEN_POINTS = 34, ABOVE_POINTS = 46;
const MEANINGS = {
  sweep: "▲ up, ▼ down; filled: periodic, open: not periodic, ×: failed. Where the motion jumps, a line is broken.",
  orbits: "Solid: stable orbits, dashed with open points: unstable ones. Special points stand at the nearest orbit.",
};

class Points {
  constructor(data, label, number, several) {
    this.data = data;
    this.values = Object.fromEntries(data.table.columns.map(column => [column.name, column.values]));
    this.axis = data.axes[0];
    this.scale = {};
    const title = {sweep: "Sweep", orbits: "Orbits"}[data.command];
    this.figure = element("div", {class: "figure", id: `points-${number}`});
    this.row = element("div", {class: "row", "aria-live": "polite"},
      element("p", {class: "hint"}, "Click a point, or pick a row of the table, to see all its numbers."));
    this.table = new Table(data.table, `Table ${data.command === "orbits" ? "branches" : "sweep"}`,
      `${label}-${data.command === "orbits" ? "branches" : "sweep"}.csv`, row => this.pick(row));
    this.section = element("section", {class: "study"}, element("h2", {}, several ? `${title}: ${label}` : title),
      this.choice(), element("div", {class: "beside"}, this.figure, this.row),
      element("p", {class: "hint"}, MEANINGS[data.command]), this.table.box);
    if (data.special) {
      const special = new Table(data.special, "Special points", `${label}-special.csv`, row => this.special(row));
      this.section.append(special.box);
    }
    this.picked = null;
  }

  choice() {
    const box = element("select", {}, ...this.data.axes.map((axis, number) =>
      element("option", {value: number}, withUnit(axis.words, axis.unit))));
    box.addEventListener("change", () => { this.axis = this.data.axes[Number(box.value)]; this.draw(); });
    const logarithmic = element("input", {type: "checkbox"});
    logarithmic.addEventListener("change", () => {
      this.scale = logarithmic.checked ? {type: "log", dtick: 1} : {};
      this.draw();
    });
    return element("p", {class: "screen"}, element("label", {}, "drawn over ", box), " ",
      element("label", {}, logarithmic, " logarithmic"));
  }

  colour(number) {
    const count = 1 + Math.max(...this.data.series.map(series => series.colour));
    if (count <= COLOURS.length) return COLOURS[number];
    const share = number / (count - 1), hue = 260 - 200 * share, light = 28 + 44 * share; // dark to light, as in print
    return `hsl(${hue.toFixed(0)} 75% ${light.toFixed(0)}%)`;
  }

  draw() {
    const count = this.data.measures.length, inner = count * (POINT_PANEL + BETWEEN_POINTS) - BETWEEN_POINTS;
    const above = ABOVE_POINTS + this.legendHeight();
    const layout = {height: inner + above + BOTTOM, margin: {l: LEFT, r: RIGHT, t: above, b: BOTTOM}, font: FONT,
      hovermode: "closest", clickmode: "event", plot_bgcolor: "#fff", dragmode: "zoom",
      legend: {orientation: "h", x: 0, y: 1 + 26 / inner, yanchor: "bottom", font: {size: 11}}, annotations: [],
      xaxis: {title: {text: plain(withUnit(this.axis.words, this.axis.unit))}, anchor: count > 1 ? `y${count}` : "y",
        gridcolor: "#eee", zeroline: false}};
    this.data.measures.forEach((measure, number) => {
      const top = 1 - number * (POINT_PANEL + BETWEEN_POINTS) / inner;
      const domain = [Math.max(top - POINT_PANEL / inner, 0), top];
      layout[number ? `yaxis${number + 1}` : "yaxis"] = {domain, anchor: "x", gridcolor: "#eee", zerolinecolor: "#ccc",
        nticks: 6, ...(measure.column === "phase_difference_rad" ? PHASE_TICKS : this.scale)};
      layout.annotations.push({text: `<b>${plain(withUnit(measure.words, measure.unit))}</b>`, xref: "paper", yref: "paper",
        x: 0, y: domain[1], xanchor: "left", yanchor: "bottom", showarrow: false, font: {size: 12}});
    });
    const isFirst = !this.figure.data;
    const done = figure(this.figure, this.traces(), layout);
    if (isFirst) this.figure.on("plotly_click", ({points: [point]}) => this.clicked(point.customdata));
    return done;
  }

  // A guess of the room that the legend takes; Plotly moves nothing for it.
  legendHeight() {
    const letters = this.data.series.reduce((sum, series) => sum + series.label.length + 9, 0);
    return 19 * Math.ceil(6.4 * letters / Math.max(this.figure.clientWidth - LEFT, 200));
  }

  clicked(found) {
    if (Number.isInteger(found)) this.pick(found);
    else if (found) this.special(found.special);
  }

  value(measure, row) {
    const value = this.values[measure.column][row];
    if (value === null || value === undefined) return null;
    if (measure.column !== "phase_difference_rad") return value * measure.factor;
    return value < -0.5 * Math.PI ? value + 2 * Math.PI : value;
  }

  traces() {
    const over = this.values[this.axis.column];
    const traces = this.data.measures.flatMap((measure, panel) => {
      const place = {xaxis: "x", yaxis: panel ? `y${panel + 1}` : "y", type: "scatter"};
      return [
        ...this.data.series.map((series, number) =>
          this.series(series, measure, over, place, panel === 0 && this.isFirst(series, number))),
        ...this.data.marks.map((mark, number) => this.mark(mark, measure, over, place, panel === 0, number)),
        this.ring(measure, over, place),
      ];
    });
    return traces;
  }

  series(series, measure, over, place, inLegend) {
    const open = new Set(series.open), failed = new Set(series.failed), colour = this.colour(series.colour);
    const symbol = row => failed.has(row) ? "x-thin-open" : open.has(row) ? `${series.symbol}-open` : series.symbol;
    const isOrbit = this.data.command === "orbits", wrapped = this.wrapped(series.rows, measure);
    return {...place, mode: "lines+markers", name: plain(series.label), legendgroup: plain(series.label), showlegend: inLegend,
      x: wrapped.map(row => row === null ? null : over[row]),
      y: wrapped.map(row => row === null ? null : this.value(measure, row)), customdata: wrapped,
      line: {color: colour, dash: series.dash, width: isOrbit ? 1.8 : 1}, connectgaps: false,
      marker: {color: colour, size: isOrbit ? 4 : 7, symbol: wrapped.map(row => row === null ? "circle" : symbol(row)),
        line: {width: 1, color: colour}},
      hovertemplate: `${plain(series.label)}<br>%{x:.5g}, %{y:.5g}<extra></extra>`};
  }

  // A branch may have several stretches of one kind; the legend names each once.
  isFirst(series, number) {
    return this.data.series.findIndex(other => other.label === series.label) === number;
  }

  // Phases that jump by most of a turn are not joined.
  wrapped(rows, measure) {
    if (measure.column !== "phase_difference_rad") return rows;
    const far = (a, b) => a != null && b != null && Math.abs(this.value(measure, a) - this.value(measure, b)) > Math.PI;
    return rows.flatMap((row, number) => number && far(row, rows[number - 1]) ? [null, row] : [row]);
  }

  mark(mark, measure, over, place, inLegend, number) {
    const symbols = ["diamond", "square", "star", "hexagon", "cross", "pentagon", "bowtie"];
    return {...place, mode: "markers", name: plain(mark.kind), legendgroup: plain(mark.kind), showlegend: inLegend,
      x: mark.nearest.map(row => over[row]), y: mark.nearest.map(row => this.value(measure, row)),
      customdata: mark.rows.map(special => ({special})),
      marker: {size: 10, symbol: symbols[number % symbols.length], color: "#fff", line: {color: "#000", width: 1.6}},
      hovertemplate: `${plain(mark.kind)}<extra></extra>`};
  }

  ring(measure, over, place) {
    const rows = this.picked === null ? [] : [this.picked];
    return {...place, mode: "markers", showlegend: false, hoverinfo: "skip", x: rows.map(row => over[row]),
      y: rows.map(row => this.value(measure, row)),
      marker: {size: 15, symbol: "circle-open", color: "#000", line: {width: 2.2, color: "#000"}}};
  }

  pick(row) {
    this.picked = row;
    this.table.pick(row);
    this.tell(this.data.table, row);
    this.draw();
  }

  special(row) {
    this.tell(this.data.special, row);
  }

  // All numbers of a row, and the multipliers of an orbit beside the unit circle.
  tell(table, row) {
    const list = element("dl");
    for (const column of table.columns) {
      const value = column.values[row];
      if (value === null || value === "") continue;
      list.append(element("dt", {title: column.name}, column.words),
        element("dd", {}, `${shown(value)}${column.unit ? ` ${column.unit}` : ""}`));
    }
    this.row.replaceChildren(element("h3", {}, `Row ${row + 1} of ${table.title}`), ...this.circle(table, row), list);
  }

  circle(table, row) {
    const column = name => table.columns.find(one => one.name === name)?.values[row];
    const found = [];
    for (let n = 1; typeof column(`multiplier_${n}_re`) === "number"; n++) {
      found.push([column(`multiplier_${n}_re`), column(`multiplier_${n}_im`) || 0]);
    }
    if (!found.length) return [];
    const picture = drawn("svg", {viewBox: "-1.6 -1.6 3.2 3.2", class: "circle", role: "img",
      "aria-label": "Multipliers and the unit circle"});
    drawn("path", {d: "M-1.6 0H1.6M0 -1.6V1.6", stroke: "#ddd", "stroke-width": 0.02}, picture);
    drawn("circle", {r: 1, fill: "none", stroke: "#555", "stroke-width": 0.03}, picture);
    for (const [re, im] of found) {
      const size = Math.hypot(re, im), fit = size > 1.5 ? 1.5 / size : 1;
      drawn("circle", {cx: re * fit, cy: -im * fit, r: 0.07, fill: size > 1 ? COLOURS[1] : COLOURS[0]}, picture);
    }
    return [picture, element("p", {class: "hint"}, "multipliers; those far outside stand at the edge")];
  }
}

// Boundaries of orbits in the plane of two keys.
class Boundaries {
  constructor(data, label, number) {
    this.data = data;
    this.figure = element("div", {class: "figure", id: `boundaries-${number}`});
    const table = new Table(data.table, "Table boundaries", `${label}-boundaries.csv`);
    this.section = element("section", {}, element("h2", {}, `Boundaries: ${label}`), this.figure, table.box);
  }

  draw() {
    const columns = Object.fromEntries(this.data.table.columns.map(column => [column.name, column]));
    const [first, second] = this.data.keys.map(key => columns[key]), kinds = columns.kind.values;
    const traces = [...new Set(kinds)].map((kind, number) => {
      const rows = range(0, kinds.length).filter(row => kinds[row] === kind);
      return {x: rows.map(row => first.values[row]), y: rows.map(row => second.values[row]), name: plain(String(kind)),
        type: "scatter", mode: "lines+markers", marker: {size: 4}, line: {color: COLOURS[number % COLOURS.length],
          dash: DASHES[number % DASHES.length]}};
    });
    const title = column => ({text: plain(withUnit(column.words, column.unit))});
    return figure(this.figure, traces, {height: 420, margin: {l: LEFT, r: RIGHT, t: 20, b: 44}, font: FONT,
      xaxis: {title: title(first)}, yaxis: {title: title(second)}, legend: {orientation: "h"}});
  }
}

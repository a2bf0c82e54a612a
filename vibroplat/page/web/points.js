// Points of studies over frequency or another column; a click shows a point's row and its orbit.

const POINT_PANEL = 138, HIGH_PANEL = 320, ON_PAPER = 0.6, BETWEEN_POINTS = 34, ABOVE_POINTS = 46, TOOLS = 20;
const LINE = {color: "#666", width: 1.2, dash: "dash"}; // of thresholds

// A guess of the room that a legend of groups takes, below the tools; Plotly moves nothing for it.
function legendHeight(box, names) {
  const room = Math.max(box.clientWidth - LEFT, 200);
  let rows = 1, used = 0;
  for (const name of new Set(names)) {
    const wide = 6.6 * name.length + 46;
    if (used && used + wide > room) [rows, used] = [rows + 1, 0];
    used += wide;
  }
  return 29 * rows - 10 + (CONFIG.displayModeBar ? TOOLS : 0);
}

// A value in the unit of its panel, where it is drawn.
function scaled(measure, value) {
  if (value === null || value === undefined) return null;
  if (measure.column !== "phase_difference_rad") return value * measure.factor;
  return value - 2 * Math.PI * Math.floor((value + 0.5 * Math.PI) / (2 * Math.PI));
}

class Points {
  constructor(data, label, number, several) {
    this.data = data;
    this.values = Object.fromEntries(data.table.columns.map(column => [column.name, column.values]));
    this.axis = data.axes[0];
    this.scale = {};
    this.print = isOn => this.draw(isOn ? ON_PAPER : 1); // lower on paper, where all panels have to fit on a sheet
    this.at = data.at && this.values[data.at][0];
    const {title} = data;
    this.figure = element("div", {class: "figure", id: `points-${number}`});
    this.canvas = element("canvas", {class: "dots"});
    this.orbit = new OrbitView(data.motions, number);
    const more = data.motions.list.length ? " and its orbit" : "";
    this.row = element("div", {class: "row", "aria-live": "polite"},
      element("p", {class: "hint screen"}, `Click a point, or pick a row of the table, to see its numbers${more}.`));
    this.table = new Table(data.table, `Table ${data.table.title}`, `${label}-${data.table.title}.csv`, row => this.pick(row));
    this.section = element("section", {class: "study"}, element("h2", {}, several ? `${title}: ${label}` : title, differs(data.result)),
      this.choice(), element("div", {class: "beside"}, this.figure, this.row),
      element("p", {class: "hint"}, `${data.meaning} ${data.shaking} ${this.told()}`), this.table.box);
    if (data.special) {
      const special = new Table(data.special, `${data.special.title[0].toUpperCase()}${data.special.title.slice(1)}`, `${label}-${data.special.title.replace(" points", "")}.csv`, row => this.special(row));
      this.section.append(special.box);
    }
    this.picked = null; // where the ring is: a function of a column
  }

  // How many points have an orbit.
  told() {
    if (this.data.owner || !this.data.motions.list.length && this.data.special === null) return "";
    const found = Object.values(this.data.motions.rows).filter(Number.isInteger).length, of = this.data.table.rows;
    if (!this.data.motions.asked) return "This page was written without orbits.";
    return found < of ? `The page holds the orbits of ${found || "none"} of ${of} points.` : "The page holds the orbits of all points.";
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
    return element("p", {class: "screen"}, element("label", {}, "drawn over ", box), " ", ...this.choiceOfValue(),
      element("label", {class: "whole"}, logarithmic, " logarithmic"));
  }

  // Of several values of a key, the one whose starts are drawn.
  choiceOfValue() {
    if (!this.data.at) return [];
    const column = this.data.table.columns.find(one => one.name === this.data.at);
    const values = [...new Set(column.values)], box = element("select", {}, ...values.map((value, number) =>
      element("option", {value: number}, shown(value))));
    this.show = at => {
      [this.at, box.value] = [at, values.indexOf(at)];
      return this.draw();
    };
    box.addEventListener("change", () => this.show(values[Number(box.value)]));
    return [element("label", {}, `at ${withUnit(column.words, column.unit)} `, box), " "];
  }

  // A colour by its number, among all of them if these are many; some series have one of their own.
  colour(number) {
    if (typeof number === "string") return number;
    const count = 1 + Math.max(...this.data.series.map(series => series.colour));
    if (count <= COLOURS.length) return COLOURS[number];
    const share = number / (count - 1), hue = 260 - 200 * share, light = 28 + 44 * share; // dark to light, as in print
    return `hsl(${hue.toFixed(0)} 75% ${light.toFixed(0)}%)`;
  }

  draw(share = 1) {
    const count = this.data.measures.length, panel = share * (this.data.high ? HIGH_PANEL : POINT_PANEL);
    const inner = count * (panel + BETWEEN_POINTS) - BETWEEN_POINTS;
    if (!count) return this.figure.replaceChildren("Nothing here has a value that could be drawn.");
    this.room = panel; // of a panel (px)
    // Dots at the edge are whole, and would lie on numbers beside it.
    const hasDots = this.data.series.some(series => series.mode === "dots"), outside = hasDots ? {ticks: "outside", ticklen: 6, tickcolor: "#fff"} : {};
    const names = [...this.data.series.map(series => series.label), ...this.data.marks.map(mark => mark.kind)];
    const above = ABOVE_POINTS + legendHeight(this.figure, names);
    const layout = {height: inner + above + BOTTOM, margin: {l: LEFT, r: RIGHT, t: above, b: BOTTOM}, font: FONT,
      hovermode: "closest", clickmode: "event", barmode: "stack", plot_bgcolor: "#fff", dragmode: "zoom",
      legend: {orientation: "h", x: 0, y: 1 + 26 / inner, yanchor: "bottom", font: {size: 11}}, annotations: [],
      shapes: this.rings(),
      xaxis: {title: {text: plain(withUnit(this.axis.words, this.axis.unit))}, type: this.axis.log ? "log" : "linear", exponentformat: "power", ...outside, anchor: count > 1 ? `y${count}` : "y",
        gridcolor: "#eee", zeroline: false}};
    this.data.measures.forEach((measure, number) => {
      const top = 1 - number * (panel + BETWEEN_POINTS) / inner;
      const domain = [Math.max(top - panel / inner, 0), top], counts = measure.column === this.axis.column;
      layout[number ? `yaxis${number + 1}` : "yaxis"] = {domain, anchor: "x", gridcolor: "#eee", zerolinecolor: "#ccc",
        nticks: 6, exponentformat: "power", ...outside, ...(measure.column === "phase_difference_rad" && !counts ? PHASE_TICKS : this.scale)};
      if (measure.least && !counts && !this.scale.type) layout[number ? `yaxis${number + 1}` : "yaxis"].range = [-0.05 * measure.least, measure.least];
      layout.annotations.push({text: `<b>${counts ? "number of rows" : plain(withUnit(measure.words, measure.unit))}</b>`, xref: "paper", yref: "paper",
        x: 0, y: domain[1], xanchor: "left", yanchor: "bottom", showarrow: false, font: {size: 12}});
    });
    const isFirst = !this.figure.data;
    const done = figure(this.figure, this.traces(), layout);
    if (isFirst && hasDots) {
      this.figure.on("plotly_afterplot", () => this.paint());
      this.paint();
    }
    if (isFirst) this.figure.on("plotly_click", ({points: [point]}) => this.clicked(point.customdata));
    return done;
  }

  clicked(found) {
    if (Number.isInteger(found)) this.pick(found);
    else if (found) this.special(found.special);
  }

  value(measure, row) {
    return scaled(measure, this.values[measure.column][row]);
  }

  traces() {
    const over = this.values[this.axis.column].map(value => value === null ? null : value * this.axis.factor);
    const traces = this.data.measures.flatMap((measure, panel) => {
      const place = {xaxis: "x", yaxis: panel ? `y${panel + 1}` : "y", type: "scatter"};
      return [
        ...this.data.series.flatMap((series, number) =>
          this.series(series, measure, over, place, panel === 0 && this.isFirst(series, number))),
        ...this.data.marks.map((mark, number) => this.mark(mark, measure, place, panel === 0, number)),
      ];
    });
    if (this.data.lines?.length) traces.push({x: [null], y: [null], type: "scatter", mode: "lines", name: "threshold", line: LINE});
    return traces;
  }

  series(series, measure, over, place, inLegend) {
    if (measure.column === this.axis.column || series.mode === "dots") return this.dots(series, measure, over, place, inLegend);
    const stacked = measure.column === this.data.stacked && {stackgroup: "share"};
    const open = new Set(series.open), undecided = new Set(series.undecided), failed = new Set(series.failed), colour = this.colour(series.colour);
    const symbol = row => failed.has(row) ? "x-thin-open" : undecided.has(row) ?
      `${series.symbol}-open-dot` : open.has(row) ? `${series.symbol}-open` : series.symbol;
    const isOrbit = this.data.command === "orbits", wrapped = this.wrapped(series.rows, measure);
    return {...place, ...stacked, mode: series.mode ?? "lines+markers", name: plain(series.label), legendgroup: plain(series.label), showlegend: inLegend,
      x: wrapped.map(row => row === null ? null : over[row]),
      y: wrapped.map(row => row === null ? null : this.value(measure, row)), customdata: wrapped,
      text: wrapped.map(row => row === null ? "" : this.hint(series, row)),
      line: {color: colour, dash: series.dash, width: isOrbit ? 1.8 : 1}, connectgaps: false,
      marker: {color: colour, size: stacked ? wrapped.map(row => this.value(measure, row) ? 7 : 0) : isOrbit ? 4 : 7,
        symbol: wrapped.map(row => row === null ? "circle" : symbol(row)),
        line: {width: 1, color: colour}},
      hovertemplate: wrapped.map(row => `%{text}<br>%{x:.5g}, ${row === null ? "" : this.read(measure, row)}<extra></extra>`)};
  }

  // Many points at once, or how many there are. Plotly only finds the dots: it would need seconds to draw thousands.
  dots(series, measure, over, place, inLegend) {
    const rows = this.data.at ? series.rows.filter(row => this.values[this.data.at][row] === this.at) : series.rows;
    const look = {...place, name: plain(series.label), legendgroup: plain(series.label), showlegend: false};
    const colour = this.colour(series.colour), x = rows.map(row => over[row]);
    const named = inLegend ? [{...look, mode: "markers", x: [null], y: [null], showlegend: true, marker: {color: colour, size: 7}}] : [];
    if (measure.column === this.axis.column) return [...named, {...look, type: "histogram", x, marker: {color: colour},
      bingroup: this.axis.column, hovertemplate: "%{x}: %{y}<extra></extra>"}];
    return [...named, {...look, mode: "none", hoveron: "points", x, y: rows.map(row => this.value(measure, row)), customdata: rows,
      meta: {colour}, marker: {color: colour}, hovertemplate: `${plain(series.label)}<br>%{x:.5g}, %{y:.5g}<extra></extra>`}];
  }

  // Draw the dots, below the rings.
  paint() {
    const {_fullLayout: layout, _fullData: traces} = this.figure, ratio = window.devicePixelRatio || 1;
    const found = traces.filter(trace => trace.mode === "none"), pen = this.canvas.getContext("2d");
    this.figure.querySelector(".main-svg").after(this.canvas);
    [this.canvas.width, this.canvas.height] = [layout.width * ratio, layout.height * ratio];
    this.canvas.style.width = `${layout.width}px`;
    const size = Math.min(Math.max(0.5 * Math.sqrt(layout.width * this.room / this.data.table.rows), 2.4), 7);
    for (const {visible, x, y, meta, xaxis, yaxis} of found) {
      const across = layout[`xaxis${xaxis.slice(1)}`], up = layout[`yaxis${yaxis.slice(1)}`];
      if (visible !== true) continue;
      pen.setTransform(ratio, 0, 0, ratio, across._offset * ratio, up._offset * ratio);
      pen.fillStyle = meta.colour;
      for (let row = 0; row < x.length; row++) {
        const [left, top] = x[row] === null || y[row] === null ? [-9, -9] : [across.d2p(x[row]), up.d2p(y[row])];
        if (left < -1 || left > across._length + 1 || top < -1 || top > up._length + 1) continue; // those at the edge are whole
        pen.beginPath();
        pen.arc(left, top, size / 2, 0, 2 * Math.PI);
        pen.fill();
      }
    }
  }

  // As in the table, in the unit of its panel.
  read(measure, row) {
    const value = this.values[measure.column][row];
    return value === null ? "" : shown(value * measure.factor, 5);
  }

  hint(series, row) {
    if (this.data.command !== "orbits") return plain(series.label);
    const branch = `branch ${this.values.branch[row]}`, stable = this.values.stable[row] ? "stable" : "unstable";
    return plain([series.label === branch ? "" : series.label, branch, stable].filter(Boolean).join(", "));
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

  mark(mark, measure, place, inLegend, number) {
    return {...place, mode: "markers", name: plain(mark.kind), legendgroup: plain(mark.kind), showlegend: inLegend,
      x: mark.at[this.axis.column].map(value => value === null ? null : value * this.axis.factor), y: mark.at[measure.column].map(value => scaled(measure, value)),
      visible: measure.column === this.axis.column ? "legendonly" : true, customdata: mark.rows.map(special => ({special})),
      marker: {size: 9, symbol: mark.symbol, color: "#fff", line: {color: "#000", width: 1.3}},
      hovertemplate: `${plain([mark.kind, mark.meaning].filter(Boolean).join(": "))}<br>%{x:.7g}<extra></extra>`};
  }

  // Rings around the picked point. They are shapes: to move a point of a curve, Plotly draws all curves anew.
  rings() {
    const lines = (this.data.lines ?? []).map(value => ({type: "line", xref: "x", yref: "paper", x0: value * this.axis.factor,
      x1: value * this.axis.factor, y0: 0, y1: 1, layer: "below", line: LINE}));
    if (!this.picked) return lines;
    const at = this.picked(this.axis.column), x = at === null ? null : at * this.axis.factor, size = {xsizemode: "pixel", ysizemode: "pixel", x0: -8, x1: 8, y0: -8, y1: 8};
    return [...lines, ...this.data.measures.map((measure, panel) => [panel, this.height(measure)])
      .filter(([, y]) => y !== null && x !== null).map(([panel, y]) => ({type: "circle", xref: "x",
        yref: panel ? `y${panel + 1}` : "y", xanchor: x, yanchor: y, ...size, line: {width: 2.2, color: "#000"}}))];
  }

  // Where the ring of a panel is, if it has one; in a stack, on top of what is below.
  height(measure) {
    if (measure.column === this.axis.column) return null;
    const value = scaled(measure, this.picked(measure.column));
    if (measure.column !== this.data.stacked) return value;
    const own = this.data.series.findIndex(series => series.rows.includes(this.row.number)), x = this.picked(this.axis.column);
    return this.data.series.slice(0, own).flatMap(series => series.rows).filter(row => this.values[this.axis.column][row] === x)
      .reduce((sum, row) => sum + this.value(measure, row), value);
  }

  pick(row) {
    this.picked = column => this.values[column][row];
    this.row.number = row;
    this.table.pick(row);
    const at = this.data.at && this.values[this.data.at][row];
    if (at !== this.at) this.show(at);
    Plotly.relayout(this.figure, {shapes: this.rings()});
    this.tell(this.data.table, row, this.orbitOf(row));
  }

  special(row) {
    const mark = this.data.marks.find(one => one.rows.includes(row)), place = mark?.rows.indexOf(row);
    this.picked = mark ? column => mark.at[column]?.[place] ?? null : null;
    Plotly.relayout(this.figure, {shapes: this.rings()});
    const found = this.data.motions.special[row];
    this.tell(this.data.special, row, Number.isInteger(found) ? {place: found, text: this.data.special_words ?? `Orbit at this ${mark?.kind ?? "attractor"}.`} :
      {text: found ?? "The page does not hold the orbit of this point."});
  }

  // The orbit of a row; where it has none, that of its nearest neighbour on the curve.
  orbitOf(row) {
    const {rows, list} = this.data.motions, {owner} = this.data, found = rows[owner ? owner[row] : row];
    if (Number.isInteger(found)) return {place: found, text: owner ? "Orbit that this start comes to." : "Orbit of this point."};
    if (owner) return {text: found ?? "The page does not hold the orbit of its attractor."};
    if (found !== undefined || !list.length) return {text: found ?? ""};
    const series = this.data.series.find(one => one.rows.includes(row))?.rows ?? [];
    const near = series.filter(other => other !== null && Number.isInteger(rows[other]))
      .sort((a, b) => Math.abs(a - row) - Math.abs(b - row))[0];
    if (near === undefined) return {text: "The page does not hold the orbit of this point."};
    return {place: rows[near], text: `The page does not hold the orbit of this point. Shown: that of row ${near + 1}, the nearest one.`};
  }

  // All numbers of a row, the orbit, and its multipliers beside the unit circle.
  tell(table, row, orbit) {
    const list = element("dl"), state = element("dl");
    for (const column of table.columns) {
      const value = column.values[row];
      if (value === null || value === "" || /^multiplier_/.test(column.name)) continue;
      (column.state ? state : list).append(element("dt", {title: column.name}, column.words),
        element("dd", {}, `${shown(inUnit(column, value))}${column.unit ? ` ${column.unit}` : ""}`));
    }
    const back = element("button", {type: "button", class: "back screen"}, "↑ Back to the curves");
    back.addEventListener("click", () => this.figure.scrollIntoView({block: "nearest"}));
    const drawn = orbit.place === undefined ? [element("p", {class: "hint"}, orbit.text)] : [this.orbit.box];
    const more = state.children.length ? [element("details", {}, element("summary", {}, "State where the period begins"), state)] : [];
    this.row.replaceChildren(back, element("h3", {}, `Row ${row + 1} of ${table.title}`), ...drawn, ...this.circle(table, row),
      list, ...more);
    if (orbit.place === undefined) this.orbit.play(false);
    else this.orbit.show(orbit.place, orbit.text);
    const {top, bottom} = this.row.getBoundingClientRect();
    if (bottom < 80 || top > window.innerHeight - 80) this.row.scrollIntoView({block: "start"});
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
    const values = found.map(([re, im]) => im ? `${shown(re, 4)} ${im < 0 ? "−" : "+"} ${shown(Math.abs(im), 4)} i` : shown(re, 4));
    return [picture, element("p", {class: "hint"}, `Floquet multipliers: ${values.join("; ")}` +
      `${found.some(([re, im]) => Math.hypot(re, im) > 1.5) ? ". Those far outside stand at the edge" : ""}.`)];
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
    const [first, second] = this.data.keys.map(key => columns[key]);
    const at = (column, rows) => rows.map(row => row === null ? null : column.values[row]);
    const traces = this.data.series.map(({label, colour, dash, reached, rows}) => ({x: at(first, rows), y: at(second, rows),
      name: plain(label), legendgroup: plain(label), type: "scatter", mode: reached ? "lines+markers" : "lines", marker: {size: 4}, connectgaps: false,
      line: {width: reached ? 2 : 0.7, color: COLOURS[colour % COLOURS.length], dash: DASHES[dash % DASHES.length]}}));
    const title = column => ({text: plain(withUnit(column.words, column.unit))});
    const above = legendHeight(this.figure, traces.map(trace => trace.name)) + 24;
    return figure(this.figure, traces, {height: 400 + above, margin: {l: LEFT, r: RIGHT, t: above, b: 44}, font: FONT,
      plot_bgcolor: "#fff", xaxis: {title: title(first), gridcolor: "#eee", zeroline: false},
      yaxis: {title: title(second), gridcolor: "#eee", zeroline: false}, showlegend: true,
      legend: {orientation: "h", x: 0, y: 1.01, yanchor: "bottom"}});
  }
}

// Elasticities of a measure by all keys, as bars, the largest on top.
class Elasticities {
  constructor(data, label, number) {
    this.data = data;
    this.columns = Object.fromEntries(data.table.columns.map(column => [column.name, column.values]));
    this.figure = element("div", {class: "figure", id: `elasticities-${number}`});
    const measures = [...new Set(this.columns.measure)].filter(name => this.rows(name).length);
    [this.measure] = measures;
    const box = element("select", {}, ...measures.map(name => element("option", {value: name}, data.names[name])));
    box.addEventListener("change", () => { this.measure = box.value; this.draw(); });
    this.section = element("section", {class: "study"}, element("h2", {}, `Elasticities: ${label}`),
      element("p", {class: "screen"}, element("label", {}, "of ", box)), this.figure,
      element("p", {class: "hint"}, "Relative change of the measure over that of a key. Blue: both grow together, orange: one falls as the other grows."),
      new Table(data.table, "Table sensitivities", `${label}-sensitivities.csv`).box);
  }

  // Rows of a measure that have an elasticity, the largest last, which is drawn on top.
  rows(measure) {
    const size = row => Math.abs(this.columns.elasticity[row]);
    return this.columns.measure.flatMap((name, row) => name === measure && this.columns.elasticity[row] !== null ? [row] : [])
      .sort((a, b) => size(a) - size(b));
  }

  draw() {
    const rows = this.rows(this.measure), values = rows.map(row => this.columns.elasticity[row]);
    if (!rows.length) return this.figure.replaceChildren("No measure has an elasticity: all are 0.");
    const bars = {type: "bar", orientation: "h", x: values, y: rows.map(row => this.columns.key[row]), customdata: rows,
      marker: {color: values.map(value => COLOURS[value < 0 ? 1 : 0])}, hovertemplate: "%{y}: %{x:.4g}<extra></extra>"};
    return figure(this.figure, [bars], {height: 20 * rows.length + 90, margin: {l: 10, r: 16, t: 28, b: 44}, font: FONT, plot_bgcolor: "#fff",
      xaxis: {title: {text: `elasticity of ${plain(this.data.names[this.measure])}`}, gridcolor: "#eee", zerolinecolor: "#888"},
      yaxis: {automargin: true, tickvals: rows.map(row => this.columns.key[row]), ticktext: rows.map(row => plain(this.data.names[this.columns.key[row]]))}});
  }
}

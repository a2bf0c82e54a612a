// Pictures of studies: panels over a column that a person chooses; a click shows a point's row and its orbit.

const POINT_PANEL = 138, HIGH_PANEL = 320, ON_PAPER = 0.6, BETWEEN_POINTS = 34, ABOVE_POINTS = 46, TOOLS = 20;
const BAR = 20, BEHIND = "#c9c9c9", REFERENCE = "#666";
const STATES = {open: 1, half: 2, failed: 3};
// The colour scale viridis from small values, pale, to large ones, dark, as in print.
const SCALE = ["#fde725", "#b5de2b", "#6ece58", "#35b779", "#1f9e89", "#26828e", "#31688e", "#3e4989", "#482878", "#440154"];

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

class Picture {
  constructor(data, label, number, several) {
    this.data = data;
    this.values = {...Object.fromEntries(data.table.columns.map(column => [column.name, column.values])), ...data.values};
    this.count = data.table.rows;
    this.axis = data.axes[0];
    this.facet = data.facets[0] ?? null;
    this.scale = {};
    this.print = isOn => this.draw(isOn ? ON_PAPER : 1); // lower on paper, where all panels have to fit on a sheet
    this.figure = element("div", {class: "figure", id: `picture-${number}`});
    this.canvas = element("canvas", {class: "dots"});
    this.orbit = new OrbitView(data.motions, number);
    const more = data.motions.list.length ? " and its orbit" : "", name = text => text[0].toUpperCase() + text.slice(1);
    this.row = element("div", {class: "row", "aria-live": "polite"},
      element("p", {class: "hint screen"}, `Click a point, or pick a row of the table, to see its numbers${more}.`));
    this.table = new Table(data.table, `Table ${data.table.title}`, `${label}-${data.table.title}.csv`, row => this.pick(row));
    this.section = element("section", {class: "study"},
      element("h2", {}, several ? `${data.title}: ${label}` : data.title, differs(data.result)),
      this.choice(), element("div", {class: "beside"}, this.figure, this.row),
      element("p", {class: "hint"}, `${data.meaning} ${this.told()}`), this.table.box);
    if (data.special) this.section.append(new Table(data.special, name(data.special.title),
      `${label}-${data.special.title}.csv`, row => this.pick(this.count + row)).box);
    this.picked = null; // the place of the ring
  }

  // How many points have an orbit.
  told() {
    const {motions, owner, owned} = this.data;
    if (owned || !owner.length) return "";
    if (!motions.asked) return "This page was written without orbits.";
    const found = owner.slice(0, this.count).filter(row => Number.isInteger(motions.rows[row])).length;
    return found < this.count ? `The page holds the orbits of ${found || "none"} of ${this.count} points.` : "The page holds the orbits of all points.";
  }

  choice() {
    const {axes, facets, choice} = this.data, box = this.select(axes.map(axis => withUnit(axis.words, axis.unit)), number => {
      this.axis = axes[number];
      return this.draw();
    });
    const logarithmic = element("input", {type: "checkbox"}), parts = [];
    logarithmic.addEventListener("change", () => {
      this.scale = logarithmic.checked ? {type: "log", dtick: 1} : {};
      this.draw();
    });
    if (axes.length > 1) parts.push(element("label", {}, "drawn over ", box), " ");
    if (facets.length) {
      this.facets = this.select(facets.map(facet => facet.label), number => this.show(facets[number]));
      parts.push(element("label", {}, `${choice ? `${choice}: ` : ""}`, this.facets), " ");
    }
    if (this.data.measures.some(measure => measure.kind === "points" && !measure.log)) parts.push(element("label", {class: "whole"}, logarithmic, " logarithmic"));
    return element("p", {class: "screen"}, ...parts);
  }

  select(names, chosen) {
    const box = element("select", {}, ...names.map((name, number) => element("option", {value: number}, name)));
    box.addEventListener("change", () => chosen(Number(box.value)));
    return box;
  }

  // Of several facets, the one that is drawn.
  show(facet) {
    this.facet = facet;
    this.facets.value = this.data.facets.indexOf(facet);
    return this.draw();
  }

  // The series that are drawn, those of other facets that are behind them first.
  shown() {
    const {series} = this.data;
    if (!this.facet) return series;
    return [...this.facet.behind.map(number => ({...series[number], colour: BEHIND, label: "behind"})), ...this.facet.series.map(number => series[number])];
  }

  draw(share = 1) {
    const {measures} = this.data, count = measures.length, bars = measures[0]?.kind === "bars";
    const rows = Math.max(...this.shown().map(series => series.rows.length), 1);
    const panel = bars ? BAR * rows + 30 : share * (this.data.high ? HIGH_PANEL : POINT_PANEL);
    const inner = count * (panel + BETWEEN_POINTS) - BETWEEN_POINTS;
    if (!this.data.series.some(series => series.rows.length)) return this.figure.replaceChildren(measures[0]?.title || "Nothing here has a value that could be drawn.");
    this.room = panel; // of a panel (px)
    // Dots at the edge are whole, and would lie on numbers beside it.
    const hasDots = this.data.series.some(series => series.mode === "dots"), outside = hasDots ? {ticks: "outside", ticklen: 6, tickcolor: "#fff"} : {};
    const traces = this.traces(), above = ABOVE_POINTS + legendHeight(this.figure, traces.filter(trace => trace.showlegend).map(trace => trace.name));
    const layout = {height: inner + above + BOTTOM, margin: {l: bars ? 10 : LEFT, r: RIGHT, t: above, b: BOTTOM}, font: FONT,
      hovermode: "closest", clickmode: "event", barmode: "stack", plot_bgcolor: "#fff", dragmode: "zoom",
      legend: {orientation: "h", x: 0, y: 1 + 26 / inner, yanchor: "bottom", font: {size: 11}}, annotations: [],
      shapes: this.shapes(),
      xaxis: {title: {text: plain(bars ? measures[0].words : withUnit(this.axis.words, this.axis.unit))}, type: this.axis.log ? "log" : "linear", exponentformat: "power", ...outside, anchor: count > 1 ? `y${count}` : "y",
        gridcolor: "#eee", zeroline: false}};
    measures.forEach((measure, number) => {
      const top = 1 - number * (panel + BETWEEN_POINTS) / inner, counts = measure.column === this.axis.column;
      const domain = [Math.max(top - panel / inner, 0), top], axis = layout[number ? `yaxis${number + 1}` : "yaxis"] = {domain,
        anchor: "x", gridcolor: "#eee", zerolinecolor: "#ccc", nticks: 6, exponentformat: "power", ...outside};
      if (measure.kind === "tiles") Object.assign(axis, this.ticks(measure));
      else if (bars) Object.assign(axis, {automargin: true, autorange: "reversed", nticks: 0});
      else if (!counts && measure.column === "phase_difference_rad") Object.assign(axis, PHASE_TICKS);
      else if (!counts) Object.assign(axis, measure.log ? {type: "log", nticks: 4} : {}, this.scale);
      if (measure.least && !counts && !this.scale.type) axis.range = [-0.05 * measure.least, measure.least];
      layout.annotations.push({text: `<b>${plain(this.heading(measure, counts))}</b>`, xref: "paper", yref: "paper",
        x: 0, y: domain[1], xanchor: "left", yanchor: "bottom", showarrow: false, font: {size: 12}});
    });
    const isFirst = !this.figure.data;
    const done = figure(this.figure, traces, layout);
    if (isFirst && hasDots) {
      this.figure.on("plotly_afterplot", () => this.paint());
      this.paint();
    }
    if (isFirst) this.figure.on("plotly_click", ({points: [point]}) => Number.isInteger(point.customdata) && this.pick(point.customdata));
    return done;
  }

  heading(measure, counts) {
    if (counts) return "number of rows";
    if (measure.kind === "bars") return this.facet?.label ?? "";
    if (!measure.of || measure.classes.length) return measure.title || withUnit(measure.words, measure.unit);
    const {of} = measure, [low, high] = of.ends;
    return `${measure.title || measure.label || of.words}: from ${shown(low * of.factor, 3)}, pale, to ${shown(high * of.factor, 3)}${of.unit && ` ${of.unit}`}, dark${of.white ? "; white: none" : ""}`;
  }

  value(measure, place) {
    return scaled(measure, this.values[measure.column][place]);
  }

  traces() {
    const over = this.values[this.axis.column].map(value => value === null ? null : value * this.axis.factor), traces = [], named = new Set();
    const add = trace => {
      traces.push({type: "scatter", ...trace, name: plain(trace.name ?? ""), legendgroup: plain(trace.name ?? ""), showlegend: Boolean(trace.name) && !named.has(trace.name)});
      named.add(trace.name);
    };
    this.data.measures.forEach((measure, panel) => {
      const place = {xaxis: "x", yaxis: panel ? `y${panel + 1}` : "y"}, series = this.shown().filter(one => !one.of.length || one.of.includes(measure.column));
      if (measure.kind === "bars") return series.forEach(one => add({...place, ...this.bars(one, measure)}));
      if (measure.kind === "tiles") for (const trace of this.tiles(series, measure, over)) add({...place, ...trace});
      else for (const one of series) for (const trace of this.curves(one, measure, over)) add({...place, ...trace});
      for (const mark of this.data.marks) add({...place, ...this.mark(mark, measure, over)});
    });
    const empty = {x: [null], y: [null]};
    for (const {label, dash, at} of this.data.lines) if (label && at.length) add({...empty, mode: "lines", name: label, line: {color: REFERENCE, width: 1.2, dash}});
    for (const {label} of this.data.ranges) add({...empty, mode: "markers", name: label, marker: {color: "#ddd", symbol: "square", size: 10}});
    return traces;
  }

  // The traces of a series in a panel: as a curve, as dots in colours of a column, or as how many there are.
  curves(series, measure, over) {
    const known = series.rows.filter(place => place !== null);
    if (measure.column === this.axis.column || (series.mode === "dots" && measure.by)) {
      return this.classes(measure, series).flatMap(({name, colour, places}) => this.dots({...series, label: name, colour}, measure, over, places));
    }
    return series.mode === "dots" ? this.dots(series, measure, over, known) : [this.curve(series, measure, over)];
  }

  // The points of a series by the classes of a column; without classes all together.
  classes(measure, series) {
    const known = series.rows.filter(place => place !== null), by = this.values[measure.by];
    if (!measure.classes.length) return [{name: series.label, colour: series.colour, places: known}];
    return measure.classes.map(([value, colour, name]) => ({name, colour, places: known.filter(place => by[place] === value)})).filter(({places}) => places.length);
  }

  curve(series, measure, over) {
    const {states} = this.data, stacked = measure.kind === "stack", size = series.mode === "lines" ? 4 : 7;
    const symbol = place => ["", "-open", "-open-dot"][states[place] ?? 0] === undefined ? "x-thin-open" : series.symbol + ["", "-open", "-open-dot"][states[place] ?? 0];
    const wrapped = this.wrapped(series.rows, measure), at = use => wrapped.map(place => place === null ? null : use(place));
    return {...(stacked && {stackgroup: "share"}), mode: {lines: "lines+markers", markers: "markers", both: "lines+markers"}[series.mode], name: series.label,
      x: at(place => over[place]), y: at(place => this.value(measure, place)), customdata: wrapped, opacity: series.opacity,
      text: at(place => this.hint(series, place)), line: {color: series.colour, dash: series.dash, width: 1.2 * series.width}, connectgaps: false,
      marker: {color: series.colour, size: stacked ? at(place => this.value(measure, place) ? 7 : 0) : at(place => place < this.count || series.mode !== "lines" ? size : 0),
        symbol: wrapped.map(place => place === null ? "circle" : symbol(place)), line: {width: 1, color: series.colour}},
      hovertemplate: wrapped.map(place => `%{text}<br>%{x:.5g}, ${place === null ? "" : this.read(measure, place)}<extra></extra>`)};
  }

  // Many points at once, or how many there are. Plotly only finds the dots: it would need seconds to draw thousands.
  dots(series, measure, over, places) {
    const look = {name: series.label, showlegend: false}, colour = series.colour, x = places.map(place => over[place]);
    const entry = series.label ? [{mode: "markers", name: series.label, x: [null], y: [null], marker: {color: colour, size: 7}}] : [];
    if (measure.column === this.axis.column) return [...entry, {...look, type: "histogram", x, marker: {color: colour},
      bingroup: this.axis.column, hovertemplate: "%{x}: %{y}<extra></extra>"}];
    const colours = measure.by && !measure.classes.length ? this.shades(measure, places) : null;
    return [...entry, {...look, mode: "none", hoveron: "points", x, y: places.map(place => this.value(measure, place)), customdata: places,
      meta: {colour, colours}, marker: {color: colour}, hovertemplate: `${plain(series.label)}<br>%{x:.5g}, %{y:.5g}<extra></extra>`}];
  }

  shades(measure, places) {
    const [low, high] = measure.of.ends, values = this.values[measure.by];
    return places.map(place => values[place] === null ? "#d9d9d9" : SCALE[Math.min(Math.floor((values[place] - low) / (high - low || 1) * SCALE.length), SCALE.length - 1)]);
  }

  // Values of the vertical axis of tiles; rows are evenly spaced, whatever these are.
  levels(measure) {
    const rows = this.data.series.filter(series => series.mode === "dots").flatMap(series => series.rows);
    return [...new Set(rows.map(place => this.values[measure.column][place]))].sort((a, b) => a - b);
  }

  ticks(measure) {
    const levels = this.levels(measure), every = Math.ceil(levels.length / 12), kept = levels.map((_, number) => number).filter(number => number % every === 0);
    return {tickvals: kept, ticktext: kept.map(number => shown(levels[number] * measure.factor, 4)), range: [-0.5, levels.length - 0.5], showgrid: false};
  }

  tiles(series, measure, over) {
    const levels = this.levels(measure), places = series.filter(one => one.mode === "dots").flatMap(one => one.rows);
    const across = [...new Set(places.map(place => over[place]))].filter(value => value !== null).sort((a, b) => a - b), {classes} = measure;
    const grid = () => levels.map(() => across.map(() => null)), [z, rows] = [grid(), grid()], values = this.values[measure.by];
    const number = value => classes.length ? classes.findIndex(([name]) => name === value) : value;
    for (const place of places) {
      const [row, column] = [levels.indexOf(this.values[measure.column][place]), across.indexOf(over[place])];
      if (column >= 0) [z[row][column], rows[row][column]] = [values[place] === null ? null : number(values[place]), place];
    }
    const [low, high] = classes.length ? [-0.5, classes.length - 0.5] : measure.of.ends, colours = classes.length ? classes.map(([, colour]) => colour) : SCALE;
    const steps = colours.flatMap((colour, step) => classes.length ? [[step / colours.length, colour], [(step + 1) / colours.length, colour]] : [[step / (colours.length - 1), colour]]);
    if (measure.of.white) steps.splice(0, 1, [0, "#fff"], [1e-6, SCALE[0]]);
    const present = new Set(places.map(place => values[place])), named = classes.filter(([value]) => present.has(value));
    return [{type: "heatmap", x: across, y: levels.map((_, row) => row), z, customdata: rows, zmin: low, zmax: high, colorscale: steps, showscale: false,
      text: z.map(row => row.map(value => value === null ? "failed" : classes.length ? classes[value][2] : shown(value * measure.of.factor, 4))), hovertemplate: "%{x:.5g}: %{text}<extra></extra>"},
      ...named.map(([, colour, name]) => ({mode: "markers", name, x: [null], y: [null], marker: {color: colour, symbol: "square", size: 9}})),
      ...series.filter(one => one.mode === "lines").map(one => ({mode: "lines", name: one.label, line: {color: one.colour, dash: one.dash, width: 1.5 * one.width},
        connectgaps: false, hoverinfo: "name", x: one.rows.map(place => place === null ? null : over[place]), y: one.rows.map(place => place === null ? null : this.level(levels, this.values[measure.column][place]))}))];
  }

  // Where a value is among rows of tiles.
  level(levels, value) {
    const after = levels.findIndex(level => level >= value);
    if (after < 0 || value < levels[0]) return null;
    return after === 0 ? 0 : after - 1 + (value - levels[after - 1]) / (levels[after] - levels[after - 1]);
  }

  // Bars of a measure by keys, as the rows are, the largest on top.
  bars(series, measure) {
    const values = series.rows.map(place => this.values[this.axis.column][place]);
    return {type: "bar", orientation: "h", x: values, y: series.rows.map(place => this.values[measure.column][place]), customdata: series.rows,
      marker: {color: values.map(value => COLOURS[value < 0 ? 1 : 0])}, hovertemplate: "%{y}: %{x:.4g}<extra></extra>"};
  }

  // Draw the dots, below the rings.
  paint() {
    const {_fullLayout: layout, _fullData: traces} = this.figure, ratio = window.devicePixelRatio || 1;
    const found = traces.filter(trace => trace.mode === "none"), pen = this.canvas.getContext("2d");
    this.figure.querySelector(".main-svg").after(this.canvas);
    [this.canvas.width, this.canvas.height] = [layout.width * ratio, layout.height * ratio];
    this.canvas.style.width = `${layout.width}px`;
    const size = Math.min(Math.max(0.5 * Math.sqrt(layout.width * this.room / this.count), 2.4), 7);
    for (const {visible, x, y, meta, xaxis, yaxis} of found) {
      const across = layout[`xaxis${xaxis.slice(1)}`], up = layout[`yaxis${yaxis.slice(1)}`];
      if (visible !== true) continue;
      pen.setTransform(ratio, 0, 0, ratio, across._offset * ratio, up._offset * ratio);
      for (let row = 0; row < x.length; row++) {
        const [left, top] = x[row] === null || y[row] === null ? [-9, -9] : [across.d2p(x[row]), up.d2p(y[row])];
        if (left < -1 || left > across._length + 1 || top < -1 || top > up._length + 1) continue; // those at the edge are whole
        pen.fillStyle = meta.colours?.[row] ?? meta.colour;
        pen.beginPath();
        pen.arc(left, top, size / 2, 0, 2 * Math.PI);
        pen.fill();
      }
    }
  }

  // As in the table, in the unit of its panel.
  read(measure, place) {
    const value = this.values[measure.column][place];
    return value === null ? "" : shown(value * measure.factor, 5);
  }

  hint(series, place) {
    const branch = this.values.branch?.[place];
    return plain([series.label, branch === undefined || series.label.startsWith("branch") ? "" : `branch ${branch}`].filter(Boolean).join(", "));
  }

  // Phases that jump by most of a turn are not joined.
  wrapped(rows, measure) {
    if (measure.column !== "phase_difference_rad") return rows;
    const far = (a, b) => a != null && b != null && Math.abs(this.value(measure, a) - this.value(measure, b)) > Math.PI;
    return rows.flatMap((row, number) => number && far(row, rows[number - 1]) ? [null, row] : [row]);
  }

  mark(mark, measure, over) {
    return {mode: "markers", name: mark.kind, x: mark.rows.map(place => over[place]), y: mark.rows.map(place => this.value(measure, place)),
      visible: measure.column === this.axis.column ? "legendonly" : true, customdata: mark.rows,
      marker: {size: mark.colour ? 13 : 9, symbol: mark.symbol, color: mark.colour || "#fff", line: {color: "#000", width: mark.colour ? 0.5 : 1.3}},
      hovertemplate: `${plain([mark.kind, mark.meaning].filter(Boolean).join(": "))}<br>%{x:.7g}<extra></extra>`};
  }

  // Lines of reference, intervals, and rings around the picked point. These are shapes: to move a point of a curve, Plotly draws all curves anew.
  shapes() {
    const {measures} = this.data, low = {layer: "below"}, y = panel => panel ? `y${panel + 1}` : "y";
    const lines = this.data.lines.flatMap(({column, at, factor, dash}) => at.flatMap(value => {
      const line = {type: "line", ...low, line: {color: REFERENCE, width: 1.2, dash}}, end = value * factor;
      if (column === this.axis.column) return [{...line, xref: "x", yref: "paper", x0: end, x1: end, y0: 0, y1: 1}];
      return measures.flatMap((measure, panel) => measure.column === column ? [{...line, xref: "paper", yref: y(panel), x0: 0, x1: 1, y0: end, y1: end}] : []);
    }));
    const ranges = this.data.ranges.filter(one => one.column === this.axis.column).map(one => ({type: "rect", ...low, xref: "x", yref: "paper",
      x0: one.low * one.factor, x1: one.high * one.factor, y0: 0, y1: 1, fillcolor: REFERENCE, opacity: 0.15, line: {width: 0}}));
    if (this.picked === null) return [...lines, ...ranges];
    const x = scaled(this.axis, this.values[this.axis.column][this.picked]), size = {xsizemode: "pixel", ysizemode: "pixel", x0: -8, x1: 8, y0: -8, y1: 8};
    return [...lines, ...ranges, ...measures.map((measure, panel) => [panel, this.height(measure)])
      .filter(([, height]) => height !== null && x !== null).map(([panel, height]) => ({type: "circle", xref: "x",
        yref: y(panel), xanchor: x, yanchor: height, ...size, line: {width: 2.2, color: "#000"}}))];
  }

  // Where the ring of a panel is, if it has one; in a stack, on top of what is below.
  height(measure) {
    if (measure.column === this.axis.column || measure.kind === "bars") return null;
    const value = this.value(measure, this.picked);
    if (measure.kind === "tiles") return this.level(this.levels(measure), this.values[measure.column][this.picked]);
    if (measure.kind !== "stack" || value === null) return value;
    const {series} = this.data, own = series.findIndex(one => one.rows.includes(this.picked)), over = this.values[this.axis.column];
    return series.slice(0, own).flatMap(one => one.rows).filter(row => over[row] === over[this.picked])
      .reduce((sum, row) => sum + this.value(measure, row), value);
  }

  // Show a point of the table, or behind them a special one.
  pick(place) {
    const {special, series, facets} = this.data, table = place < this.count ? this.data.table : special;
    if (place >= this.count + (special?.rows ?? 0)) return;
    this.picked = place;
    if (table === this.data.table) this.table.pick(place);
    const own = facets.find(facet => facet.series.some(number => series[number].rows.includes(place)));
    if (own && this.facet && !this.facet.series.some(number => series[number].rows.includes(place))) this.show(own);
    Plotly.relayout(this.figure, {shapes: this.shapes()});
    this.tell(table, table === special ? place - this.count : place, this.orbitOf(place));
  }

  // The orbit of a point; where it has none, that of its nearest neighbour on the curve.
  orbitOf(place) {
    const {motions, owner, owned, words} = this.data, found = motions.rows[owner[place]], isSpecial = place >= this.count;
    const kind = this.data.marks.find(mark => mark.rows.includes(place))?.kind;
    const of = isSpecial ? words || `Orbit at this ${kind ?? "point"}.` : owned ? "Orbit to which this motion converges." : "Orbit of this point.";
    if (Number.isInteger(found)) return {place: found, text: of};
    const none = owner.length ? "The page does not hold the orbit of this point." : "";
    if (isSpecial || owned || found !== undefined || !motions.list.length) return {text: found ?? (isSpecial || owned ? none : "")};
    const rows = this.data.series.find(one => one.rows.includes(place))?.rows ?? [];
    const near = rows.filter(other => other !== null && other < this.count && Number.isInteger(motions.rows[owner[other]]))
      .sort((a, b) => Math.abs(a - place) - Math.abs(b - place))[0];
    return near === undefined ? {text: none} : {place: motions.rows[owner[near]], text: `${none} Shown: that of row ${near + 1}, the nearest one.`};
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

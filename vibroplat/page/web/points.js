// Points of studies: a click or a tap shows the numbers of one, its orbit, and the machine that moves through it.

const REACH = 30; // px
const FIRST = 14; // numbers of a point that are seen at once
const BLUE = "#0072B2", ORANGE = "#D55E00";

class Study {
  constructor(section) {
    this.section = section;
    this.data = JSON.parse(section.querySelector(".data").textContent);
    this.aside = section.querySelector(".row");
    const home = document.getElementById(`picture-${this.data.home}`); // pictures may share their table and orbits
    this.tables = [...home.querySelectorAll("table.rows")];
    this.list = home === section ? this.data.list : JSON.parse(home.querySelector(".data").textContent).list;
    this.rows = this.tables.map(table => [...table.tBodies[0].rows]);
    this.plots = [...section.querySelectorAll(".picture")].map(figure => ({figure, area: figure.querySelector(".area"),
      on: figure.querySelector(".on"), points: this.points(figure.dataset.p)}));
    for (const plot of this.plots) {
      plot.area.addEventListener("click", event => plot.area.dataset.dragged || this.click(plot, event));
      plot.area.tabIndex = 0;
      plot.area.addEventListener("keydown", event => this.key(event));
    }
    if (home === section) this.tables.forEach((table, second) => table.addEventListener("click", event => {
      const row = event.target.closest("tbody tr");
      if (row) this.pick(this.rows[second].indexOf(row) + (second ? this.data.rows : 0), true);
    }));
  }

  // Numbers and places, in shares of the drawing from its left and its top.
  points(text) {
    if (!text) return [];
    const parts = new Uint16Array(Uint8Array.from(atob(text), letter => letter.charCodeAt(0)).buffer), count = parts.length / 3;
    return Array.from({length: count}, (_, n) => ({place: parts[n], x: parts[count + n] / 65535, y: parts[2 * count + n] / 65535}));
  }

  click({on, points}, event) {
    const {left, top, width, height} = on.getBoundingClientRect();
    const far = ({x, y}) => Math.hypot(left + x * width - event.clientX, top + y * height - event.clientY);
    const nearest = points.reduce((best, one) => best && far(best) <= far(one) ? best : one, null);
    if (nearest && far(nearest) < REACH) this.pick(nearest.place);
  }

  key(event) {
    const step = {ArrowRight: 1, ArrowLeft: -1}[event.key];
    if (!step || this.picked === undefined) return;
    event.preventDefault();
    this.pick(Math.min(Math.max(this.picked + step, 0), this.rows.flat().length - 1));
  }

  pick(place, scroll = false) {
    if (!(place >= 0)) return;
    this.picked = place;
    for (const ring of this.section.querySelectorAll(".ring")) ring.remove();
    for (const {on, points} of this.plots) for (const {x, y} of points.filter(one => one.place === place)) {
      const ring = Object.assign(document.createElement("u"), {className: "ring"});
      Object.assign(ring.style, {left: `${100 * x}%`, top: `${100 * y}%`});
      on.append(ring);
    }
    this.tell(place);
    if (scroll === null) return;
    const {top, bottom} = this.aside.getBoundingClientRect();
    if (scroll || bottom < 80 || top > innerHeight - 120) this.aside.scrollIntoView({block: "nearest"});
  }

  // All numbers of a row, and its orbit if it has one.
  tell(place) {
    const second = place >= this.data.rows, row = this.rows[second ? 1 : 0][place - (second ? this.data.rows : 0)];
    const heads = [...this.tables[second ? 1 : 0].tHead.rows[0].cells], list = document.createElement("dl");
    const more = document.createElement("details"), rest = document.createElement("dl");
    const cells = [...row.cells].map((cell, n) => [heads[n].dataset.n, heads[n].textContent, cell.textContent]);
    for (const [name, words, text] of cells) {
      if (text === "–" || text === "" || /^multiplier_|_rad_per_s$|_m_per_s$/.test(name)) continue;
      (list.children.length < 2 * FIRST ? list : rest).append(Object.assign(document.createElement("dt"), {textContent: words, title: name}), Object.assign(document.createElement("dd"), {textContent: text}));
    }
    for (const old of this.section.querySelectorAll("tr.picked")) old.classList.remove("picked");
    row.classList.add("picked");
    more.append(Object.assign(document.createElement("summary"), {textContent: "All numbers of this point"}), rest);
    this.aside.querySelector(".numbers").replaceChildren(list, ...(rest.children.length ? [more] : []));
    this.circle(cells);
    this.orbit(place, second);
  }

  orbit(place, special) {
    const {owner, why, words, owned, marks} = this.data, none = why[-1 - owner[place]] ?? "", near = this.nearest(place, none);
    const number = owner[near] ?? -1, box = this.aside.querySelector(".orbit"), hint = this.aside.querySelector(":scope > .hint");
    hint.textContent = near === place ? none : `${none} Shown: that of row ${near + 1}, the nearest one.`;
    if (!box) return;
    box.hidden = !(number >= 0);
    this.player?.play(false);
    if (box.hidden) return;
    const orbit = this.list[number], stage = box.querySelector(".stage");
    box.querySelector("h3").textContent = special ? words || `Orbit at this ${marks[place] ?? "point"}` : owned ? "Orbit to which this motion converges" : "Orbit of this point";
    stage.replaceChildren(document.getElementById(`machine-${orbit.machine}`).content.cloneNode(true));
    const machine = new Machine(stage.querySelector("svg"), orbit), seconds = orbit.windows[0][1];
    const [motion, portrait] = ["motion", "portrait"].map(name => views.get(box.querySelector(`.${name}`)));
    this.draw(machine, orbit.turns, motion, portrait);
    this.player = new Player(box, [machine]);
    box.querySelector(".told").textContent = `period ${(1e3 * seconds).toPrecision(4)} ms, ${orbit.turns === 1 ? "1 turn" : `${orbit.turns} turns`}; ` +
      `motion × ${orbit.k}, slowed ${Math.round(SECONDS * orbit.turns / seconds)} times`;
    this.player.onDraw = share => { for (const view of [motion, portrait]) view.dot(share); };
  }

  // The point whose orbit is shown: where there was no room for its own, the nearest one of the table.
  nearest(place, none) {
    if (!none.startsWith("The page does not") || place >= this.data.rows) return place;
    const found = this.data.owner.flatMap((one, n) => one >= 0 && n < this.data.rows ? [n] : []);
    return found.sort((a, b) => Math.abs(a - place) - Math.abs(b - place))[0] ?? place;
  }

  draw(machine, turns, motion, portrait) {
    const {y_m: y, gap_m: gap, y_rate_m_per_s: speed, x_m: x} = machine.columns, count = y.length;
    const closed = (p, q) => Array.from({length: count + 1}, (_, n) => [p(n), q(n % count)]);
    const range = values => { const low = Math.min(...values), high = Math.max(...values), room = 0.06 * (high - low) || 1e-3; return [low - room, high + room]; };
    const mm = values => Array.from(values, value => 1e3 * value), height = mm(y), sideways = Math.max(...x) - Math.min(...x) > 0.02 * (Math.max(...y) - Math.min(...y)) ? mm(x) : null;
    const under = gap && Math.max(...gap) > 0 ? height.map((value, n) => value + 1e3 * gap[n]) : null, turn = n => turns * n / count;
    const curves = [["y", BLUE, height], ["x", "#E69F00", sideways], ["underside", ORANGE, under]].filter(([, , values]) => values)
      .map(([name, colour, values]) => ({name, colour, points: closed(turn, n => values[n])}));
    motion.fill(curves, [0, turns], range([...height, ...(under ?? []), ...(sideways ?? [])]));
    motion.dot = share => motion.put(share, 0.5, true);
    portrait.figure.hidden = Boolean(sideways) && Math.max(...y) - Math.min(...y) < 0.02 * (Math.max(...x) - Math.min(...x));
    const rates = Array.from(speed), [low, high] = range(height), [slow, fast] = range(rates);
    portrait.fill([{name: "speed", colour: BLUE, points: closed(n => height[n % count], n => rates[n])}], [low, high], [slow, fast]);
    portrait.dot = share => { const n = Math.floor(share * count) % count; portrait.put((height[n] - low) / (high - low), (rates[n] - slow) / (fast - slow)); };
  }

  // Floquet multipliers beside the unit circle.
  circle(cells) {
    const value = name => Number(cells.find(([own]) => own === name)?.[2].replace("−", "-") ?? NaN), box = this.aside.querySelector(".circle"), found = [];
    for (let n = 1; Number.isFinite(value(`multiplier_${n}_re`)); n++) found.push([value(`multiplier_${n}_re`), value(`multiplier_${n}_im`) || 0]);
    box.replaceChildren();
    if (!found.length) return;
    const make = (tag, given) => { const made = document.createElementNS("http://www.w3.org/2000/svg", tag); for (const [key, one] of Object.entries(given)) made.setAttribute(key, one); return made; };
    const svg = make("svg", {viewBox: "-1.6 -1.6 3.2 3.2", role: "img", "aria-label": "Multipliers and the unit circle"});
    svg.append(make("path", {d: "M-1.6 0H1.6M0 -1.6V1.6", stroke: "#ddd"}), make("circle", {r: 1, fill: "none", stroke: "#555"}));
    for (const [re, im] of found) {
      const size = Math.hypot(re, im), fit = size > 1.5 ? 1.5 / size : 1;
      svg.append(make("circle", {cx: re * fit, cy: -im * fit, r: 0.07, fill: size > 1 ? ORANGE : BLUE}));
    }
    const largest = Math.max(...found.map(one => Math.hypot(...one)));
    box.append(svg, Object.assign(document.createElement("p"), {className: "hint", textContent: `Floquet multipliers, the largest ${largest.toPrecision(4)}${largest > 1.5 ? "; those far outside stand at the edge" : ""}`}));
  }
}

// Put a dot, or a line across, to shares of the axes.
View.prototype.put = function put(x, y, line = false) {
  this.mark ??= this.on.appendChild(Object.assign(document.createElement("u"), {className: line ? "cursor now" : "now"}));
  Object.assign(this.mark.style, {left: `${100 * x}%`, top: line ? "0" : `${100 * (1 - y)}%`});
};

const studies = [...document.querySelectorAll(".study")].map(section => new Study(section));
for (const study of studies) {
  const first = study.data.owner.findIndex(one => one === 0);
  if (first >= 0) study.pick(first, null);
}

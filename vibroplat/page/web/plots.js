// Curves: a readout that names every one, and zoom by the mouse. A finger scrolls the page, and taps to read.
// Values are read from the paths: there is no other copy of them.

const WIDTH = 10000, HEIGHT = 3000;

function nice(low, high, most, unit) {
  const part = (high - low) / most, power = 10 ** Math.floor(Math.log10(part)), isTurn = unit === "°" && high - low > 180;
  const step = isTurn ? 90 : [1, 2, 5, 10].find(one => one * power >= part * 0.999) * power, places = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const first = Math.ceil(low / step - 1e-6), last = Math.floor(high / step + 1e-6);
  return Array.from({length: last - first + 1}, (_, n) => (first + n) * step).map(value => [value, told(value, unit).toFixed(places)]);
}

// 1, 2 and 5 times powers of ten.
const powers = Array.from({length: 31}, (_, n) => n - 15).flatMap(power => [1, 2, 5].map(step => Number(`${step}e${power}`)));

// An axis: values at shares of the drawing, and shares of values.
function axisOf(text) {
  const [low, high, kind] = text.split(" "), [bend, back] = kind === "log" ? [Math.log, Math.exp] : [x => x, x => x];
  const from = bend(Number(low)), range = bend(Number(high)) - from;
  return {kind, value: share => back(from + share * range), share: value => (bend(value) - from) / range};
}

const minus = text => text.replace(/^-(?=[0.]*$)/, "").replace("-", "−");
const told = (value, unit) => unit === "°" && value > 180 ? value - 360 : value; // as in tables
const digits = (value, range) => minus(value.toFixed(Math.min(9, Math.max(0, 2 - Math.floor(Math.log10(range || 1))))));

class View {
  constructor(figure) {
    this.figure = figure;
    [this.area, this.svg, this.on, this.read, this.cursor, this.pick] = [".area", ".area svg", ".on", "output", ".cursor", ".pick"].map(one => figure.querySelector(one));
    this.shown = [0, 1, 0, 1]; // shares of the axes
    this.area.onpointermove = event => event.pointerType === "mouse" && this.move(event);
    this.area.onpointerdown = event => event.pointerType === "mouse" && !event.button && this.begin(event);
    this.area.onpointerup = event => this.end(event);
    this.area.onclick = event => this.show(event);
    this.area.onpointerleave = () => { this.cursor.hidden = true; this.read.textContent = ""; };
    this.area.ondblclick = () => this.zoom([0, 1, 0, 1]);
  }

  axis(name) { return axisOf(this.figure.dataset[name]); }

  // Curves by their names, as points in shares of the axes.
  curves() {
    const numbers = part => part.replace(/h0/g, " ").match(/-?\d+/g).map(Number);
    return this.known ??= [...this.svg.querySelectorAll("[data-n]")].map(path => ({path, parts: path.getAttribute("d").split("M").slice(1).map(part => {
      let x = 0, y = 0;
      const found = numbers(part), points = [];
      for (let n = 0; n < found.length; n += 2) points.push([(x += found[n]) / WIDTH, 1 - (y += found[n + 1]) / HEIGHT]);
      return points;
    })}));
  }

  place(event) {
    const {left, top, width, height} = this.area.getBoundingClientRect(), inside = share => Math.min(1, Math.max(0, share));
    return [inside((event.clientX - left) / width), inside(1 - (event.clientY - top) / height)];
  }

  // Values of a curve at a share of the axis; the one nearest to another share of the vertical axis.
  at(parts, x, y) {
    const found = parts.flatMap(points => points.slice(1).flatMap(([b, d], n) => {
      const [a, c] = points[n];
      return (a <= x && x <= b) || (b <= x && x <= a) ? [b === a ? d : c + (d - c) * (x - a) / (b - a)] : [];
    }));
    return found.sort((p, q) => Math.abs(p - y) - Math.abs(q - y));
  }

  show(event) {
    const [left, up] = this.place(event), [x0, x1, y0, y1] = this.shown, x = x0 + left * (x1 - x0), y = y0 + up * (y1 - y0);
    const across = this.axis("x"), vertical = this.axis("y"), {u: unit, xu} = this.figure.dataset;
    const number = share => digits(told(vertical.value(share), unit), Math.abs(vertical.value(y1) - vertical.value(y0)));
    Object.assign(this.cursor, {hidden: false}).style.left = `${100 * left}%`;
    this.read.textContent = `${digits(across.value(x), Math.abs(across.value(x1) - across.value(x0)) / 10)} ${xu}`;
    for (const {path, parts} of this.curves()) {
      const kind = path.classList[0];
      const near = kind === "dots" ? parts.flat().filter(([a, b]) => Math.abs(a - x) < 0.02 * (x1 - x0) && Math.abs(b - y) < 0.05 * (y1 - y0)).slice(0, 1).map(one => one[1]) : this.at(parts, x, y);
      if (!near.length) continue;
      const told = kind === "band" ? `${number(Math.min(...near))} … ${number(Math.max(...near))}` : number(near[0]);
      const name = document.createElement("em");
      name.style.color = path.style.stroke;
      name.textContent = ` ${path.dataset.n} ${told} ${unit}`;
      this.read.append(name);
    }
  }

  begin(event) {
    this.from = this.place(event);
    this.area.setPointerCapture(event.pointerId);
  }

  box(event) {
    const [a, c] = this.from, [b, d] = this.place(event), rest = this.axis("y").kind === "names" || Math.abs(d - c) < 0.15;
    return [Math.min(a, b), Math.max(a, b), ...(rest ? [0, 1] : [Math.min(c, d), Math.max(c, d)])];
  }

  move(event) {
    this.show(event);
    if (!this.from) return;
    const [a, b, c, d] = this.box(event);
    this.pick.hidden = b - a < 0.02;
    Object.assign(this.pick.style, {left: `${100 * a}%`, width: `${100 * (b - a)}%`, top: `${100 * (1 - d)}%`, height: `${100 * (d - c)}%`});
  }

  end(event) {
    if (!this.from) return;
    const [a, b, c, d] = this.box(event), [x0, x1, y0, y1] = this.shown;
    this.area.dataset.dragged = b - a >= 0.02 ? "yes" : "";
    if (b - a >= 0.02) this.zoom([x0 + a * (x1 - x0), x0 + b * (x1 - x0), y0 + c * (y1 - y0), y0 + d * (y1 - y0)]);
    this.from = null;
    this.pick.hidden = true;
  }

  zoom(shown) {
    const [a, b, c, d] = this.shown = shown, whole = b - a === 1 && d - c === 1;
    this.svg.setAttribute("viewBox", `${a * WIDTH} ${(1 - d) * HEIGHT} ${(b - a) * WIDTH} ${(d - c) * HEIGHT}`);
    Object.assign(this.on.style, {left: `${-100 * a / (b - a)}%`, width: `${100 / (b - a)}%`, top: `${-100 * (1 - d) / (d - c)}%`, height: `${100 / (d - c)}%`});
    this.figure.classList.toggle("zoomed", !whole);
    this.ticks("x", a, b, 6);
    this.ticks("y", c, d, 5);
  }

  // Numbers of an axis between two shares, anew.
  ticks(name, from, to, most) {
    const axis = this.axis(name), up = name === "y", [low, high] = [axis.value(from), axis.value(to)];
    if (axis.kind === "names") return;
    const found = axis.kind === "log" && high > 3 * low ? powers.filter(value => value >= low && value <= high).map(value => [value, String(value)])
      : nice(Math.min(low, high), Math.max(low, high), most, up ? this.figure.dataset.u : "");
    const place = value => (axis.share(value) - from) / (to - from);
    for (const old of this.area.querySelectorAll(`.${name}t`)) old.remove();
    for (const [value, text] of found) {
      const made = Object.assign(document.createElement("span"), {className: `${name}t`, textContent: minus(text)});
      made.style[up ? "top" : "left"] = `${100 * (up ? 1 - place(value) : place(value))}%`;
      this.area.append(made);
    }
    if (up) this.svg.querySelector(".grid").setAttribute("d", found.map(([value]) => `M0 ${(1 - axis.share(value)) * HEIGHT}h${WIDTH}`).join(""));
  }

  // Other curves: lists of points in the units of the axes, with colours and names.
  fill(curves, x, y) {
    this.known = null;
    Object.assign(this.figure.dataset, {x: `${x[0]} ${x[1]} even`, y: `${y[0]} ${y[1]} even`});
    this.svg.querySelectorAll(".curve").forEach(path => path.remove());
    for (const {name, colour, points} of curves) {
      const path = document.createElementNS("http://www.w3.org/2000/svg", "path");
      let [a, b] = [0, 0];
      const d = points.map(([p, q], n) => {
        const [c, e] = [Math.round((p - x[0]) / (x[1] - x[0]) * WIDTH), Math.round((y[1] - q) / (y[1] - y[0]) * HEIGHT)];
        const step = n ? `${c - a} ${e - b} ` : `M${c} ${e}l`;
        [a, b] = [c, e];
        return step;
      }).join("");
      for (const [key, value] of Object.entries({class: "curve", "data-n": name, style: `stroke:${colour};stroke-width:1.5`, d})) path.setAttribute(key, value);
      this.svg.append(path);
    }
    this.zoom([0, 1, 0, 1]);
  }
}

const views = new Map([...document.querySelectorAll(".plot")].map(figure => [figure, new View(figure)]));

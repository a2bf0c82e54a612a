// Words, numbers and elements. Text from files becomes text nodes, never HTML.

// Okabe and Ito: told apart by colour-blind people as well.
const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"];
const DASHES = ["solid", "dash", "dot", "dashdot", "longdash"];
const FONT = {family: "system-ui, sans-serif", size: 12, color: "#222"};
const byId = id => document.getElementById(id);

function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

function drawn(tag, attributes = {}, parent = null) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  set(made, attributes);
  if (parent) parent.append(made);
  return made;
}

function set(node, attributes) {
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
}

// A value as a person reads it: six digits at most.
function shown(value, digits = 6) {
  if (value === null || value === undefined) return "–";
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (typeof value !== "number") return String(value);
  if (value !== 0 && (Math.abs(value) < 1e-4 || Math.abs(value) >= 1e7)) {
    const [mantissa, exponent] = value.toExponential(Math.min(digits, 4) - 1).split("e");
    return `${Number(mantissa)}·10${superscript(Number(exponent))}`.replace("-", "−");
  }
  return String(Number(value.toPrecision(digits))).replace("-", "−");
}

const superscript = number => String(number).replace(/./g, digit => "⁰¹²³⁴⁵⁶⁷⁸⁹"[digit] || "⁻");
const withUnit = (text, unit) => unit ? `${text} (${unit})` : text;
// Plotly reads a few tags in its texts.
const plain = text => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");

// Draw a figure. Its box gets the height of the figure, which Plotly takes from it when the window changes.
function figure(box, traces, layout, config = CONFIG) {
  box.style.height = `${layout.height}px`;
  return Plotly.react(box, traces, layout, config);
}

// A piece of line as in the figures.
function sample(colour, dash) {
  const patterns = {solid: "", dash: "5 3", dot: "1.5 2.5", dashdot: "5 2 1.5 2", longdash: "8 3"};
  const box = drawn("svg", {width: 22, height: 8, class: "sample", "aria-hidden": "true"});
  const line = {x1: 0, y1: 4, x2: 22, y2: 4, stroke: colour, "stroke-width": 2.2, "stroke-dasharray": patterns[dash]};
  drawn("line", line, box);
  return box;
}

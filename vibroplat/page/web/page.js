// Puts the page together.

const data = JSON.parse(byId("data").textContent);
//: Height of a figure that a sheet of paper has room for, below a heading and the strip (px).
const SHEET = 760;
const several = data.results.length > 1;
const nameOf = number => data.results[number].label;
// How a result differs from the others of its command.
const differs = number => element("small", {}, data.results[number].differs && ` ${data.results[number].differs}`);

function legend(runs) {
  const box = byId("legend");
  box.hidden = runs.length < 2;
  box.append(...runs.map(run => element("li", {}, sample(run.colour, run.dash), run.label, differs(run.result))));
}

async function motion() {
  const runs = data.runs.map((run, number) => ({...opened(run), label: nameOf(run.result),
    colour: COLOURS[number % COLOURS.length], dash: DASHES[number % DASHES.length]}));
  if (!runs.length) return null;
  byId("motion").hidden = false;
  legend(runs);
  const largest = Math.max(0, ...runs.map(run => (run.columns.contact_force_n || [])
    .reduce((size, force) => Math.max(size, force), 0)));
  const machines = runs.map(run => new Machine(run, largest));
  for (const machine of machines) {
    const caption = runs.length > 1 ? [element("figcaption", {}, machine.run.label)] : [];
    byId("machines").append(element("figure", {}, machine.svg, ...caption));
  }
  let player = null;
  const curves = new Curves(data, runs, t => { player.pauseAt(t); });
  await curves.draw();
  player = new Player(runs, machines, curves);
  await new Overview(curves).draw();
  views(curves);
  notes(runs);
  window.addEventListener("resize", () => requestAnimationFrame(() => player.fit()));
  player.fit();
  return player;
}

function views(curves) {
  for (const [text, view] of [[`Last ${data.turns} turns`, curves.lastTurns()], ["Whole run", curves.whole]]) {
    const button = element("button", {type: "button"}, text);
    button.addEventListener("click", () => curves.show(view));
    byId("views").append(button);
  }
}

function notes(runs) {
  byId("motion-note").textContent = "Displacements, the gap and the rotation are magnified alike, by the number above; " +
    "exciters and their radii are to scale, layers and springs are symbols. The red arrow is the contact force, to the " +
    "scale of its largest value; a yellow flash is an impact with its impulse.";
  const told = runs.filter(run => !run.isWhole).map(run => `${several ? `${run.label}: the` : "The"} machine moves, and curves ` +
    `have all samples, from ${shown(run.origin)} to ${shown(run.end)} s; elsewhere the curves keep the smallest and the ` +
    "largest value of each thousandth of the run.");
  const all = [`All samples of the ${several ? "runs" : "run"} are on this page.`];
  byId("curves-note").append(element("span", {class: "screen"}, "Drag over the strip to choose an interval, over a panel to " +
    "zoom; double-click for the whole run; click a curve or drag the cursor to move through time. "),
  `Numbers above a panel: values at the cursor. ${(told.length ? told : all).join(" ")}`);
}

function tables() {
  for (const table of data.tables) {
    const title = table.title[0].toUpperCase() + table.title.slice(1), label = nameOf(table.result);
    const pick = number => player?.visit(table.columns.find(column => column.name === "t_s").values[number]);
    const made = new Table(table, several ? `${title}: ${label}` : title, `${label}-${table.title}.csv`, pick);
    byId("tables").append(element("section", {class: "events"}, made.box));
  }
}

async function figures() {
  const all = data.pictures.map((one, number) => new Picture(one, nameOf(one.result), number, data.pictures.length > 1));
  for (const figure of all) {
    byId("points").append(figure.section);
    await figure.draw();
  }
  return all;
}

// While the page is printed, figures have the width of the sheet and are not higher than it.
function printing(studies) {
  const print = isOn => {
    document.body.classList.toggle("printing", isOn);
    const boxes = [...document.querySelectorAll(".figure")].filter(box => box.data);
    for (const box of boxes) box.style.zoom = "";
    for (const study of studies) study.print?.(isOn);
    for (const box of boxes) {
      const zoom = isOn ? Math.min(1, SHEET / box.offsetHeight) : 1;
      box.style.zoom = zoom === 1 ? "" : zoom;
      Plotly.relayout(box, {width: isOn ? box.parentNode.clientWidth / zoom : null, autosize: !isOn});
    }
    if (player) player.fit();
  };
  window.addEventListener("beforeprint", () => print(true));
  window.addEventListener("afterprint", () => print(false));
}

let player = null;

// The library of the curves is packed: as it is, it would be most of the page.
async function library() {
  const packed = Uint8Array.from(atob(byId("library").textContent), letter => letter.charCodeAt(0));
  const opened = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  document.head.append(element("script", {}, await new Response(opened).text()));
}

async function build() {
  byId("fault").hidden = "DecompressionStream" in window;
  if (!byId("fault").hidden) return;
  await library();
  byId("footer").textContent = "Made by vibroplat report; the curves are drawn by plotly.js.";
  player = await motion();
  tables();
  printing(await figures());
  // For tests.
  window.vibroplat = {data, player};
  document.documentElement.dataset.ready = "true";
}

// Whoever prints a page without a window does so when it is loaded: an open document inside lets it wait until it is built.
const waiting = element("iframe", {hidden: ""});
document.body.append(waiting);
waiting.contentDocument.open();
build().finally(() => { waiting.contentDocument.close(); waiting.remove(); });

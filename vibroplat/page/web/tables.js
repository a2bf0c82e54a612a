// Tables: sorted by a click on a heading, read page by page, saved as CSV.

const PAGE = 14;
// Columns that a sheet of paper has room for, as in the style.
const PRINTED = 12;

class Table {
  // onPick is called with the number of a row that a person has picked.
  constructor(data, heading, file, onPick = null) {
    this.data = data;
    this.onPick = onPick;
    this.order = Array.from({length: data.rows}, (_, row) => row);
    this.sorted = {column: null, falling: false};
    this.first = 0;
    this.picked = null;
    this.body = element("tbody");
    this.heads = data.columns.map((column, number) => this.head(column, number));
    this.place = element("span", {class: "place", "aria-live": "polite"});
    const table = element("table", {class: "rows"}, element("thead", {}, element("tr", {}, ...this.heads)), this.body);
    const buttons = [
      this.button("‹", "rows before", () => this.turn(-PAGE)),
      this.place,
      this.button("›", "rows after", () => this.turn(PAGE)),
      this.button("Save as CSV", "Save as CSV", () => save(this.csv(), file)),
    ];
    this.box = element("div", {class: "table"}, element("h3", {}, heading), element("div", {class: "wide"}, table),
      element("div", {class: "buttons"}, ...buttons));
    if (data.columns.length > PRINTED) this.box.append(element("p", {class: "hint paper"},
      `On paper: the first ${PRINTED} of ${data.columns.length} columns.`));
    if (data.rows < data.of) this.box.append(element("p", {class: "hint"},
      `The page holds ${data.rows} of ${data.of} rows, evenly chosen; the result table holds all of them.`));
    this.fill();
  }

  button(text, label, action) {
    const made = element("button", {type: "button", "aria-label": label}, text);
    made.addEventListener("click", action);
    return made;
  }

  head(column, number) {
    const text = element("button", {type: "button", title: column.name}, withUnit(column.words, column.unit));
    text.addEventListener("click", () => this.sort(number));
    return element("th", {scope: "col", "aria-sort": "none"}, text);
  }

  sort(column) {
    this.sorted = {column, falling: this.sorted.column === column && !this.sorted.falling};
    const values = this.data.columns[column].values;
    const sign = this.sorted.falling ? -1 : 1;
    this.order.sort((a, b) => compared(values[a], values[b], sign) || a - b);
    this.heads.forEach((head, number) => head.setAttribute("aria-sort",
      number !== column ? "none" : this.sorted.falling ? "descending" : "ascending"));
    this.first = 0;
    this.fill();
  }

  turn(rows) {
    const last = Math.max(0, Math.floor((this.data.rows - 1) / PAGE) * PAGE);
    this.first = Math.min(Math.max(this.first + rows, 0), last);
    this.fill();
  }

  // Turn to a row and mark it.
  pick(row) {
    this.picked = row;
    this.first = Math.floor(this.order.indexOf(row) / PAGE) * PAGE;
    this.fill();
  }

  fill() {
    const rows = this.order.slice(this.first, this.first + PAGE);
    this.body.replaceChildren(...rows.map(row => this.row(row)));
    const last = Math.min(this.first + PAGE, this.data.rows);
    this.place.textContent = this.data.rows ? `${this.first + 1}–${last} of ${this.data.rows}` : "no rows";
  }

  row(number) {
    const cells = this.data.columns.map(column => {
      const value = column.values[number];
      return element("td", {class: typeof value === "string" ? "word" : "number"}, shown(inUnit(column, value)));
    });
    const made = element("tr", {"data-row": number}, ...cells);
    if (number === this.picked) made.className = "picked";
    if (this.onPick) {
      made.tabIndex = 0;
      made.addEventListener("click", () => this.onPick(number));
      made.addEventListener("keydown", event => this.key(event, made, number));
    }
    return made;
  }

  key(event, row, number) {
    const next = {ArrowDown: row.nextSibling, ArrowUp: row.previousSibling}[event.key];
    if (next) next.focus();
    if (event.key === "Enter") this.onPick(number);
    if (next || event.key === "Enter") event.preventDefault();
  }

  csv() {
    const quoted = value => {
      const text = value === null ? "" : String(value);
      return /[",\n\r]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text;
    };
    const lines = [this.data.columns.map(column => column.name)];
    for (const row of this.order) lines.push(this.data.columns.map(column => column.values[row]));
    return lines.map(line => line.map(quoted).join(",")).join("\n") + "\n";
  }
}

// A value of a column in the unit that is shown.
const inUnit = (column, value) => typeof value === "number" ? column.factor * value : value;

// What is missing comes last, however a table is sorted.
function compared(a, b, sign) {
  if (a === null || b === null) return (a === null) - (b === null);
  return sign * (a < b ? -1 : a > b ? 1 : 0);
}

function save(text, file) {
  const address = URL.createObjectURL(new Blob([text], {type: "text/csv"}));
  element("a", {href: address, download: file}).click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}

// Tables: sorted by a click on a heading.

const number = text => text === "–" ? NaN : Number(text.replace("−", "-"));

for (const table of document.querySelectorAll("table.rows")) {
  let sorted = null, sign = 1;
  table.tHead.addEventListener("click", event => {
    const head = event.target.closest("th"), body = table.tBodies[0];
    if (!head) return;
    [sorted, sign] = [head, sorted === head ? -sign : 1];
    const place = head.cellIndex, of = row => row.cells[place].textContent, isMissing = text => text === "–";
    const compared = (a, b) => isMissing(a) - isMissing(b) || sign * (Number.isNaN(number(a)) || Number.isNaN(number(b)) ? a.localeCompare(b) : number(a) - number(b));
    body.append(...[...body.rows].map(row => [of(row), row]).sort((a, b) => compared(a[0], b[0])).map(([, row]) => row));
    for (const one of table.tHead.rows[0].cells) one.setAttribute("aria-sort", one !== head ? "none" : sign > 0 ? "ascending" : "descending");
  });
}

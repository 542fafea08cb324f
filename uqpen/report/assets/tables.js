// Tables: sorted by a column, and saved as comma-separated values.

const NUMBER = /^[^\d+\-−.]*([+\-−]?\d[\d\u202f\u00a0]*(?:\.\d+)?)(?:e([+-]?\d+)|\s?×\s?10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+))?/;

// The first number of a cell; NaN where there is none.
function cellNumber(text) {
  const found = text.match(NUMBER);
  if (!found) return NaN;
  const powers = [...(found[3] ?? "")].map((each) => "-0123456789"["⁻⁰¹²³⁴⁵⁶⁷⁸⁹".indexOf(each)]).join("");
  return Number(`${found[1].replace(/[\u202f\u00a0]/g, "").replace("−", "-")}e${found[2] ?? (powers || 0)}`);
}

// Cells without a number come last, either way.
function compared(one, other, direction) {
  const [a, b] = [cellNumber(one), cellNumber(other)];
  if (Number.isNaN(a) && Number.isNaN(b)) return direction * one.localeCompare(other, "en", { numeric: true });
  if (Number.isNaN(a) || Number.isNaN(b)) return Number.isNaN(a) ? 1 : -1;
  return direction * (a - b);
}

// A third press puts the rows back into the order of the study.
function sortable(table) {
  const body = table.tBodies[0];
  const rows = [...body.rows];
  if (rows.length < 3) return;
  const heads = [...table.tHead.rows[0].cells].filter((cell) => cell.localName === "th");
  for (const head of heads) {
    const button = made("button", { type: "button", class: "sort" }, ...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const before = head.getAttribute("aria-sort");
      heads.forEach((each) => each.removeAttribute("aria-sort"));
      const order = { ascending: "descending", descending: null }[before] ?? (before === null ? "ascending" : null);
      if (order) head.setAttribute("aria-sort", order);
      const direction = order === "descending" ? -1 : 1;
      const at = (row) => row.cells[head.cellIndex].textContent.trim();
      body.append(...(order ? [...rows].sort((one, other) => compared(at(one), at(other), direction)) : rows));
    });
  }
}

// A text that a spreadsheet would take for a formula is quoted for it.
function csvCell(text) {
  const isFormula = /^[=+\-@\t\r]/.test(text) && Number.isNaN(Number(text));
  const safe = isFormula ? `'${text}` : text;
  return /[",\r\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
}

const fileName = (title, ending) => {
  const words = `${study} ${title}`.normalize("NFKD").toLowerCase().match(/[a-z0-9]+/g) ?? ["uqpen"];
  return `${words.join("-").slice(0, 80)}.${ending}`;
};

function saveFile(name, content, type) {
  const link = made("a", { href: URL.createObjectURL(new Blob([content], { type })), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

// With the mark that spreadsheets know the encoding by.
function saveCsv(title, rows) {
  const text = rows.map((row) => row.map(csvCell).join(",")).join("\r\n");
  saveFile(fileName(title, "csv"), `\ufeff${text}\r\n`, "text/csv;charset=utf-8");
}

const tableRows = (table) => [...table.rows].map(
  (row) => [...row.cells].map((cell) => cell.textContent.trim().replace(/\u202f/g, " ")),
);

for (const table of document.querySelectorAll("main table")) {
  if (!table.tHead) continue;
  const title = table.caption.textContent;
  const save = made("button", { type: "button", "aria-label": `Save as CSV: ${title}` }, "CSV");
  save.addEventListener("click", () => saveCsv(title, tableRows(table)));
  table.closest(".table")?.append(made("p", { class: "tools" }, save));
  sortable(table);
}

// What the selected runs have in common, as a sentence and a table; and any two quantities against
// each other. Without a selection these are the runs beyond a threshold.

const median = (values) => {
  const sorted = [...values].sort((one, other) => one - other);
  const middle = sorted.length >> 1;
  return sorted.length % 2 ? sorted[middle] : (sorted[middle - 1] + sorted[middle]) / 2;
};

// The places of values among all of them, equal ones in the middle of theirs.
function ranked(values) {
  const order = values.map((_, place) => place).sort((one, other) => values[one] - values[other]);
  const ranks = Array(values.length);
  for (let first = 0; first < order.length;) {
    let last = first;
    while (values[order[last + 1]] === values[order[first]]) last += 1;
    for (let place = first; place <= last; place += 1) ranks[order[place]] = (first + last) / 2 + 1;
    first = last + 1;
  }
  return ranks;
}

// The share of pairs, one of either group, in which that of the first has the larger value.
function larger(values, isFirst) {
  const ranks = ranked(values);
  const count = isFirst.filter(Boolean).length;
  const sum = ranks.reduce((total, rank, place) => total + (isFirst[place] ? rank : 0), 0);
  return (sum - (count * (count + 1)) / 2) / (count * (values.length - count));
}

// The strongest rank correlation of two inputs; where all are weak, the first two.
function strongestPair(inputs) {
  const ranks = inputs.map(({ values }) => ranked(values));
  const size = ranks[0]?.length ?? 0;
  const centred = ranks.map((each) => each.map((rank) => rank - (size + 1) / 2));
  const product = (one, other) => one.reduce((sum, value, place) => sum + value * other[place], 0);
  const norms = centred.map((each) => Math.sqrt(product(each, each)) || 1);
  let best = [3 / Math.sqrt(size), 0, Math.min(1, inputs.length - 1)];
  for (let i = 0; i < inputs.length; i += 1) {
    for (let j = i + 1; j < inputs.length; j += 1) {
      const strength = Math.abs(product(centred[i], centred[j])) / (norms[i] * norms[j]);
      if (strength > best[0]) best = [strength, i, j];
    }
  }
  return [inputs[best[1]], inputs[best[2]]];
}

// The runs that a summary is of, and in words what they have in common.
function group(table) {
  if (hasRange(table)) {
    const parts = [...ranges].filter(([key]) => table.columns.has(key)).map(([key, [lower, upper]]) => {
      const column = table.columns.get(key);
      if (!column.rows) return `${column.label} ${measured(column, `${numberText(lower)} … ${numberText(upper)}`)}`;
      return column.rows.filter((_, row) => row >= lower && row <= upper).join(", ");
    });
    return { isIn: selected(table), what: `have ${parts.join(" and ")}`, name: "selected" };
  }
  const at = thresholds.get(leading);
  const column = table.columns.get(leading);
  if (at === undefined || column === undefined) return undefined;
  return {
    isIn: beyond(table, leading), name: "beyond",
    what: `have ${column.label} above ${forms.find((form) => form.key === leading).said(at)}`,
  };
}

// How far two groups differ; not at all where one is empty.
const difference = (share) => (Number.isFinite(share) ? Math.abs(share - 0.5) : 0);

function comparison(table, isIn) {
  const outside = isIn.map((each) => !each);
  const sizes = [isIn, outside].map((each) => each.filter(Boolean).length);
  const noise = Math.sqrt((isIn.length + 1) / (12 * sizes[0] * sizes[1]));
  return table.traces.filter(({ is_input: isInput }) => isInput).map((column) => {
    const parts = [isIn, outside].map((mask) => column.values.filter((_, run) => mask[run]));
    const share = sizes[0] && sizes[1] ? larger(column.values, isIn) : NaN;
    return {
      column, share, medians: parts.map((each) => (each.length ? numberText(median(each)) : "–")),
      ends: parts[0].length ? `${numberText(Math.min(...parts[0]))} … ${numberText(Math.max(...parts[0]))}` : "–",
      isClear: difference(share) > Math.max(0.1, 3 * noise),
    };
  }).sort((one, other) => difference(other.share) - difference(one.share));
}

function sentence(table, { isIn, what }, found) {
  const count = isIn.filter(Boolean).length;
  const lost = hasRange(table) ? selected(table, true).filter(Boolean).length : 0;
  const failures = lost ? ` So do ${grouped(lost)} of the ${grouped(table.failed.length)} failed runs shown.` : "";
  const head = `${grouped(count)} of the ${grouped(isIn.length)} completed runs shown ${what}.${failures}`;
  if (!count || count === isIn.length) return head;
  // What is selected by an input differs in it.
  const clear = found.filter(({ column, isClear }) => isClear && !ranges.has(keyOf(column.of))).slice(0, 3);
  if (!clear.length) return `${head} No other input differs clearly from that of the other runs.`;
  const texts = clear.map(({ column, share, medians }) =>
    `${share > 0.5 ? "larger" : "smaller"} ${column.label} ` +
    `(median ${measured(column, medians[0])} against ${medians[1]})`);
  return `${head} Most different from the others: ${texts.join(", ")}.`;
}

function summaryTable(found) {
  const heads = ["median of these", "their range", "median of the others", "P(larger)"];
  const head = made("thead", {}, made("tr", {}, made("td"), ...heads.map((text) => made("th", { scope: "col" }, text))));
  const rows = found.map(({ column, medians, ends, share }) => {
    const cells = [medians[0], ends, medians[1], Number.isFinite(share) ? share.toFixed(2) : "–"];
    return made("tr", {}, made("th", { scope: "row" }, titleOf(column)), ...cells.map((text) => made("td", {}, text)));
  });
  const caption = made("caption", {}, "Inputs of these runs");
  return made("table", {}, caption, head, made("tbody", {}, ...rows));
}

// The selected runs with all their values, as lines of cells.
function runRows(table, isIn) {
  const head = ["run", ...table.traces.map(titleOf)];
  const cell = (column, run) => (column.rows ? column.rows[Math.round(column.values[run])] : column.values[run]);
  const kept = table.completed.flatMap((_, run) => (isIn[run] ? [run] : []));
  return [head, ...kept.map((run) => [table.completed[run], ...table.traces.map((column) => cell(column, run))].map(String))];
}

function summary(figure, table) {
  const told = made("p", { "aria-live": "polite", class: "told" });
  const free = made("button", { type: "button" }, "Select all runs");
  const out = made("button", { type: "button" }, "CSV of these runs");
  const scroll = made("div", { class: "scroll", role: "group", "aria-label": "Inputs of these runs" });
  const fold = made("details", {}, made("summary", {}, "How their inputs differ"), made("div", { class: "table" }, scroll), made("p", { class: "notes" },
    "Counts of the runs shown, not estimates, so without intervals. P(larger): the share of pairs " +
    "in which one of these runs has a larger value than another run; 0.5 where they do not differ."));
  figure.querySelector(".told-runs").append(told, made("p", { class: "buttons" }, free, out), fold);
  free.addEventListener("click", clearRanges);
  let current;
  out.addEventListener("click", () => saveCsv(`runs ${current.name}`, runRows(table, current.isIn)));
  return () => {
    current = group(table);
    free.disabled = !hasRange(table);
    out.disabled = current === undefined;
    if (!current) return;
    const found = comparison(table, current.isIn);
    told.textContent = sentence(table, current, found);
    scroll.replaceChildren(summaryTable(found));
  };
}

// A list of what to choose from; `chosen` is the key that it begins with.
function choice(label, table, chosen, isWanted = () => true) {
  const select = made("select");
  for (const [key, column] of table.columns) {
    if (isWanted(key)) select.append(made("option", { value: key, ...(key === chosen ? { selected: "" } : {}) }, titleOf(column)));
  }
  return [made("label", {}, `${label} `, select), select];
}

// A chart of two quantities that a reader chooses, drawn and followed as the others are.
function pairChart(figure, table) {
  const inputs = table.traces.filter(({ is_input: isInput }) => isInput);
  const [one, other] = inputs.length ? strongestPair(inputs) : [table.traces[0], table.traces[0]];
  const chosen = [choice("Across", table, keyOf(one.of)), choice("Upward", table, keyOf(other.of))];
  const number = charts.length;
  const plot = made("div", { class: "plot", role: "img", "data-chart": number, id: `plot-${number}`, style: "height: 340px" });
  figure.querySelector(".pair").append(made("p", { class: "buttons" }, ...chosen.map(([label]) => label)), plot);
  function content() {
    const [x, y] = chosen.map(([, select]) => table.columns.get(select.value));
    const axisOf = (column) => {
      const [first, last] = endsOf(column).map((end) => alongAxis(column, end));
      const margin = column.rows ? 0 : 0.03 * (last - first);
      const type = column.is_logarithmic ? { type: "log" } : {};
      const rows = column.rows ? { tickvals: column.rows.map((_, row) => row), ticktext: column.rows.map(escaped) } : {};
      return { title: { text: escaped(titleOf(column)) }, of: column.of, range: [first - margin, last + margin], ...rows, ...type };
    };
    const points = (member, marker, text) => ({
      type: "scatter", mode: "markers", x: x[member], y: y[member], marker,
      customdata: member === "values" ? table.completed : table.failed,
      hovertemplate: `${text} %{customdata}<br>${escaped(x.label)} %{x:.4~g}<br>${escaped(y.label)} %{y:.4~g}<extra></extra>`,
    });
    const drawnTraces = [points("values", { color: table.series, symbol: "circle", size: 4, opacity: 0.55 }, "run")];
    if (x.is_input && y.is_input && table.failed.length) {
      drawnTraces.push(points("failed", { color: "ink", symbol: "x", size: 6, opacity: 0.8 }, "failed run"));
    }
    plot.setAttribute("aria-label", `${x.label} and ${y.label}, run by run.`);
    return { traces: drawnTraces, shapes: [], x: axisOf(x), y: axisOf(y), height: 340, hovermode: "closest", runs: table.model };
  }
  charts.push(content());
  chosen.forEach(([, select]) => select.addEventListener("change", () => {
    charts[number] = content();
    draw(plot);
  }));
}

// Which of several outputs' thresholds colours the runs.
function colouring(figure, table) {
  const keys = [...table.columns.keys()].filter((key) => thresholds.has(key));
  if (keys.length < 2) return () => {};
  const [label, select] = choice("Coloured: runs above the threshold of", table, leading, (key) => keys.includes(key));
  figure.querySelector(".told-runs").append(made("p", { class: "buttons" }, label));
  select.addEventListener("change", () => moveThreshold(select.value, thresholds.get(select.value)));
  return () => { if (keys.includes(leading)) select.value = leading; };
}

for (const figure of document.querySelectorAll(".explorer")) {
  const table = runTables[figure.dataset.runs];
  const parts = [parallelCoordinates, colouring, summary].map((part) => part(figure, table));
  pairChart(figure, table);
  const showAll = () => parts.forEach((part) => part());
  followers.push(showAll);
  showAll();
}

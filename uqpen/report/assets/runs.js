// The runs that are drawn: which of them lie beyond a threshold, and which are selected.

const SELECTED = { opacity: 0.85, size: 5 };
const OTHER = { opacity: 0.1, size: 4 };

for (const table of runTables) {
  table.columns = new Map(table.traces.map((column) => [keyOf(column.of), column]));
}
const titleOf = ({ label, unit }) => (unit ? `${label} [${unit}]` : label);
const measured = ({ unit }, text) => (unit ? `${text} ${unit}` : text);
const tableOf = (chart) => runTables.find((table) => table.model === chart.runs);

// Whether each run lies beyond the threshold of an output; none does without a threshold.
function beyond(table, key) {
  const at = thresholds.get(key);
  const values = table.columns.get(key)?.values;
  return table.completed.map((_, run) => at !== undefined && values !== undefined && values[run] > at);
}

// Whether each run lies in all ranges; a failed run has no outputs.
function selected(table, isFailed = false) {
  const [numbers, member] = isFailed ? [table.failed, "failed"] : [table.completed, "values"];
  const kept = [...ranges].filter(([key]) => table.columns.has(key));
  return numbers.map((_, run) => kept.every(([key, [lower, upper]]) => {
    const value = table.columns.get(key)[member][run];
    return value !== undefined && value !== null && value >= lower && value <= upper;
  }));
}

const hasRange = (table) => [...ranges.keys()].some((key) => table.columns.has(key));

// The threshold that colours the runs of a chart: that of an axis, or else the last that was moved.
function colouringKey(chart) {
  const own = [keyOf(chart.y.of), keyOf(chart.x.of)];
  return own.find((key) => thresholds.has(key)) ?? leading;
}

// Markers of the completed runs, which are the first trace, or of the failed ones.
function runMarkers(style, chart, place) {
  const table = tableOf(chart);
  const { marker } = chart.traces[place];
  if (table === undefined || place > 1) return {};
  const isIn = selected(table, place === 1);
  const isBeyond = place === 1 ? [] : beyond(table, colouringKey(chart));
  const isOne = hasRange(table);
  const look = (member) => isIn.map((isKept, run) => {
    if (isOne) return (isKept ? SELECTED : OTHER)[member];
    return isBeyond[run] ? SELECTED[member] : marker[member];
  });
  const [plain, striking] = [looked(style, marker.color), looked(style, "beyond")];
  return {
    color: isIn.map((_, run) => (isBeyond[run] ? striking : plain)),
    opacity: look("opacity"), size: look("size"),
  };
}

// Draws again what a change moved: the line of a threshold, the colours of runs.
function follow(plot) {
  if (!plot.dataset.drawn || plot.dataset.chosen === String(version)) return;
  const chart = charts[plot.dataset.chart];
  plot.dataset.chosen = version;
  if (chart.x.of === undefined && chart.y.of === undefined) return;
  const style = getComputedStyle(root);
  const shapes = coloured(style, [...chart.shapes, ...chosenShapes(chart)]);
  if (chart.runs === undefined) {
    Plotly.relayout(plot, { shapes });
    return;
  }
  const found = chart.traces.map((_, place) => runMarkers(style, chart, place));
  const restyled = { selectedpoints: found.map(() => null) };
  for (const member of ["color", "opacity", "size"]) {
    restyled[`marker.${member}`] = found.map((each) => each[member]);
  }
  Plotly.update(plot, restyled, { shapes, selections: [] }, found.map((_, place) => place));
}

// A rectangle that is drawn over runs selects them; a double click lets go.
function selectByPointer(plot) {
  const { x, y } = charts[plot.dataset.chart];
  plot.on("plotly_selected", (event) => {
    if (!event?.range) return;
    selectRange(keyOf(x.of), event.range.x);
    selectRange(keyOf(y.of), event.range.y);
  });
  plot.on("plotly_deselect", () => [x, y].forEach((each) => selectRange(keyOf(each.of))));
}

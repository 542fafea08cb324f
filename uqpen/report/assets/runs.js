// The runs that are drawn: which of them lie beyond a threshold, and which are selected.

// Opacities where some runs are told from the others.
const [IN_FRONT, BEHIND] = [0.85, 0.1];

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

// Colours and opacities of the completed runs, which are the first trace, or of the failed ones.
function runMarkers(style, chart, place) {
  const table = tableOf(chart);
  const { marker } = chart.traces[place];
  if (table === undefined || place > 1) return {};
  const isIn = selected(table, place === 1);
  const isBeyond = place === 1 ? [] : beyond(table, colouringKey(chart));
  const isOne = hasRange(table);
  const [plain, striking] = [looked(style, marker.color), looked(style, "beyond")];
  const opacityOf = (run) => {
    if (isOne) return isIn[run] ? IN_FRONT : BEHIND;
    return isBeyond[run] ? IN_FRONT : marker.opacity;
  };
  return {
    color: isIn.map((_, run) => (isBeyond[run] ? striking : plain)),
    opacity: isIn.map((_, run) => opacityOf(run)),
  };
}

// Colours the points that are drawn already. To let the library do so takes many times as long.
function paint(plot, isFresh = false) {
  const chart = charts[plot.dataset.chart];
  const style = getComputedStyle(root);
  plot.querySelectorAll(".scatterlayer .trace").forEach((trace, place) => {
    const { color, opacity } = runMarkers(style, chart, place);
    if (color === undefined) return;
    for (const point of trace.querySelectorAll("path.point")) {
      // The library keeps the place of a point in its list.
      const run = point.__data__.i;
      const look = `${color[run]} ${opacity[run]}`;
      if (!isFresh && point.dataset.look === look) continue;
      point.dataset.look = look;
      point.style.fill = color[run];
      point.style.opacity = opacity[run];
    }
  });
}

// Shows what a change moved: the line of a threshold, the colours of runs.
function follow(plot) {
  if (!plot.dataset.drawn || plot.dataset.chosen === String(version)) return;
  const chart = charts[plot.dataset.chart];
  if (plot.dataset.slice !== String(sliceOf(chart))) {
    draw(plot);
    return;
  }
  plot.dataset.chosen = version;
  const shapes = JSON.stringify(chosenShapes(chart));
  if (plot.dataset.shapes !== shapes) {
    plot.dataset.shapes = shapes;
    Plotly.relayout(plot, { shapes: coloured(getComputedStyle(root), [...chart.shapes, ...chosenShapes(chart)]) });
  }
  if (chart.runs !== undefined) paint(plot);
}

// A rectangle that is drawn over runs selects them; a double click lets go.
function selectByPointer(plot) {
  const axes = () => [charts[plot.dataset.chart].x.of, charts[plot.dataset.chart].y.of].map(keyOf);
  // What the library draws anew has the colours of its own.
  plot.on("plotly_afterplot", () => paint(plot, true));
  plot.on("plotly_selected", (event) => {
    if (!event?.range) return;
    // The charts show the selection by themselves.
    Plotly.update(plot, { selectedpoints: null }, { selections: [] });
    axes().forEach((key, place) => selectRange(key, event.range["xy"[place]]));
  });
  plot.on("plotly_deselect", () => axes().forEach((key) => selectRange(key)));
}

// Charts as Plotly takes them: from the page's data, in the colours of the style sheet.

// Members of traces and shapes that hold a colour.
const COLOURS = new Set(["color", "fillcolor"]);
const CONFIGURATION = { displayModeBar: false, responsive: true, doubleClick: "reset" };

const root = document.documentElement;
const dark = window.matchMedia("(prefers-color-scheme: dark)");
const isCoarse = window.matchMedia("(pointer: coarse)").matches;
const { charts, runs: runTables } = JSON.parse(document.getElementById("data").textContent);
// The style sheet leaves room for charts from here on.
root.dataset.script = "runs";

// A list that several traces have is written in the first of them.
const holders = [...charts, ...runTables];
const listAt = ([holder, trace, key]) => holders[holder].traces[trace][key];
const places = charts.flatMap(({ place, reading }) => [
  ...(place ? [place, ...place.columns] : []), ...(reading ? [reading] : []),
]);
for (const each of [...holders.flatMap(({ traces }) => traces), ...places]) {
  for (const [key, value] of Object.entries(each)) {
    if (value?.same) each[key] = listAt(value.same);
    if (value?.columns) {
      const columns = value.columns.map(listAt);
      each[key] = columns[0].map((_, row) => columns.map((column) => column[row]));
    }
  }
}

const isDark = () => (root.dataset.theme ? root.dataset.theme === "dark" : dark.matches);
const theme = () => (isDark() ? "dark" : "light");

// What Plotly reads in a text, in the way that it writes it back from.
const escaped = (text) => text.replace(/[&<>%]/g, (each) => `&#${each.charCodeAt(0)};`);

// An element with attributes; `text` is its content, never markup.
function made(name, attributes = {}, ...content) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...content);
  return element;
}

// A colour is a source's number or a name; the style sheet has it.
function looked(style, colour, opacity) {
  const name = typeof colour === "number" ? `--s${colour % 10}` : `--${colour}`;
  const hex = style.getPropertyValue(name).trim();
  if (opacity === undefined) return hex;
  const [r, g, b] = [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
  return `rgba(${r},${g},${b},${opacity})`;
}

// The same with all colours looked up, however deep they lie.
function coloured(style, value, key) {
  if (Array.isArray(value)) return value.map((each) => coloured(style, each));
  if (COLOURS.has(key)) return looked(style, value, key === "fillcolor" ? 0.3 : undefined);
  if (value !== null && typeof value === "object") {
    return Object.fromEntries(
      Object.entries(value).map(([name, each]) => [name, coloured(style, each, name)]),
    );
  }
  return value;
}

function axis(style, { of, ...told }) {
  const title = { ...told.title, standoff: 8 };
  const isWide = told.type === "log" && told.range && told.range[1] - told.range[0] >= 2;
  return {
    automargin: true, zeroline: false, showline: true, ticks: "outside", ticklen: 4,
    linecolor: looked(style, "quiet"), tickcolor: looked(style, "quiet"),
    gridcolor: looked(style, "grid"), exponentformat: "power", minexponent: 5, nticks: 7,
    ...(isWide ? { dtick: 1 } : {}), ...told, title,
  };
}

function layout(style, chart, width) {
  // Numbers stand upright, as many as there is room for beside the names of rows.
  const room = width - (chart.y.ticktext ? 130 : 60);
  const nticks = Math.min(7, Math.max(3, Math.floor(room / 48)));
  const upright = chart.x.ticktext ? {} : { tickangle: 0, nticks };
  // A pointer that reads off all curves says of what.
  const isCompared = chart.hovermode === "x unified" && chart.x.title.text;
  const head = isCompared ? { unifiedhovertitle: { text: `${chart.x.title.text}: %{x}` } } : {};
  // Among runs, a pointer selects; elsewhere it zooms.
  const drag = chart.runs === undefined ? "zoom" : "select";
  return {
    height: chart.height,
    margin: { l: 50, r: 14, t: 10, b: 42 },
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    font: {
      family: getComputedStyle(document.body).fontFamily, size: 12, color: looked(style, "ink"),
    },
    hoverlabel: {
      align: "left", bgcolor: looked(style, "raised"), bordercolor: looked(style, "quiet"),
      font: { color: looked(style, "ink"), size: 13 },
    },
    separators: ".\u202f", hovermode: chart.hovermode, hoverdistance: 30, showlegend: false, bargap: 0,
    dragmode: isCoarse ? false : drag, selections: [],
    newselection: { line: { color: looked(style, "accent"), width: 1.5, dash: "dot" } },
    xaxis: { ...axis(style, chart.x), ...upright, ...head },
    yaxis: axis(style, chart.y),
    shapes: coloured(style, [...chart.shapes, ...chosenShapes(chart)]),
    images: chart.images ?? [],
  };
}

// An estimate at the end of an axis is not cut.
const tracesOf = (style, chart) => coloured(style, slicedTraces(chart)).map(
  (trace) => (trace.error_x || trace.error_y ? { ...trace, cliponaxis: false } : trace),
);

function draw(plot, isPrinted = false) {
  const style = getComputedStyle(root);
  const chart = charts[plot.dataset.chart];
  plot.dataset.drawn = theme();
  plot.dataset.chosen = version;
  plot.dataset.slice = sliceOf(chart);
  plot.dataset.shapes = JSON.stringify(chosenShapes(chart));
  const width = plot.clientWidth;
  // Paper is smaller, and so are its charts.
  const size = { width, height: Math.round(0.8 * chart.height) };
  const set = { ...layout(style, chart, width), ...(isPrinted ? size : {}) };
  Plotly.react(plot, tracesOf(style, chart), set, CONFIGURATION);
  if (chart.runs !== undefined) paint(plot, true);
}

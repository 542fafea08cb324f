// What a reader has chosen: a threshold for each output, and ranges of inputs and outputs. All
// charts with the same quantity along an axis follow.

// A quantity is a name and the unit that the page shows it in.
const keyOf = (of) => (of ? `${of[0]}\n${of[1]}` : undefined);
const thresholds = new Map();
const ranges = new Map();
// The threshold whose runs are coloured where several could be: that which was moved last.
let leading;
// Counts the changes, so that a chart knows whether it shows the last one.
let version = 0;
const followers = [];
let isTelling = false;

function changed() {
  version += 1;
  if (isTelling) return;
  isTelling = true;
  requestAnimationFrame(() => {
    isTelling = false;
    followers.forEach((follow) => follow());
  });
}

function moveThreshold(key, value) {
  if (thresholds.get(key) === value && leading === key) return;
  thresholds.set(key, value);
  leading = key;
  changed();
}

// A place along a dimension of fields has a line as a threshold has, and colours no run.
function movePlace(key, value) {
  if (thresholds.get(key) === value) return;
  thresholds.set(key, value);
  changed();
}

// Without a range, all runs are selected by this quantity.
function selectRange(key, range) {
  if (range) ranges.set(key, [Math.min(...range), Math.max(...range)]);
  else ranges.delete(key);
  changed();
}

function clearRanges() {
  ranges.clear();
  changed();
}

// The ends of an axis, so that no line is drawn beyond them.
function extent(chart, along) {
  const { range, ticktext, type } = chart[along];
  const ends = type === "log" ? range?.map((power) => 10 ** power) : range;
  if (ends) return [Math.min(...ends), Math.max(...ends)];
  if (ticktext) return [-Infinity, Infinity];
  const values = chart.traces.flatMap((trace) => trace[along] ?? []).filter(Number.isFinite);
  return [Math.min(...values), Math.max(...values)];
}

// Lines at the thresholds, and shades of the ranges.
function chosenShapes(chart) {
  const shapes = [];
  for (const [along, across] of [["x", "y"], ["y", "x"]]) {
    const key = keyOf(chart[along].of);
    if (key === undefined) continue;
    const [first, last] = extent(chart, along);
    const full = { [`${across}ref`]: "paper", [`${across}0`]: 0, [`${across}1`]: 1 };
    const at = thresholds.get(key);
    if (at >= first && at <= last) {
      const line = { color: "accent", width: 2 };
      shapes.push({ type: "line", ...full, [`${along}0`]: at, [`${along}1`]: at, line });
    }
    const range = ranges.get(key);
    if (range && range[1] >= first && range[0] <= last) {
      const [lower, upper] = [Math.max(range[0], first), Math.min(range[1], last)];
      shapes.push({
        type: "rect", ...full, [`${along}0`]: lower, [`${along}1`]: upper,
        fillcolor: "accent", opacity: 0.25, line: { width: 0 }, layer: "below",
      });
    }
  }
  return shapes;
}

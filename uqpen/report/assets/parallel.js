// Parallel coordinates, turned: an axis across the page for each input and output, one below the
// other, and each run a line from the top to the foot. Every axis has two handles that select runs.

const SVG = "http://www.w3.org/2000/svg";
const ROW = 46;
const TOP = 34;
const SIDE = 12;
const KEYS = {
  ArrowLeft: -0.02, ArrowRight: 0.02, PageDown: -0.1, PageUp: 0.1, Home: -1, End: 1,
};

function drawn(name, attributes, parent) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  parent?.append(element);
  return element;
}

const finite = (values) => values.filter((value) => value !== null && value !== undefined);

// Along the axis of a column: a logarithm, or the value itself.
const alongAxis = (column, value) => (column.is_logarithmic ? Math.log10(value) : value);

// The ends of a column; a single value lies in the middle.
function endsOf(column) {
  const values = finite([...column.values, ...column.failed]);
  if (column.rows) return [-0.5, column.rows.length - 0.5];
  const [first, last] = [Math.min(...values), Math.max(...values)];
  return first < last ? [first, last] : [first - 1, last + 1];
}

function parallelCoordinates(figure, table) {
  const place = figure.querySelector(".parallel");
  const columns = table.traces.map((column, row) => ({
    ...column, key: keyOf(column.of), ends: endsOf(column), y: TOP + row * ROW,
  }));
  const height = TOP + columns.length * ROW - 12;
  const svg = drawn("svg", { role: "group", "aria-label": figure.dataset.summary, height, width: "100%" }, place);
  const [back, lines, front, axes] = ["back", "all", "front", "axes"].map((name) => drawn("g", { class: name }, svg));
  let width = 0;
  const toX = (column, value) => {
    const [first, last, at] = [...column.ends, value].map((each) => alongAxis(column, each));
    return SIDE + ((at - first) / (last - first)) * (width - 2 * SIDE);
  };
  const toValue = (column, x) => {
    const [first, last] = column.ends.map((each) => alongAxis(column, each));
    const at = first + ((x - SIDE) / (width - 2 * SIDE)) * (last - first);
    return column.is_logarithmic ? 10 ** at : at;
  };
  const within = ({ ends }, value) => Math.min(ends[1], Math.max(ends[0], value));

  const completed = table.completed.map(() => drawn("path", {}, lines));
  const failed = table.failed.map(() => drawn("path", { class: "failed" }, back));
  const parts = columns.map((column) => axisParts(column, axes));

  function axisParts(column) {
    const group = drawn("g", {}, axes);
    const strip = drawn("rect", { class: "strip", x: 0, y: column.y - 11, height: 22 }, group);
    const line = drawn("line", { class: "axis", x1: SIDE, y1: column.y, y2: column.y }, group);
    const shade = drawn("rect", { class: "range", y: column.y - 8, height: 16 }, group);
    const limit = drawn("line", { class: "threshold", y1: column.y - 11, y2: column.y + 11 }, group);
    const text = drawn("text", { class: "label", x: SIDE, y: column.y - 13 }, group);
    const ends = drawn("text", { class: "ends", y: column.y - 13, "text-anchor": "end" }, group);
    text.textContent = titleOf(column);
    const handles = ["from", "to"].map((side) => drawn("path", {
      class: "handle", role: "slider", tabindex: -1, d: "M-5,-10h10v20h-10z",
      "aria-label": `${titleOf(column)}, ${side}`, "aria-valuemin": column.ends[0], "aria-valuemax": column.ends[1],
    }, group));
    return { column, strip, line, shade, limit, ends, handles };
  }

  // A line through the axes that a run has values on.
  const path = (run, member) => columns
    .map((column) => [column, column[member][run]])
    .filter(([, value]) => value !== null && value !== undefined)
    .map(([column, value], at) => `${at ? "L" : "M"}${toX(column, value).toFixed(1)},${column.y}`)
    .join("");

  function arrange() {
    if (place.clientWidth === width || !place.clientWidth) return;
    width = place.clientWidth;
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    completed.forEach((line, run) => line.setAttribute("d", path(run, "values")));
    failed.forEach((line, run) => line.setAttribute("d", path(run, "failed")));
    for (const { strip, line, ends, column } of parts) {
      strip.setAttribute("width", width);
      line.setAttribute("x2", width - SIDE);
      ends.setAttribute("x", width - SIDE);
      ends.setAttribute("visibility", titleOf(column).length * 7 + 130 < width ? "visible" : "hidden");
    }
    showRanges();
  }

  const spelled = ({ rows }, value) => (rows
    ? rows[Math.min(rows.length - 1, Math.max(0, Math.round(value)))] : numberText(value));

  function showRanges() {
    for (const { column, shade, limit, ends, handles } of parts) {
      const range = ranges.get(column.key);
      const [lower, upper] = (range ?? column.ends).map((value) => within(column, value));
      const [x0, x1] = [toX(column, lower), toX(column, upper)];
      shade.setAttribute("x", x0);
      shade.setAttribute("width", range ? Math.max(2, x1 - x0) : 0);
      [[lower, x0], [upper, x1]].forEach(([value, x], side) => {
        handles[side].setAttribute("transform", `translate(${x} ${column.y})`);
        handles[side].setAttribute("aria-valuenow", value);
        handles[side].setAttribute("aria-valuetext", spelled(column, value));
      });
      ends.textContent = `${spelled(column, lower)} … ${spelled(column, upper)}`;
      const at = thresholds.get(column.key);
      const isOn = at >= column.ends[0] && at <= column.ends[1];
      limit.setAttribute("visibility", isOn ? "visible" : "hidden");
      if (isOn) ["x1", "x2"].forEach((end) => limit.setAttribute(end, toX(column, at)));
    }
  }

  function showRuns() {
    const isBeyond = beyond(table, leading);
    const isIn = selected(table);
    const isOne = hasRange(table);
    svg.classList.toggle("chosen", isOne);
    completed.forEach((line, run) => {
      line.classList.toggle("beyond", isBeyond[run]);
      line.classList.toggle("in", isOne && isIn[run]);
      const group = isBeyond[run] || (isOne && isIn[run]) ? front : lines;
      if (line.parentNode !== group) group.append(line);
    });
    const isFailedIn = selected(table, true);
    failed.forEach((line, run) => line.classList.toggle("in", isOne && isFailedIn[run]));
  }

  // A range that takes in the whole axis is none.
  function choose(column, lower, upper) {
    const range = [within(column, Math.min(lower, upper)), within(column, Math.max(lower, upper))];
    const isAll = range[0] <= column.ends[0] && range[1] >= column.ends[1];
    selectRange(column.key, isAll ? undefined : range);
  }

  parts.forEach(({ column, strip, shade, handles }, row) => {
    const valueAt = (event) => within(column, toValue(column, event.clientX - svg.getBoundingClientRect().left));
    function drag(event, fixed) {
      const target = event.currentTarget;
      target.setPointerCapture(event.pointerId);
      const begin = event.clientX;
      let isDragged = fixed !== undefined;
      const from = fixed ?? valueAt(event);
      const move = (moving) => {
        isDragged ||= Math.abs(moving.clientX - begin) > 3;
        if (isDragged) choose(column, from, valueAt(moving));
      };
      const end = () => {
        target.removeEventListener("pointermove", move);
        if (!isDragged) selectRange(column.key);
      };
      target.addEventListener("pointermove", move);
      target.addEventListener("pointerup", end, { once: true });
      target.addEventListener("pointercancel", end, { once: true });
    }
    [strip, shade].forEach((each) => each.addEventListener("pointerdown", (event) => drag(event)));
    handles.forEach((handle, side) => {
      const current = () => ranges.get(column.key) ?? column.ends;
      handle.addEventListener("pointerdown", (event) => drag(event, current()[1 - side]));
      handle.addEventListener("focus", () => reach(handle));
      handle.addEventListener("keydown", (event) => {
        const size = KEYS[event.key] * (column.ends[1] - column.ends[0]);
        if (Number.isFinite(size)) {
          const bounds = [...current()];
          bounds[side] += size;
          // Handles do not pass each other.
          bounds[side] = side ? Math.max(bounds[0], bounds[1]) : Math.min(bounds[0], bounds[1]);
          choose(column, ...bounds);
        } else if (event.key === "ArrowDown" || event.key === "ArrowUp") {
          const next = parts[row + (event.key === "ArrowDown" ? 1 : -1)]?.handles[side];
          if (next) { reach(next); next.focus(); }
        } else if (event.key === "Escape" || event.key === "Delete") {
          selectRange(column.key);
        } else {
          return;
        }
        event.preventDefault();
      });
    });
  });

  // The keyboard stops at the two handles of one axis; up and down go to the others.
  function reach(handle) {
    for (const { handles } of parts) {
      handles.forEach((each) => each.setAttribute("tabindex", handles.includes(handle) ? 0 : -1));
    }
  }
  reach(parts[0].handles[0]);

  new ResizeObserver(arrange).observe(place);
  return () => { arrange(); showRanges(); showRuns(); };
}

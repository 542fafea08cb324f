// The place along a dimension of fields: moved over their charts, all of them at once.

function nearestPosition(values, at) {
  return values.reduce((best, value, position) => (
    Math.abs(value - at) < Math.abs(values[best] - at) ? position : best), 0);
}

// What a chart shows at the chosen place: a position among its slices, or -1 without any.
function sliceOf({ slices }) {
  if (slices === undefined) return -1;
  return nearestPosition(slices.values, thresholds.get(keyOf(slices.of)));
}

// A trace with some of its members replaced, those of its objects likewise.
function replaced(trace, members) {
  const isObject = (value) => value !== null && typeof value === "object" && !Array.isArray(value);
  const changed = Object.entries(members).map(
    ([key, value]) => [key, isObject(value) ? replaced(trace[key], value) : value],
  );
  return { ...trace, ...Object.fromEntries(changed) };
}

function slicedTraces(chart) {
  const now = chart.slices?.traces[sliceOf(chart)];
  return now ? chart.traces.map((trace, number) => replaced(trace, now[number])) : chart.traces;
}

// The estimates at a place, as a sentence.
function placeText({ heads, columns }, at) {
  const told = columns.filter(({ texts }) => texts[at] !== "–").map(
    ({ label, unit, texts, reasons }) => (
      `${label} ${texts[at]}${unit}${reasons[at] ? ` (no interval: ${reasons[at]})` : ""}`),
  );
  return `At ${heads[at]}: ${told.join("; ") || "no run gets this far"}.`;
}

function placeForm(form) {
  const chart = charts[form.dataset.chart];
  const { values, start } = chart.place;
  const key = keyOf(chart.x.of);
  const slider = form.querySelector("input");
  const readout = form.querySelector(".readout");

  function show() {
    const at = nearestPosition(values, thresholds.get(key));
    slider.value = at;
    const text = placeText(chart.place, at);
    slider.setAttribute("aria-valuetext", text);
    readout.textContent = text;
  }

  slider.addEventListener("input", () => moveTo(key, values[slider.value]));
  form.addEventListener("submit", (event) => event.preventDefault());
  const nearest = (value) => values[nearestPosition(values, value)];
  return { key, show, start: values[start], nearest, refuse: (text) => { readout.textContent = text; } };
}

const placeForms = [...document.querySelectorAll(".place")].map(placeForm);
placeForms.forEach(({ key, start }) => { if (!thresholds.has(key)) thresholds.set(key, start); });
forms.push(...placeForms);
placeForms.forEach(({ show }) => show());

// In an address, a place is equal to a coordinate, and a threshold is exceeded.
const signOf = (key) => (placeForms.some((form) => form.key === key) ? "=" : ">");

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

function slicedTraces(chart) {
  const now = chart.slices?.traces[sliceOf(chart)];
  return now ? chart.traces.map((trace, number) => ({ ...trace, ...now[number] })) : chart.traces;
}

function placeForm(form) {
  const chart = charts[form.dataset.chart];
  const { values, texts, start } = chart.place;
  const key = keyOf(chart.x.of);
  const slider = form.querySelector("input");
  const readout = form.querySelector(".readout");

  function show() {
    const at = nearestPosition(values, thresholds.get(key));
    slider.value = at;
    slider.setAttribute("aria-valuetext", texts[at]);
    readout.textContent = texts[at];
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

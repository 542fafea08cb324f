// The threshold of an output: moved over its distribution function, or typed.

// Where there is no band, its ends are null.
const remainder = (share) => (share === null ? null : 1 - share);
const raised = (digits) => [...digits].map((each) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(each)]).join("");
const powerText = (text) => text.replace(/e\+?(-?)(\d+)/, (_, sign, digits) => `×10${raised(sign + digits)}`);

// A number in some digits as the tables write it: with its power of ten where it is very small or
// large, with a minus sign, and more than four digits in groups.
function numberText(value, digits = 4) {
  const rounded = Number(value.toPrecision(digits));
  const size = Math.abs(rounded);
  const isLong = size !== 0 && (size < 1e-3 || size >= 1e6);
  if (isLong) return powerText(rounded.toExponential()).replace("-", "−");
  const [whole, part] = String(rounded).replace("-", "−").split(".");
  const number = whole.replace("−", "");
  const shown = number.length > 4 ? whole.replace(number, grouped(number)) : whole;
  return part === undefined ? shown : `${shown}.${part}`;
}
const percent = (value, places) => (100 * value).toFixed(places);
const grouped = (count) => String(count).replace(/\B(?=(\d{3})+$)/g, "\u202f");

function placesOf(estimates, lower, upper) {
  if (lower === null || upper === null) return 2;
  const half = Math.max(...estimates.flatMap((each) => [each - lower, upper - each])) * 100;
  return half > 0 ? Math.min(8, Math.max(0, 1 - Math.floor(Math.log10(half)))) : 2;
}

// One share, or two that it lies between, with the ends of the band.
function asPercent(estimates, lower, upper) {
  const places = placesOf(estimates, lower, upper);
  const shares = [...new Set(estimates.map((each) => percent(each, places)))].join(" to ");
  const ends = lower === null || upper === null
    ? "" : ` (${percent(lower, places)} … ${percent(upper, places)} %)`;
  return `${shares} %${ends}`;
}

// A bound in two digits at the least, rounded away from what it bounds.
function outward(share, round) {
  if (share <= 0) return "0 %";
  const places = Math.max(1, 1 - Math.floor(Math.log10(100 * share) + 1e-9));
  const scale = 10 ** places;
  const value = round(100 * share * scale - (round === Math.ceil ? 1e-6 : -1e-6)) / scale;
  return `${value.toFixed(places)} %`;
}

// A number as people write it: with a decimal comma, groups of digits, the unit behind; or null.
function typedNumber(text, units) {
  let rest = text.trim().replace("−", "-");
  const unit = units.find((each) => each && rest.endsWith(each));
  if (unit) rest = rest.slice(0, -unit.length);
  rest = rest.replace(/(?<=\d)[\s'](?=\d{3}(?!\d))/g, "").trim();
  if (/^[+-]?\d{1,3}(\.\d{3})+,\d*$/.test(rest)) rest = rest.replaceAll(".", "");
  if (/^[+-]?\d{1,3}(,\d{3})+\.\d*$/.test(rest)) rest = rest.replaceAll(",", "");
  rest = rest.replace(",", ".");
  return /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(rest) ? Number(rest) : null;
}

// The place of the value nearest to a threshold among ascending ones.
function nearestTo(values, at) {
  const after = values.findIndex((value) => value >= at);
  if (after <= 0) return after < 0 ? values.length - 1 : 0;
  return at - values[after - 1] < values[after] - at ? after - 1 : after;
}

// Equal but for the digits that an address and a box have.
const isSame = (one, other) => Math.abs(one - other) <= 1e-10 * Math.abs(other);

// The distribution function of a readout, at any value: between two of its values, both are given.
function boundsAt(told, at) {
  const { values, bounds, below = [], above = [] } = told;
  const nearest = nearestTo(values, at);
  if (isSame(at, values[nearest])) return [bounds[nearest]];
  const last = bounds.length - 1;
  const lower = [told.nothing, ...below.map((row) => row.slice(1))];
  const knots = below.map((row) => row[0]);
  const one = 1 / told.runs;
  if (at < values[0]) {
    const count = knots.filter((knot) => knot <= at).length;
    return between(lower[count], knots[count - 1] === at ? null : lower[count + 1] ?? bounds[0], lower[count + 1] && one);
  }
  if (at < values[last]) {
    const after = values.findIndex((value) => value > at);
    return between(bounds[after - 1], bounds[after]);
  }
  const upper = [bounds[last], ...above.map((row) => row.slice(1))];
  const count = above.filter((row) => row[0] <= at).length;
  const isAt = count > 0 && above[count - 1][0] === at;
  return between(upper[count], isAt ? null : upper[count + 1], one);
}

// Where the next value is a run by itself, nothing changes until it is reached.
function between(lower, upper, one = 0) {
  return upper && upper[0] - lower[0] > 1.5 * one ? [lower, upper] : [lower];
}

// A form that moves a threshold: its slider by steps, its box to anything that is typed.
function thresholdForm(form) {
  const chart = charts[form.dataset.chart];
  const told = chart.reading;
  const key = keyOf(chart.x.of);
  const [box, slider] = form.querySelectorAll("input");
  const readout = form.querySelector(".readout");
  const { values, limits, start } = told;
  const last = values.length - 1;
  const unit = form.querySelector("span").textContent;
  const called = (text) => (unit ? `${text} ${unit}` : text);

  // A limit of the study is said as the study writes it.
  const spelled = (at) => String(Number(at.toPrecision(12)));
  const limitAt = (at) => limits.find(([value]) => isSame(at, value))?.[1];
  const said = (at) => limitAt(at) ?? called(numberText(at, 12));

  // What no run reached, and what every run exceeded, is told with the end of the band alone.
  function beyondRuns(at) {
    if (told.runs === undefined) return `${said(at)} is beyond the ends of this chart.`;
    const isAbove = at >= told.largest;
    const extreme = called(numberText(isAbove ? told.largest : told.smallest));
    const bounds = boundsAt(told, at)[0];
    const count = `${grouped(told.runs)}`;
    const what = isAbove
      ? `no run of ${count} ${at > told.largest ? "reached" : "exceeded"} it (largest: ${extreme})`
      : `each of the ${count} runs exceeded it (smallest: ${extreme})`;
    const end = remainder(bounds[isAbove ? 1 : 2]);
    if (end === null) return `${said(at)}: ${what}.`;
    const limit = isAbove
      ? `at most ${outward(end, Math.ceil)}` : `at least ${outward(end, Math.floor)}`;
    return `${said(at)}: ${what}. P(more) is ${limit}.`;
  }

  function read(at) {
    const isOutside = told.runs === undefined
      ? at < values[0] || at > values[last] : at >= told.largest || at < told.smallest;
    if (isOutside) return beyondRuns(at);
    const found = boundsAt(told, at);
    const [shares, lower, upper] = [found.map((each) => each[0]), found[0][1], found.at(-1)[2]];
    return `P(at most ${said(at)}) = ${asPercent(shares, lower, upper)}; ` +
      `P(more) = ${asPercent(shares.map(remainder).reverse(), remainder(upper), remainder(lower))}`;
  }

  // Until all forms of the output have the same threshold.
  function show() {
    const at = thresholds.get(key);
    slider.value = nearestTo(values, at);
    slider.setAttribute("aria-valuetext", said(at));
    box.value = spelled(at);
    box.removeAttribute("aria-invalid");
    readout.textContent = read(at);
  }

  slider.addEventListener("input", () => moveTo(key, values[Number(slider.value)]));
  box.addEventListener("change", () => {
    const at = box.value.trim() === "" ? thresholds.get(key) : typedNumber(box.value, [unit, chart.x.of[1]]);
    if (at !== null) {
      moveTo(key, at);
      return;
    }
    box.setAttribute("aria-invalid", "true");
    readout.textContent = `“${box.value}” is not understood; type a number${unit ? ` in ${unit}` : ""}.`;
  });
  form.addEventListener("submit", (event) => event.preventDefault());
  slider.value = nearestTo(values, start);
  return { key, show, said, start, refuse: (text) => { readout.textContent = text; } };
}

const forms = [...document.querySelectorAll(".reading:not(.place)")].map(thresholdForm);
forms.forEach(({ key, start }) => { if (!thresholds.has(key)) thresholds.set(key, start); });
leading = forms[0]?.key;
forms.forEach(({ show }) => show());

// The thresholds that a reader has moved.
const movedKeys = new Set();

// Moves a threshold or a place, and all forms of it at once.
function moveTo(key, value) {
  const own = forms.filter((form) => form.key === key);
  movedKeys.add(key);
  if (own[0]?.nearest) movePlace(key, own[0].nearest(value));
  else moveThreshold(key, value);
  own.forEach(({ show }) => show());
}

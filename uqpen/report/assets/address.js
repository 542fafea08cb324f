// The address of a page has its thresholds, as in `#depth>0.6_m`, and the places along dimensions, as
// in `#time=31_day`. They stand behind a place on the page if there is one, as in
// `#distributions&depth>0.6_m`. So a reading can be sent.

const inAddress = (text) => encodeURIComponent(text.replaceAll(" ", "_")).replaceAll("%2F", "/");

function decoded(text) {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}

// Parts of an address: the place, and a text for each threshold.
function addressParts() {
  const parts = window.location.hash.slice(1).split("&").map(decoded).filter(Boolean);
  const isReading = (part) => /[>=]/.test(part) && !document.getElementById(part);
  return { place: parts.find((part) => !isReading(part)) ?? "", readings: parts.filter(isReading) };
}

function addressOf(place) {
  const readings = [...movedKeys].map((key) => {
    const [name, unit] = key.split("\n");
    const value = String(Number(thresholds.get(key).toPrecision(12)));
    return `${encodeURIComponent(name)}${signOf(key)}${value}${unit ? `_${inAddress(unit)}` : ""}`;
  });
  return [place && encodeURIComponent(place), ...readings].filter(Boolean).join("&");
}

function writeAddress(place = addressParts().place) {
  const address = addressOf(place);
  if (decoded(address) === decoded(window.location.hash.slice(1))) return;
  window.history.replaceState(null, "", address ? `#${address}` : window.location.pathname);
}

// A unit that the page does not have is refused, as the number would mean something else.
function applyReading(part) {
  const known = [...new Set(forms.map(({ key }) => key))].filter((key) => part.startsWith(key.split("\n")[0] + signOf(key)));
  for (const key of known) {
    const [name, unit] = key.split("\n");
    const found = part.slice(name.length + 1).match(/^([+-]?\d+\.?\d*(?:e[+-]?\d+)?)(?:_(.*))?$/i);
    const isUnit = found && (found[2] === undefined || found[2] === unit.replaceAll(" ", "_"));
    if (isUnit) {
      moveTo(key, Number(found[1]));
      continue;
    }
    const wanted = `The address asks for ${part.replaceAll("_", " ")}`;
    const why = found ? `the unit here is ${unit || "1"}` : "which is not understood";
    forms.filter((form) => form.key === key).forEach((form) => form.refuse(`${wanted}; ${why}.`));
  }
}

// Opens what a place is folded in, and a section that is folded itself.
function unfold(target) {
  const own = target.querySelector(":scope > details.part");
  for (let fold = own || target.closest("details"); fold; fold = fold.parentElement.closest("details")) fold.open = true;
}

function goTo(place) {
  const target = document.getElementById(place);
  if (!target) return;
  unfold(target);
  target.scrollIntoView();
}

function readAddress() {
  const { place, readings } = addressParts();
  readings.forEach(applyReading);
  if (place) goTo(place);
  writeAddress(place);
}

let writing;
followers.push(() => {
  // Some browsers refuse more than a few changes a second.
  clearTimeout(writing);
  const { hash } = window.location;
  // An address that was given meanwhile is read, and not replaced.
  const write = () => window.location.hash === hash && writeAddress();
  if (movedKeys.size) writing = setTimeout(write, 150);
});
window.addEventListener("hashchange", readAddress);
// A link to the place where the address is already changes nothing in the address.
document.addEventListener("click", (event) => {
  const link = event.target.closest("a[href^='#']");
  const target = link && document.getElementById(decoded(link.hash.slice(1)));
  if (!target) return;
  // The address of the link comes after this event, and an earlier place must not replace it.
  clearTimeout(writing);
  unfold(target);
});

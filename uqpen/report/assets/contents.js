// Contents that say where the reader is, a way back up, and links to every heading.

const contents = document.querySelector("nav");
const nameLinks = new Map([...contents.querySelectorAll("a")].map((link) => [decoded(link.hash.slice(1)), link]));
const up = made("a", { href: "#top" }, "Top");
contents.prepend(up);

const inView = new Set();
const sections = [...document.querySelectorAll("main > section")];
const sectionWatcher = new IntersectionObserver((seen) => {
  seen.forEach(({ target, isIntersecting }) => inView[isIntersecting ? "add" : "delete"](target));
  const current = sections.find((section) => inView.has(section));
  for (const [name, link] of nameLinks) {
    const isCurrent = current !== undefined && name === current.id;
    if (isCurrent === link.hasAttribute("aria-current")) continue;
    if (isCurrent) link.setAttribute("aria-current", "true"); else link.removeAttribute("aria-current");
  }
}, { rootMargin: "-25% 0px -65% 0px" });
sections.forEach((section) => sectionWatcher.observe(section));

for (const heading of document.querySelectorAll("main :is(h2, h3, h4)[id]:not(summary *)")) {
  const place = heading.id.endsWith("-title") ? heading.parentElement.id || heading.id : heading.id;
  heading.append(made("a", { href: `#${place}`, class: "anchor", "aria-label": "Link to this part" }));
}

// Copies a text, also where a browser has no clipboard for a file.
async function copy(text) {
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    const area = made("textarea", { class: "skip" });
    area.value = text;
    document.body.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
  }
}

// A button that says for a while that it has copied.
function copyButton(label, hint, text) {
  const button = made("button", { type: "button", class: "copy", "aria-label": hint }, label);
  button.addEventListener("click", async () => {
    await copy(text());
    button.textContent = "Copied";
    setTimeout(() => { button.textContent = label; }, 1500);
  });
  return button;
}

const { study, reference } = document.body.dataset;
for (const quoted of document.querySelectorAll("blockquote p, .findings dd")) {
  const text = quoted.textContent.trim();
  quoted.append(" ", copyButton("Copy", "Copy this sentence with its reference", () => `${text} [${reference}]`));
}

// The address of a place on this page, with the thresholds.
const linkTo = (place) => `${window.location.href.split("#")[0]}#${addressOf(place)}`;

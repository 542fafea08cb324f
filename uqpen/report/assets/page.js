// What begins when the page is read: charts as they come near, the theme, paper.

const plots = [...document.querySelectorAll(".plot")];
// A chart in a folded part has no width; it is drawn when that is opened.
const isOpen = (plot) => plot.closest("details:not([open])") === null;
const near = new Set();
followers.push(() => near.forEach(follow));

function begin(plot) {
  if (plot.dataset.drawn === theme()) {
    follow(plot);
    return;
  }
  const isFirst = !plot.dataset.drawn;
  draw(plot);
  const chart = charts[plot.dataset.chart];
  if (!isFirst) return;
  if (chart.runs !== undefined) selectByPointer(plot);
  const key = keyOf(chart.x.of);
  if (chart.runs === undefined && forms.some((form) => form.key === key)) {
    plot.on("plotly_click", (event) => moveTo(key, event.points[0].x));
  }
}

// Charts are drawn when they come near, and the others while there is nothing else to do.
const watcher = new IntersectionObserver(
  (seen) => seen.forEach(({ target, isIntersecting }) => {
    near[isIntersecting ? "add" : "delete"](target);
    if (isIntersecting) begin(target);
  }),
  { rootMargin: "400px" },
);
plots.forEach((plot) => watcher.observe(plot));
const idle = (task) => {
  if (window.requestIdleCallback) window.requestIdleCallback(task, { timeout: 60 });
  else setTimeout(task, 30);
};
let waiting = [];
let isUnderWay = false;
function drawNext() {
  const plot = waiting.shift();
  isUnderWay = plot !== undefined;
  if (isUnderWay) {
    begin(plot);
    idle(drawNext);
  } else {
    root.dataset.ready = "yes";
  }
}
function drawAll() {
  delete root.dataset.ready;
  waiting = plots.filter(isOpen);
  if (!isUnderWay) idle(drawNext);
  isUnderWay = true;
}
drawAll();

// What does not scroll is no stop for the keyboard.
const stops = () => document.querySelectorAll(".scroll, pre").forEach((each) => {
  if (each.scrollWidth > each.clientWidth) each.tabIndex = 0; else each.removeAttribute("tabindex");
});
stops();
window.addEventListener("resize", stops);
// What was folded had no width.
document.addEventListener("toggle", (event) => {
  stops();
  const inside = (plot) => event.target.contains(plot) && plot.dataset.drawn && isOpen(plot);
  plots.filter(inside).forEach((plot) => Plotly.Plots.resize(plot));
  drawAll();
}, true);

// The theme follows the system until the button is pressed.
const button = document.getElementById("theme");
const isSeen = (plot) => {
  const { top, bottom } = plot.getBoundingClientRect();
  return top < window.innerHeight && bottom > 0;
};
const label = () => { button.textContent = isDark() ? "Light" : "Dark"; };
const redraw = () => {
  label();
  plots.filter(isSeen).forEach(begin);
  drawAll();
};
label();
button.hidden = false;
button.addEventListener("click", () => {
  root.dataset.theme = isDark() ? "light" : "dark";
  redraw();
});
dark.addEventListener("change", redraw);

// Paper is white, and has a width of its own.
let before;
window.addEventListener("beforeprint", () => {
  before = root.dataset.theme;
  root.dataset.theme = "light";
  root.dataset.printed = "yes";
  plots.filter(isOpen).forEach((plot) => { begin(plot); draw(plot, true); });
});
window.addEventListener("afterprint", () => {
  if (before === undefined) delete root.dataset.theme; else root.dataset.theme = before;
  delete root.dataset.printed;
  plots.filter(isOpen).forEach((plot) => { draw(plot); Plotly.Plots.resize(plot); });
});

readAddress();

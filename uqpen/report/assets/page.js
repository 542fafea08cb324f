"use strict";
(() => {
  // Members of traces and shapes that hold a colour.
  const COLOURS = new Set(["color", "fillcolor"]);
  const CONFIGURATION = { displayModeBar: false, responsive: true, doubleClick: "reset" };

  const root = document.documentElement;
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const isCoarse = window.matchMedia("(pointer: coarse)").matches;
  const plots = [...document.querySelectorAll(".plot")];
  // A chart in a folded part has no width; it is drawn when that is opened.
  const isOpen = (plot) => plot.closest("details:not([open])") === null;
  const charts = JSON.parse(document.getElementById("data").textContent);
  // The style sheet leaves room for charts from here on.
  root.dataset.script = "runs";

  // A list that several traces have is written in the first of them.
  for (const trace of charts.flatMap((chart) => chart.traces)) {
    for (const [key, value] of Object.entries(trace)) {
      if (value === null || value.same === undefined) continue;
      const [chart, position, name] = value.same;
      trace[key] = charts[chart].traces[position][name];
    }
  }

  const isDark = () => (root.dataset.theme ? root.dataset.theme === "dark" : dark.matches);
  const theme = () => (isDark() ? "dark" : "light");

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
    if (COLOURS.has(key)) return looked(style, value, key === "fillcolor" ? 0.3 : undefined);
    if (Array.isArray(value)) return value.map((each) => coloured(style, each));
    if (value !== null && typeof value === "object") {
      return Object.fromEntries(
        Object.entries(value).map(([name, each]) => [name, coloured(style, each, name)]),
      );
    }
    return value;
  }

  function axis(style, told) {
    const title = { ...told.title, standoff: 8 };
    const isWide = told.type === "log" && told.range && told.range[1] - told.range[0] >= 2;
    return {
      automargin: true, zeroline: false, showline: true, ticks: "outside", ticklen: 4,
      linecolor: looked(style, "quiet"), tickcolor: looked(style, "quiet"),
      gridcolor: looked(style, "grid"), exponentformat: "power", nticks: 7,
      ...(isWide ? { dtick: 1 } : {}), ...told, title,
    };
  }

  function layout(style, chart, width) {
    // Numbers stand upright, as many as there is room for beside the names of rows.
    const room = width - (chart.y.ticktext ? 130 : 60);
    const nticks = Math.min(7, Math.max(3, Math.floor(room / 48)));
    const upright = chart.x.ticktext ? {} : { tickangle: 0, nticks };
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
      hovermode: chart.hovermode, hoverdistance: 30, showlegend: false, bargap: 0,
      dragmode: isCoarse ? false : "zoom",
      xaxis: { ...axis(style, chart.x), ...upright },
      yaxis: axis(style, chart.y),
      shapes: coloured(style, chart.shapes),
    };
  }

  function draw(plot, isPrinted = false) {
    const style = getComputedStyle(root);
    const chart = charts[plot.dataset.chart];
    plot.dataset.drawn = theme();
    const width = plot.clientWidth;
    // Paper is smaller, and so are its charts.
    const size = { width, height: Math.round(0.8 * chart.height) };
    const set = { ...layout(style, chart, width), ...(isPrinted ? size : {}) };
    Plotly.react(plot, coloured(style, chart.traces), set, CONFIGURATION);
  }

  // Readings of a threshold. Where there is no band, its ends are null.
  const remainder = (share) => (share === null ? null : 1 - share);
  const raised = (digits) => [...digits].map((each) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(each)]).join("");
  const percent = (value, places) => (100 * value).toFixed(places);

  function asPercent(estimate, lower, upper) {
    if (lower === null || upper === null) return `${percent(estimate, 2)} %`;
    const half = Math.max(estimate - lower, upper - estimate) * 100;
    const places = half > 0 ? Math.min(8, Math.max(0, 1 - Math.floor(Math.log10(half)))) : 2;
    return `${percent(estimate, places)} % (${percent(lower, places)} … ${percent(upper, places)} %)`;
  }

  // Lets a form move a line over its chart; what it returns moves that to a value.
  function threshold(form) {
    const chart = charts[form.dataset.chart];
    const plot = document.getElementById(`plot-${form.dataset.chart}`);
    const [number, slider] = form.querySelectorAll("input");
    const [first, step] = [Number(form.dataset.first), Number(form.dataset.step)];
    const decimals = Number(form.dataset.decimals);
    const last = chart.bounds.length - 1;
    const unit = form.querySelector("span").textContent;
    const called = (text) => (unit ? `${text} ${unit}` : text);
    const line = chart.shapes.push({
      type: "line", yref: "paper", y0: 0, y1: 1, x0: first, x1: first,
      line: { color: "accent", width: 2 },
    }) - 1;
    const value = (position) => first + position * step;
    // Very large and very small numbers have their power of ten, in as many digits as a step asks.
    const isLong = decimals > 6 || Math.max(Math.abs(first), Math.abs(value(last))) >= 1e7;
    const power = (size) => Math.floor(Math.log10(size) + 1e-9);
    function spelled(at) {
      if (Math.abs(at) < step / 2) return (0).toFixed(isLong ? 0 : decimals);
      if (!isLong) return at.toFixed(decimals);
      return at.toExponential(Math.min(15, Math.max(0, power(Math.abs(at)) - power(step))));
    }

    function show(position) {
      const place = Math.min(last, Math.max(0, position));
      const at = value(place);
      const text = spelled(at);
      const [p, lower, upper] = chart.bounds[place];
      slider.value = place;
      const said = called(text.replace(/e\+?(-?)(\d+)/, (_, sign, digits) => `×10${raised(sign + digits)}`));
      slider.setAttribute("aria-valuetext", said);
      number.value = text;
      form.querySelector(".readout").textContent =
        `P(at most ${said}) = ${asPercent(p, lower, upper)}; ` +
        `P(more) = ${asPercent(remainder(p), remainder(upper), remainder(lower))}`;
      chart.shapes[line].x0 = chart.shapes[line].x1 = at;
      if (plot.dataset.drawn) {
        Plotly.relayout(plot, { [`shapes[${line}].x0`]: at, [`shapes[${line}].x1`]: at });
      }
    }

    slider.addEventListener("input", () => show(Number(slider.value)));
    number.addEventListener("change", () => {
      const typed = number.value === "" ? value(Number(slider.value)) : Number(number.value);
      show(Math.round((typed - first) / step));
    });
    form.addEventListener("submit", (event) => event.preventDefault());
    show(Number(slider.value));
    return (at) => show(Math.round((at - first) / step));
  }

  const moved = new Map(
    [...document.querySelectorAll(".reading")].map((form) => [form.dataset.chart, threshold(form)]),
  );

  function begin(plot) {
    if (plot.dataset.drawn === theme()) return;
    const isFirst = !plot.dataset.drawn;
    draw(plot);
    const move = moved.get(plot.dataset.chart);
    if (move && isFirst) plot.on("plotly_click", (event) => move(event.points[0].x));
  }

  // Charts are drawn when they come near, and the others while there is nothing else to do.
  const watcher = new IntersectionObserver(
    (seen) => seen.filter((each) => each.isIntersecting).forEach((each) => begin(each.target)),
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
  document.addEventListener("toggle", (event) => {
    const inside = (plot) => event.target.contains(plot) && plot.dataset.drawn && isOpen(plot);
    plots.filter(inside).forEach((plot) => Plotly.Plots.resize(plot));
    drawAll();
  }, true);

  // What does not scroll is no stop for the keyboard.
  const scrolls = [...document.querySelectorAll(".scroll, pre")];
  const stops = () => scrolls.forEach((each) => {
    if (each.scrollWidth > each.clientWidth) each.tabIndex = 0; else each.removeAttribute("tabindex");
  });
  stops();
  window.addEventListener("resize", stops);
  document.addEventListener("toggle", stops, true);

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
})();

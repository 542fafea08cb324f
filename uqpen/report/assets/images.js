// Charts as files: on white, with their title, their legend, and where they come from.

const EDGE = 14;

// Colours of the light theme, for as long as something is made of them.
function inLight(make) {
  const before = root.dataset.theme;
  root.dataset.theme = "light";
  try {
    return make();
  } finally {
    if (before === undefined) delete root.dataset.theme; else root.dataset.theme = before;
  }
}

async function plotSvg(plot) {
  const chart = charts[plot.dataset.chart];
  const width = plot.clientWidth || 640;
  const figure = inLight(() => {
    const style = getComputedStyle(root);
    // The colours of runs are not those that the library was given.
    const data = tracesOf(style, chart).map((trace, place) => (chart.runs === undefined
      ? trace : { ...trace, marker: { ...trace.marker, ...runMarkers(style, chart, place) } }));
    return { data, layout: { ...layout(style, chart, width), width } };
  });
  const text = await Plotly.toImage(figure, { format: "svg", width, height: chart.height });
  return new DOMParser().parseFromString(decodeURIComponent(text.slice(text.indexOf(",") + 1)), "image/svg+xml").documentElement;
}

// What the style sheet says of a drawing, written into a copy of it.
function inlined(svg) {
  return inLight(() => {
    const copy = svg.cloneNode(true);
    const [from, to] = [svg, copy].map((each) => [each, ...each.querySelectorAll("*")]);
    from.forEach((element, place) => {
      const style = getComputedStyle(element);
      for (const name of ["fill", "stroke", "stroke-width", "stroke-dasharray", "opacity", "font-size", "font-weight", "paint-order", "visibility", "color"]) {
        to[place].setAttribute(name, style.getPropertyValue(name));
      }
    });
    copy.setAttribute("width", svg.clientWidth);
    copy.setAttribute("height", svg.clientHeight || svg.getAttribute("height"));
    return copy;
  });
}

// A text in lines that fit.
function lines(text, width, size) {
  const longest = Math.max(12, Math.floor(width / (0.56 * size)));
  const found = [""];
  for (const word of text.split(/\s+/)) {
    if (found.at(-1) && found.at(-1).length + word.length >= longest) found.push(word);
    else found[found.length - 1] += (found.at(-1) && " ") + word;
  }
  return found;
}

function composed(title, image, keys) {
  const width = Number(image.getAttribute("width"));
  const whole = drawn("svg", { xmlns: SVG, width, "font-family": getComputedStyle(document.body).fontFamily });
  const paper = drawn("rect", { width: "100%", height: "100%", fill: "#ffffff" }, whole);
  let y = EDGE;
  const write = (text, size, weight = "normal", x = EDGE) => {
    for (const line of lines(text, width - x - EDGE, size)) {
      y += size + 3;
      const element = drawn("text", { x, y, "font-size": size, "font-weight": weight, fill: "#16202a" }, whole);
      element.textContent = line;
    }
  };
  write(title, 14, "bold");
  y += 6;
  image.setAttribute("y", y);
  whole.append(image);
  y += Number(image.getAttribute("height"));
  for (const key of keys) {
    const glyph = inlined(key.querySelector(".glyph"));
    for (const [name, value] of Object.entries({ x: EDGE, y: y + 3, width: 28, height: 14 })) glyph.setAttribute(name, value);
    whole.append(glyph);
    write(key.textContent.trim(), 12, "normal", EDGE + 34);
  }
  y += 6;
  write(reference, 10);
  whole.setAttribute("height", y + EDGE);
  whole.setAttribute("viewBox", `0 0 ${width} ${y + EDGE}`);
  paper.setAttribute("height", y + EDGE);
  return new XMLSerializer().serializeToString(whole);
}

// The picture of a figure, with the legend that stands below it or below its group.
async function figureSvg(figure) {
  const plot = figure.querySelector(".plot");
  const own = figure.querySelector(".parallel svg");
  const image = own ? inlined(own) : await plotSvg(plot);
  const legend = figure.querySelector(":scope > .legend") ?? figure.closest(".charts")?.parentElement.querySelector(":scope > .legend");
  const heading = figure.closest(".charts") ? headingOf(figure) : "";
  const title = [heading, figure.querySelector("figcaption").textContent.trim()].filter(Boolean).join(", ");
  return { title, svg: composed(title, image, legend ? [...legend.children] : []) };
}

// The heading that a group of charts stands below.
function headingOf(figure) {
  let at = figure.closest(".charts").parentElement.previousElementSibling;
  while (at && !/^H[2-4]$/.test(at.tagName)) at = at.previousElementSibling;
  return at?.textContent.trim() ?? "";
}

async function saveSvg(figure) {
  const { title, svg } = await figureSvg(figure);
  saveFile(fileName(title, "svg"), svg, "image/svg+xml");
}

// The page's policy allows images from the page itself alone.
async function savePng(figure) {
  const { title, svg } = await figureSvg(figure);
  const image = new Image();
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg)}`;
  await image.decode();
  const canvas = made("canvas", { width: 2 * image.width, height: 2 * image.height });
  canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
  canvas.toBlob((blob) => saveFile(fileName(title, "png"), blob, "image/png"));
}

for (const figure of document.querySelectorAll("figure[id]")) {
  const caption = figure.querySelector("figcaption").textContent.trim();
  const buttons = [["SVG", saveSvg], ["PNG", savePng]].map(([label, save]) => {
    const button = made("button", { type: "button", "aria-label": `${label} of this chart` }, label);
    button.addEventListener("click", () => save(figure));
    return button;
  });
  const link = copyButton("Copy link", "Copy the link to this chart", () => linkTo(figure.id));
  const fold = made("summary", { "aria-label": `Save or link: ${caption}` }, "Save or link");
  figure.append(made("details", { class: "tools" }, fold, ...buttons, link));
}

"use strict";
// Asks for the state of the study once a second, and shows it. Every text is put in as text.

const PERIOD = 1000; // milliseconds
const at = (id) => document.getElementById(id);

function element(name, text, parent, kind) {
  const made = document.createElement(name);
  if (text !== undefined) made.textContent = text;
  if (kind) made.className = kind;
  if (parent) parent.append(made);
  return made;
}

function table(columns, rows) {
  const box = document.createElement("div");
  box.className = "scroll";
  box.tabIndex = 0;
  const made = element("table", undefined, box);
  const head = element("tr", undefined, element("thead", undefined, made));
  for (const column of columns) element("th", column, head).scope = "col";
  const body = element("tbody", undefined, made);
  for (const [label, ...cells] of rows) {
    const row = element("tr", undefined, body);
    element("th", label, row).scope = "row";
    for (const cell of cells) element("td", cell, row, "number");
  }
  return box;
}

function estimates(shown) {
  const parts = [];
  for (const each of shown) {
    parts.push(element("h3", each.title), table(["", ...each.columns], each.rows));
    if (each.notes.length) {
      const notes = element("ol", undefined, undefined, "notes");
      for (const note of each.notes) element("li", note, notes);
      parts.push(notes);
    }
  }
  return parts.length ? parts : [element("p", "None yet.", undefined, "nothing")];
}

function causes(shown) {
  if (!shown.length) return element("p", "No run has failed.", undefined, "nothing");
  const rows = shown.map((each) => [each.text, each.runs, each.status, each.example]);
  return wrapped(table(["cause", "runs", "status", "the first of them"], rows));
}

function wrapped(box) {
  // Sentences in the last column may be broken into lines, numbers may not.
  for (const cell of box.querySelectorAll("td:last-child")) cell.className = "";
  return box;
}

function keepScrolled(id, ...parts) {
  // What is replaced keeps how far its tables were scrolled to the side.
  const scrolled = [...at(id).querySelectorAll(".scroll")].map((box) => box.scrollLeft);
  at(id).replaceChildren(...parts);
  at(id).querySelectorAll(".scroll").forEach((box, number) => { box.scrollLeft = scrolled[number] || 0; });
}

function show(state) {
  document.title = state.total ? `${Math.floor((100 * state.done) / state.total)} % – ${state.title}` : state.title;
  at("title").textContent = state.title;
  at("step").textContent = state.step;
  at("runs").textContent = state.runs;
  if (state.total) {
    at("bar").max = state.total;
    at("bar").value = state.done;
  } else at("bar").removeAttribute("value");
  keepScrolled("designs", wrapped(table(["design", "finished runs", "estimates"], state.designs)));
  keepScrolled("tables", ...estimates(state.tables));
  keepScrolled("causes", causes(state.causes));
}

let shown = "";

async function follow() {
  try {
    const answer = await fetch("state.json", { cache: "no-store" });
    if (!answer.ok) throw new Error(answer.statusText);
    const text = await answer.text();
    if (text !== shown) show(JSON.parse(text));
    shown = text;
  } catch {
    at("step").textContent = "The study has ended, or was interrupted. What is shown is its last state.";
    at("bar").value = at("bar").max;
    document.body.dataset.state = "ended";
    return;
  }
  document.body.dataset.state = "running";
  setTimeout(follow, PERIOD);
}

follow();

// The page: puts the parts together and keeps them in step with the server's state.

import { Connection } from "dd/connection.js";
import { h, fill, ask } from "dd/dom.js";
import { learn } from "dd/units.js";
import { Timeline } from "dd/timeline.js";
import { ServerSource } from "dd/source.js";
import { Stack } from "dd/stack.js";
import { Readout } from "dd/readout.js";
import { KEYS, keysFor } from "dd/keys.js";
import { everything, ownPanel, panels, records } from "dd/choose.js";
import { finding, progress } from "dd/finding.js";
import { inputs, take } from "dd/inputs.js";
import { MappingEditor } from "dd/mapping.js";
import { results } from "dd/results.js";
import { copyPicture, copyTable, csv, download, saveFile } from "dd/save.js";
import { look } from "dd/shade.js";

const $ = (id) => document.getElementById(id);
const connection = new Connection();
const timeline = new Timeline();
const source = new ServerSource(connection);
const effort = { value: sessionStorage.getItem("effort") ?? "normal" };
const choice = { record: null, show: "both", all: false, custom: [], hidden: {}, ...JSON.parse(sessionStorage.getItem("choice") ?? "{}") };
const shade = {
  chosen: new Map(), // condition -> how it looks
  touched: false,
  toggle(key, on) {
    shade.touched = true;
    if (on) shade.chosen.set(key, look(shade.chosen));
    else shade.chosen.delete(key);
    update();
  },
};
const mapping = new MappingEditor(connection);
let presets = [];
let turn = 0;
let shown = ""; // what the page shows but progress, as text

// --- the plots ------------------------------------------------------------------------------------

const panelsElement = h("div", { id: "panels" });
const toolbar = h("div", { class: "toolbar", role: "toolbar", "aria-label": "Plots" });
const readoutElement = h("div", { id: "readout" });
$("plots").append(toolbar, panelsElement, readoutElement);
const stack = new Stack(panelsElement, source, timeline);
const readout = new Readout(readoutElement, stack, source, timeline, speak);
readout.read();
keysFor($("plots"), timeline);
panelsElement.addEventListener("failed", (event) => message(event.detail, "error"));

function drawToolbar(state) {
  const known = records(state);
  const record = h("select", { id: "record", "aria-label": "Record", onchange: () => choose({ record: record.value }) }, known.map((name) => h("option", { value: name }, name)));
  record.value = choice.record ?? "";
  const show = h("select", { id: "show", "aria-label": "What is drawn", onchange: () => choose({ show: show.value }) }, h("option", { value: "both" }, "measured and model"), h("option", { value: "residual" }, "residual"));
  show.value = choice.show;
  const button = (id, text, label, act) => h("button", { id, "aria-label": label, title: label, onclick: act }, text);
  fill(toolbar, known.length ? [record, show,
    h("label", { class: "check" }, h("input", { type: "checkbox", id: "all", checked: choice.all, onchange: (event) => choose({ all: event.target.checked }) }), "all channels"),
    h("span", { class: "group" }, button("zoom-in", "+", "Zoom in", () => timeline.zoom(0.5)), button("zoom-out", "−", "Zoom out", () => timeline.zoom(2)),
      button("pan-left", "←", "Pan left", () => timeline.pan(-0.25)), button("pan-right", "→", "Pan right", () => timeline.pan(0.25)), button("zoom-all", "All", "All of the record", () => timeline.all())),
    h("span", { class: "group" }, button("own", "Panel …", "Panel … of your own", own), button("copy-png", "PNG", "Copy the plots as a PNG picture", async () => message(await copyPicture(stack, title()), "done")),
      button("copy-csv", "CSV", "Copy what the plots show as a CSV table", async () => message(await copyTable(stack), "done")),
      button("save-csv", "Save CSV", "Save CSV: what the plots show as a table", () => download(new Blob([csv(stack)], { type: "text/csv" }), "plots.csv")))] : []);
}

function title() {
  return `${connection.state.machine?.name ?? "recording"} – ${choice.record}`;
}

function choose(change) {
  Object.assign(choice, change);
  sessionStorage.setItem("choice", JSON.stringify(choice));
  update();
}

async function own() {
  const known = everything(connection.state, await models(connection.state));
  const boxes = known.map((one, k) => {
    const box = h("input", { type: "checkbox", id: `own-${k}` });
    const shift = h("input", { type: "number", step: "any", value: "0", class: "shift", "aria-label": `Shift of ${one.label} in s` });
    return { one, box, shift, row: h("tr", {}, h("th", { scope: "row" }, h("label", { class: "check" }, box, one.label)), h("td", {}, one.unit), h("td", {}, shift)) };
  });
  const go = () => {
    const chosen = boxes.filter((b) => b.box.checked).map((b) => ({ ...b.one, shift: Number(b.shift.value) || 0 }));
    $("dialog").close();
    if (chosen.length) choose({ custom: [...choice.custom, ownPanel(chosen, choice.custom.length + 1)] });
  };
  ask("A panel of your own",
    h("p", { class: "fine" }, "Up to six series in one plot, each with a shift in time if you like. They share one unit axis."),
    h("div", { class: "actions" }, h("button", { id: "own-go", class: "primary", onclick: go }, "Add the panel"), choice.custom.length ? h("button", { id: "own-none", onclick: () => { $("dialog").close(); choose({ custom: [] }); } }, "Remove my panels") : null),
    h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Series" }, h("table", {}, h("thead", {}, h("tr", {}, ["series", "unit", "shift [s]"].map((t) => h("th", { scope: "col" }, t)))), h("tbody", {}, boxes.map((b) => b.row)))));
}

// --- the whole ------------------------------------------------------------------------------------

// Every model that could be drawn, with its result where it is there.
async function models(state) {
  const rungs = state.steps.map((s, k) => ({ ...s, shown: choice.hidden[s.id] === undefined ? k >= state.steps.length - 2 : !choice.hidden[s.id] }));
  const variants = state.variants.map((v) => ({ ...v, id: `without-${v.without.join(",")}`, label: `without ${v.without.join(", ")}`, shown: true }));
  const every = [...rungs, ...variants];
  return Promise.all(every.map(async (m) => ({ ...m, view: m.status === "ready" ? await connection.view(m.job) : null })));
}

async function update() {
  const state = connection.state;
  if (!state) return;
  const mine = ++turn;
  learn(state.units);
  const every = await models(state);
  const diagnosis = state.diagnosis ? await connection.view(state.diagnosis.job) : null;
  if (mine !== turn) return;
  const known = records(state);
  if (!known.includes(choice.record)) choice.record = known[0] ?? null;
  progress(state.jobs, connection);
  const seen = { ...state, turn: 0, messages: 0, jobs: state.jobs.map((job) => [job.number, job.kind]) };
  const key = JSON.stringify([seen, choice, [...shade.chosen], presets, every.map((m) => Boolean(m.view)), Boolean(diagnosis)]);
  if (key === shown) return; // what a job tells of its progress leaves all else as it is
  shown = key;
  const ready = every.filter((m) => m.view);
  const last = ready.filter((m) => m.id.startsWith("s")).pop();
  drawTools(state);
  finding($("finding"), state, diagnosis, connection, effort);
  inputs($("inputs"), state, connection, { map: (ident) => mapping.open(ident), presets, models: every, refresh: (id, on) => choose({ hidden: { ...choice.hidden, [id]: !on } }) });
  shadeBy(last?.view);
  results($("results"), state, last?.view, diagnosis, connection, shade);
  drawToolbar(state);
  span(state);
  stack.set(choice.record ? panels(state, ready.filter((m) => m.shown), choice) : []);
  document.body.classList.toggle("empty", !state.traces.length);
  document.body.dataset.ready = "yes";
}

function span(state) {
  const trace = state.traces.find((t) => t.records?.[choice.record]);
  if (!trace) return;
  const told = trace.records[choice.record].span;
  if (String(told) !== String(span.last)) {
    span.last = told;
    timeline.span(...told);
  }
}

// Until somebody chooses, what stands out is shaded: what is beyond chance.
function shadeBy(view) {
  const found = [...(view?.fit?.stretches ?? []), ...(view?.held_out?.stretches ?? [])];
  const key = (s) => `${s.kind}|${s.condition}`;
  if (!shade.touched) shade.chosen = new Map(found.filter((s) => s.sure).slice(0, 1).map((s) => [key(s), 0]));
  stack.shaded = found.filter((s) => s.record === choice.record && shade.chosen.has(key(s))).map((s) => [shade.chosen.get(key(s)), s.intervals]);
  stack.redraw();
}

function drawTools(state) {
  $("where").textContent = state.project.split("/").pop();
  $("where").title = state.project;
  const save = (name, text) => h("button", { id: `save-${name}`, onclick: () => saveFile(name) }, text);
  fill($("tools"),
    h("button", { id: "undo", disabled: !state.undo, title: state.undo ? `Undo: ${state.undo}` : "", onclick: () => connection.do("undo") }, "Undo"),
    h("button", { id: "redo", disabled: !state.redo, title: state.redo ? `Redo: ${state.redo}` : "", onclick: () => connection.do("redo") }, "Redo"),
    state.steps.length ? [save("machine.toml", "Save machine"), save("story.py", "Save script")] : null,
    state.diagnosis ? h("button", { id: "report", onclick: () => connection.do("report") }, "Save report") : null,
    h("button", { id: "theme", onclick: theme }, "Light / dark"),
    h("button", { id: "help", "aria-label": "Keys", onclick: help }, "?"));
}

function help() {
  ask("Keys on the plots", h("table", {}, h("tbody", {}, KEYS.map(([key, words]) => h("tr", {}, h("th", { scope: "row" }, h("kbd", {}, key)), h("td", {}, words))))),
    h("p", { class: "fine" }, "Mouse: drag zooms, the wheel zooms, Shift and wheel or Alt and drag pans, a click sets cursor A, Shift and click cursor B, a double click shows everything."));
}

function theme() {
  const dark = document.documentElement.dataset.theme ? document.documentElement.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  document.documentElement.dataset.theme = dark ? "light" : "dark";
  localStorage.setItem("theme", document.documentElement.dataset.theme);
  stack.recolour();
}

function message(text, kind = "note") {
  const line = h("p", { class: `message ${kind}` }, text, h("button", { "aria-label": "Dismiss", onclick: () => line.remove() }, "✕"));
  $("messages").append(line);
  while ($("messages").children.length > 4) $("messages").firstChild.remove();
  if (kind !== "error") setTimeout(() => line.remove(), 8000);
}

function speak(text) {
  $("spoken").textContent = text;
}

let heard = null;
connection.addEventListener("state", () => {
  const told = connection.state.messages;
  if (heard !== null) for (const one of told) if (one.id > heard) message(one.text, one.kind);
  heard = Math.max(0, ...told.map((one) => one.id));
  update();
});
connection.addEventListener("refused", (event) => {
  message(event.detail, "error");
  shown = ""; // what was chosen does not stand
  update();
});
connection.addEventListener("offline", () => document.body.classList.add("offline"));
connection.addEventListener("online", () => document.body.classList.remove("offline"));
document.addEventListener("change", (event) => { if (event.target.id === "effort") sessionStorage.setItem("effort", event.target.value); });
document.addEventListener("click", (event) => { const name = event.target.dataset?.file; if (name) saveFile(name); });
document.addEventListener("keydown", (event) => {
  if (event.target.closest("input, select, textarea")) return;
  if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z") {
    event.preventDefault();
    connection.do(event.shiftKey ? "redo" : "undo");
  } else if (event.key === "?") help();
});
for (const kind of ["dragover", "dragenter"]) document.addEventListener(kind, (event) => { event.preventDefault(); document.body.classList.add("dropping"); });
document.addEventListener("dragleave", (event) => { if (!event.relatedTarget) document.body.classList.remove("dropping"); });
document.addEventListener("drop", (event) => {
  event.preventDefault();
  document.body.classList.remove("dropping");
  take([...event.dataTransfer.files], connection);
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => stack.recolour());
if (localStorage.getItem("theme")) document.documentElement.dataset.theme = localStorage.getItem("theme");
connection.presets().then((names) => { presets = names; update(); });

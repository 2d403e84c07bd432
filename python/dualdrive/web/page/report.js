// Plots of a saved report: in the place of each still picture, the same panels as in the workbench.

import { h } from "dd/dom.js";
import { learn } from "dd/units.js";
import { Timeline } from "dd/timeline.js";
import { OwnSource } from "dd/source.js";
import { Stack } from "dd/stack.js";
import { Readout } from "dd/readout.js";
import { keysFor } from "dd/keys.js";

const told = JSON.parse(document.querySelector('script[type="application/json"]').textContent);
learn(told.units);

const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
const spoken = h("p", { class: "unseen", role: "status", "aria-live": "polite" });
document.body.append(spoken);
const stacks = [];

for (const figure of document.querySelectorAll("figure[data-live]")) {
  const plot = told.plots[Number(figure.dataset.live)];
  const record = {
    t: new Float64Array(bytes(plot.t)),
    columns: Object.fromEntries(Object.entries(plot.columns).map(([name, text]) => [name, new Float32Array(bytes(text))])),
  };
  const timeline = new Timeline();
  const source = new OwnSource({ own: { record } });
  const panels = h("div", { class: "chart-live" });
  const readout = h("div", {});
  const button = (text, act) => h("button", { type: "button", onclick: act }, text);
  const moving = h("div", { class: "moving" },
    h("p", {}, button("Zoom in", () => timeline.zoom(0.5)), button("Zoom out", () => timeline.zoom(2)), button("Left", () => timeline.pan(-0.25)), button("Right", () => timeline.pan(0.25)), button("All", () => timeline.all())),
    panels, readout);
  figure.prepend(moving);
  figure.classList.add("lively");
  timeline.span(record.t[0], record.t[record.t.length - 1]);
  const stack = new Stack(panels, source, timeline);
  const key = (name) => ({ store: "own", record: "record", name });
  stack.set(plot.panels.map((p) => ({ ...p, height: 120, series: [
    { key: key(`${p.name}.measured`), label: "measured", tone: "measured" },
    { key: key(`${p.name}.model`), label: "model", tone: "model", dash: 1 },
  ] })));
  new Readout(readout, stack, source, timeline, (text) => { spoken.textContent = text; }).read();
  keysFor(moving, timeline);
  stacks.push(stack);
}
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => stacks.forEach((stack) => stack.recolour()));

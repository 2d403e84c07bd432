// Which column is which channel: the proposal with its reasons, every line to be changed, and a
// preview of what reading with it gives, contradictions told.

import { h, ask, fill } from "dd/dom.js";
import { Timeline } from "dd/timeline.js";
import { Stack } from "dd/stack.js";
import { ServerSource } from "dd/source.js";
import { panels } from "dd/choose.js";

export class MappingEditor {
  constructor(connection) {
    this.connection = connection;
    connection.addEventListener("state", () => this.refresh());
  }

  get trace() {
    return this.connection.state.traces.find((t) => t.id === this.ident);
  }

  async open(ident) {
    this.ident = ident;
    this.rows = null;
    this.shownJob = null;
    const trace = this.trace;
    if (!trace.proposed) await this.connection.do("propose", { trace: ident });
    this.form = h("div", {}, h("p", { class: "fine" }, "looking at its columns …"));
    this.plots = h("div", { class: "preview" });
    this.said = h("div", { role: "status", "aria-live": "polite" });
    this.stack = new Stack(this.plots, new ServerSource(this.connection), new Timeline());
    ask(`Columns of ${trace.name}`, this.form, h("h3", {}, "Preview"), this.said, this.plots);
    this.refresh();
  }

  refresh() {
    const trace = this.ident && this.connection.state && this.trace;
    if (!trace || !document.getElementById("dialog").open) return;
    const told = trace.proposed;
    if (told && !this.rows) {
      if (!told.ok) fill(this.form, h("p", { class: "warning" }, told.message));
      else this.draw(told.proposal, trace.map);
    }
    const seen = trace.preview;
    if (seen && seen.job !== this.shownJob) {
      this.shownJob = seen.job;
      this.preview(seen);
    }
  }

  draw(proposal, map) {
    this.base = map ?? proposal.mapping;
    const rules = this.base.columns ?? {};
    const names = Object.entries(proposal.channels);
    this.rows = proposal.columns.map((guess, k) => {
      const rule = rules[guess.column] ?? {};
      const channel = h("input", { id: `channel-${k}`, list: "channels", size: 12, value: rule.channel ?? (map ? "" : guess.channel), placeholder: "not used", "aria-label": `Channel of ${guess.column}` });
      const unit = h("input", { id: `unit-${k}`, size: 7, value: rule.unit ?? guess.unit, "aria-label": `Unit of ${guess.column}` });
      const sign = h("select", { id: `sign-${k}`, "aria-label": `Sign of ${guess.column}` }, h("option", { value: "1" }, "+"), h("option", { value: "-1" }, "−"));
      sign.value = String(rule.sign ?? 1);
      const scale = h("input", { id: `scale-${k}`, size: 8, value: String(rule.scale ?? 1), "aria-label": `Scale of ${guess.column}` });
      const radius = h("input", { id: `radius-${k}`, size: 5, value: rule.radius ?? "", placeholder: "–", "aria-label": `Radius of ${guess.column}` });
      for (const control of [channel, unit, sign, scale, radius]) control.addEventListener("change", () => this.ask());
      return { column: guess.column, rule, channel, unit, sign, scale, radius, guess };
    });
    const lines = (key, field) => (this.base[key]?.[field] ?? []).join("; ");
    this.keep = h("input", { id: "rows-keep", size: 28, value: lines("rows", "keep"), placeholder: "Running == 1", onchange: () => this.ask() });
    this.drop = h("input", { id: "rows-drop", size: 28, value: lines("rows", "drop"), onchange: () => this.ask() });
    this.split = h("input", { id: "split-by", size: 28, value: lines("split", "by"), onchange: () => this.ask() });
    this.least = h("input", { id: "split-least", size: 6, value: this.base.split?.min_time ?? "", placeholder: "5 s", onchange: () => this.ask() });
    const time = this.base.time ?? {};
    this.clock = h("input", { id: "time-column", size: 14, value: time.column ?? "", onchange: () => this.ask() });
    this.clockUnit = h("input", { id: "time-unit", size: 5, value: time.unit ?? "", onchange: () => this.ask() });
    fill(this.form,
      h("datalist", { id: "channels" }, names.map(([value, [unit, words]]) => h("option", { value }, `${words} [${unit}]`))),
      proposal.notes.map((line) => h("p", { class: "fine" }, line)),
      h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Columns" }, h("table", {},
        h("caption", {}, "A value becomes sign × scale × raw in this unit, and then SI. With a radius a length is an angle."),
        h("thead", {}, h("tr", {}, ["column", "channel", "unit", "sign", "scale", "radius", "from … to", "why"].map((t) => h("th", { scope: "col" }, t)))),
        h("tbody", {}, this.rows.map((r) => h("tr", { "data-column": r.column }, h("th", { scope: "row", class: "name" }, r.column), ...[r.channel, r.unit, r.sign, r.scale, r.radius].map((c) => h("td", {}, c)),
          h("td", { class: "number" }, `${short(r.guess.low)} … ${short(r.guess.high)}`), h("td", { class: "fine" }, r.guess.reason)))))),
      h("details", { id: "map-rows" }, h("summary", {}, "Clock, rows and parts"), h("p", {},
        h("label", {}, "clock ", this.clock), " ", h("label", {}, "unit ", this.clockUnit)), h("p", {},
        h("label", {}, "keep rows where ", this.keep), " ", h("label", {}, "drop rows where ", this.drop)), h("p", {},
        h("label", {}, "a new part at every change of ", this.split), " ", h("label", {}, "parts no shorter than ", this.least))),
      h("div", { class: "actions" },
        h("button", { id: "map-preview", onclick: () => this.ask() }, "Preview"),
        h("button", { id: "map-go", class: "primary", onclick: () => this.confirm() }, "Read it like this")));
    this.ask();
  }

  mapping() {
    const list = (input) => input.value.split(";").map((s) => s.trim()).filter(Boolean);
    const columns = {};
    for (const r of this.rows) {
      if (!r.channel.value.trim()) continue;
      const scale = r.scale.value.includes("/") ? r.scale.value : Number(r.scale.value);
      columns[r.column] = { ...r.rule, channel: r.channel.value.trim(), unit: r.unit.value.trim(), sign: Number(r.sign.value), scale, radius: r.radius.value.trim() };
    }
    const time = { ...this.base.time };
    if (this.clock.value.trim()) time.column = this.clock.value.trim();
    else delete time.column;
    if (this.clockUnit.value.trim()) time.unit = this.clockUnit.value.trim();
    else delete time.unit;
    const split = { ...this.base.split, by: list(this.split) };
    if (this.least.value.trim()) split.min_time = this.least.value.trim();
    else delete split.min_time;
    return { ...this.base, time, columns, rows: { keep: list(this.keep), drop: list(this.drop) }, split };
  }

  ask() {
    fill(this.said, h("p", { class: "fine" }, "reading …"));
    this.connection.do("preview", { trace: this.ident, map: this.mapping() });
  }

  async confirm() {
    if (await this.connection.do("map", { trace: this.ident, map: this.mapping() })) document.getElementById("dialog").close();
  }

  preview(seen) {
    if (!seen.ok) {
      fill(this.said, h("p", { class: "warning", id: "preview-said" }, seen.message));
      this.stack.set([]);
      return;
    }
    const records = Object.keys(seen.records);
    const lines = records.flatMap((name) => seen.records[name].log).slice(0, 8);
    fill(this.said, h("p", { id: "preview-said" }, `It reads: ${records.length === 1 ? "one part" : `${records.length} parts`}, ${Object.values(seen.records).reduce((n, r) => n + r.samples, 0).toLocaleString("en")} samples.`),
      [...new Set([...seen.warnings, ...lines])].map((line) => h("p", { class: seen.warnings.includes(line) ? "warning" : "fine" }, line)));
    const record = records[0];
    const state = { traces: [{ status: "ready", records: seen.records, store: `${seen.job}/series` }] };
    this.stack.timeline.span(...seen.records[record].span);
    this.stack.set(panels(state, [], { record, custom: [] }));
  }
}

function short(value) {
  return value === null ? "–" : Number(value.toPrecision(4)).toString();
}

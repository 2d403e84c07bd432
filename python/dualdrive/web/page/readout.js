// The cursors' values as a table: what the eye reads off a plot, for everybody.

import { h, fill } from "dd/dom.js";
import { digits } from "dd/units.js";
import { name } from "dd/source.js";

export class Readout {
  constructor(element, stack, source, timeline, speak) {
    Object.assign(this, { element, stack, source, timeline, speak });
    this.turn = 0;
    timeline.addEventListener("cursor", (event) => this.read(event.detail.spoken));
  }

  async read(spoken = false) {
    const turn = ++this.turn;
    const { a, b } = this.timeline.cursors;
    if (a === null && b === null) {
      fill(this.element, h("p", { class: "fine" }, "Click a plot, or focus one and press an arrow key: values stand here. ", h("kbd", {}, "B"), " sets a second cursor."));
      return;
    }
    const keys = this.stack.keys;
    const sets = await Promise.all([a, b].map((at) => (at === null ? [] : this.source.at(keys, at))));
    if (turn !== this.turn) return;
    const [first, second] = sets.map((set) => new Map(set.map((one) => [one.key, one])));
    const rows = this.stack.panels.flatMap((panel) => panel.spec.series.map((s) => {
      const [one, two] = [first, second].map((set) => set.get(name(s.key))?.value);
      const scaled = (v) => (v === undefined ? "–" : digits(v / panel.rung.factor, 5));
      const change = one === undefined || two === undefined ? "–" : digits((two - one) / panel.rung.factor, 5);
      return { label: `${panel.spec.title}, ${s.label}`, unit: panel.rung.unit, a: scaled(one), b: scaled(two), change };
    }));
    const dt = a !== null && b !== null ? `${digits(b - a, 5)}` : "–";
    fill(this.element, h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Values at the cursors" }, h("table", { class: "readout" },
      h("caption", {}, "Values at the cursors: the nearest samples"),
      h("thead", {}, h("tr", {}, ["", "A", "B", "Δ = B − A", "unit"].map((t, k) => h("th", { scope: "col", class: k && k < 4 ? "number" : null }, t)))),
      h("tbody", {},
        h("tr", {}, h("th", { scope: "row" }, "time"), num(a), num(b), h("td", { class: "number" }, dt), h("td", {}, "s")),
        rows.map((r) => h("tr", {}, h("th", { scope: "row" }, r.label), h("td", { class: "number" }, r.a), h("td", { class: "number" }, r.b), h("td", { class: "number" }, r.change), h("td", {}, r.unit)))))));
    if (spoken) {
      const which = b !== null && a === null ? "b" : "a";
      this.speak(`${which.toUpperCase()} ${digits(which === "a" ? a : b, 5)} seconds. ${rows.map((r) => `${r.label} ${r[which]} ${r.unit}`).join(". ")}`);
    }
  }
}

function num(value) {
  return h("td", { class: "number" }, value === null ? "–" : digits(value, 5));
}

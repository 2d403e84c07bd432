// Panels below each other on one time axis: they ask for their series together and are drawn together.

import { Panel } from "dd/plot.js";

const PATIENCE = 60; // ms until panning shows what it has, without waiting for the server
const AHEAD = 0.5; // of what is shown, on either side, so that panning shows something at once

export class Stack {
  constructor(element, source, timeline) {
    this.element = element;
    this.source = source;
    this.timeline = timeline;
    this.panels = [];
    this.shaded = []; // [look of a cause, its stretches of time]
    this.busy = this.again = false;
    timeline.addEventListener("range", () => this.moved());
    timeline.addEventListener("cursor", () => this.redraw());
    new ResizeObserver(() => this.resized()).observe(element);
  }

  // What is drawn; panels whose content stays are kept.
  set(specs) {
    const text = JSON.stringify(specs);
    if (text === this.specs) return;
    this.specs = text;
    this.panels.forEach((panel) => panel.plot?.destroy());
    this.panels = specs.map((spec, k) => new Panel(spec, this.timeline, { shaded: () => this.shaded, last: k === specs.length - 1 }));
    this.element.replaceChildren(...this.panels.map((panel) => panel.element));
    this.drawAll();
    this.fetch();
  }

  drawAll() {
    const width = Math.max(this.element.clientWidth, 240);
    this.width = width;
    this.panels.forEach((panel) => panel.draw(width));
  }

  resized() {
    if (Math.abs(this.element.clientWidth - (this.width ?? 0)) < 2 || !this.panels.length) return;
    this.drawAll();
    this.fetch();
  }

  // After a change of colours.
  recolour() {
    this.drawAll();
  }

  redraw() {
    this.panels.forEach((panel) => panel.plot?.redraw(false, false));
  }

  // What is there already is moved only where the answer takes its time: drawing twice is slower.
  moved() {
    clearTimeout(this.patience);
    this.patience = setTimeout(() => this.panels.forEach((panel) => panel.follow()), PATIENCE);
    this.fetch();
  }

  get keys() {
    return this.panels.flatMap((panel) => panel.keys);
  }

  // One request at a time; the latest stretch is what is asked for next.
  async fetch() {
    if (this.busy) {
      this.again = true;
      return;
    }
    this.busy = true;
    try {
      do {
        this.again = false;
        const panels = this.panels;
        if (!panels.length) break;
        const [a, b] = this.timeline.range;
        const extra = AHEAD * (b - a);
        const pixels = Math.round((1 + 2 * AHEAD) * this.width);
        const found = await this.source.get(this.keys, a - extra, b + extra, pixels);
        if (this.timeline.range[0] === a && this.timeline.range[1] === b) clearTimeout(this.patience);
        if (panels === this.panels) panels.forEach((panel) => panel.take(found));
        this.element.dataset.drawn = `${a} ${b}`;
        this.element.dispatchEvent(new Event("drawn"));
      } while (this.again);
    } catch (error) {
      this.element.dispatchEvent(new CustomEvent("failed", { detail: error.message }));
    } finally {
      this.busy = false;
    }
  }
}

// One panel: series over time on uPlot, with the shared stretch of time, cursors and shaded stretches.
//   spec: {id, title, unit, series: [{key, label, tone, dash}], steps, ticks, height}

import uPlot from "uplot";
import { readable, short } from "dd/units.js";
import { shadeAs } from "dd/shade.js";
import { name } from "dd/source.js";

// Tones are roles of the style sheet, told apart by every kind of colour vision, and by their dash.
const DASHES = [[], [7, 4], [2, 3], [9, 3, 2, 3], [4, 2], [1, 2]];
const LEFT = 64;

export const tone = (role) => getComputedStyle(document.documentElement).getPropertyValue(`--${role}`).trim();

export class Panel {
  constructor(spec, timeline, { shaded = () => [], last = false } = {}) {
    this.spec = spec;
    this.timeline = timeline;
    this.shaded = shaded;
    this.last = last;
    this.data = [[0, 1], ...spec.series.map(() => [null, null])];
    this.exact = true;
    this.rung = readable(spec.unit, spec.peak ?? 1);
    this.element = document.createElement("figure");
    this.element.className = "panel";
    this.element.tabIndex = 0;
    this.element.setAttribute("role", "group");
    this.element.setAttribute("aria-roledescription", "time plot");
    this.element.setAttribute("aria-label", `${this.label()}: ${spec.series.map((s) => s.label).join(", ")}`);
    this.element.dataset.panel = spec.id;
    this.head = document.createElement("figcaption");
    this.head.append(strong(this.label()), ...spec.series.map((s, k) => legend(s, k)));
    this.canvas = document.createElement("div");
    this.element.append(this.head, this.canvas);
  }

  label() {
    return this.rung.unit ? `${this.spec.title} [${this.rung.unit}]` : this.spec.title;
  }

  get keys() {
    return this.spec.series.map((s) => s.key);
  }

  draw(width) {
    this.plot?.destroy();
    this.width = width;
    const axis = { stroke: tone("soft"), grid: { stroke: tone("grid"), width: 1 }, ticks: { stroke: tone("grid"), width: 1, size: 4 }, font: "12px system-ui, sans-serif" };
    this.plot = new uPlot({
      width,
      height: (this.spec.height ?? 150) + (this.last ? 30 : 8),
      padding: [6, 10, this.last ? 0 : 6, 0],
      legend: { show: false },
      scales: { x: { time: false, auto: false, range: () => this.timeline.range }, y: { range: this.spec.ticks ? () => [-1.4, 1.4] : this.bounds } },
      axes: [
        { ...axis, show: this.last, label: this.last ? "time [s]" : null, labelSize: 16, size: 28, labelFont: axis.font },
        { ...axis, size: LEFT, values: (_, ticks) => ticks.map((v) => this.spec.ticks ? this.spec.ticks[v] ?? "" : short(v)), splits: this.spec.ticks ? () => [-1, 0, 1] : null },
      ],
      series: [{}, ...this.spec.series.map((s, k) => ({
        label: s.label,
        stroke: tone(s.tone),
        width: s.tone === "measured" ? 1.6 : 1.4,
        dash: s.dash === undefined ? null : DASHES[s.dash % DASHES.length],
        points: { show: false },
        paths: this.spec.ticks ? uPlot.paths.stepped({ align: 1 }) : (...told) => (this.exact ? lines : columns)(...told),
      }))],
      cursor: { x: true, y: false, points: { size: 6 }, drag: { x: true, y: false, setScale: false }, sync: { key: "dualdrive" }, bind: { dblclick: () => () => this.timeline.all() } },
      hooks: { drawAxes: [() => this.shade()], draw: [() => this.marks()], setSelect: [() => this.selected()] },
    }, this.data, this.canvas);
    this.listen(this.plot.over);
  }

  bounds = (_, low, high) => {
    if (low === null || low === high) return [(low ?? 0) - 1, (high ?? 0) + 1];
    const edge = 0.08 * (high - low);
    return [low - edge, high + edge];
  };

  // Found: Map of key -> {t, y, exact} as a source has it.
  take(found) {
    const own = this.spec.series.map((s) => found.get(name(s.key)));
    if (own.some((one) => one === undefined)) return;
    this.exact = own.every((one) => one.exact);
    const scaled = own.map((one) => shown(one.y, this.rung.factor));
    const alike = own.every((one) => one.t.length === own[0].t.length && one.t[0] === own[0].t[0] && one.t[one.t.length - 1] === own[0].t[own[0].t.length - 1]);
    this.data = alike
      ? [own[0].t, ...scaled]
      : uPlot.join(own.map((one, k) => [one.t, scaled[k]]), own.map((one) => [null, one.exact ? 0 : 1]));
    this.plot?.series.slice(1).forEach((series, k) => {
      const dash = this.spec.series[k].dash;
      series.dash = this.exact && dash !== undefined ? DASHES[dash % DASHES.length] : [];
      series.width = this.exact ? 1.4 : 1;
    });
    this.plot?.setData(this.data, false);
    this.follow();
  }

  follow() {
    const [min, max] = this.timeline.range;
    this.plot?.setScale("x", { min, max });
  }

  selected() {
    const { left, width } = this.plot.select;
    if (width < 5) return;
    const range = [this.plot.posToVal(left, "x"), this.plot.posToVal(left + width, "x")];
    this.plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
    this.timeline.show(...range);
  }

  listen(over) {
    const at = (event) => this.plot.posToVal(event.clientX - over.getBoundingClientRect().left, "x");
    over.addEventListener("wheel", (event) => {
      event.preventDefault();
      if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) this.timeline.pan((event.deltaX || event.deltaY) / over.clientWidth);
      else this.timeline.zoom(Math.exp(event.deltaY * 0.002), at(event));
    }, { passive: false });
    let down = null;
    over.addEventListener("mousedown", (event) => {
      down = event.clientX;
      if (event.button === 1 || event.altKey) {
        event.preventDefault();
        event.stopImmediatePropagation();
        dragged(event.clientX, over.clientWidth, this.timeline);
      }
    }, true);
    over.addEventListener("mouseup", (event) => {
      if (down !== null && Math.abs(event.clientX - down) < 4 && event.button === 0) this.timeline.put(event.shiftKey ? "b" : "a", at(event));
    });
    over.addEventListener("mousemove", (event) => {
      this.timeline.hover = at(event);
      this.timeline.dispatchEvent(new Event("hover"));
    });
  }

  shade() {
    const { ctx, bbox } = this.plot;
    const [from, to] = this.timeline.range;
    ctx.save();
    for (const [cause, stretches] of this.shaded()) {
      ctx.beginPath(); // one path: where stretches meet within a pixel nothing is shaded twice
      for (const [start, stop] of stretches) {
        if (stop < from || start > to) continue;
        const left = Math.max(this.plot.valToPos(start, "x", true), bbox.left);
        const right = Math.min(this.plot.valToPos(stop, "x", true), bbox.left + bbox.width);
        ctx.rect(left, bbox.top, Math.max(right - left, 1), bbox.height);
      }
      shadeAs(ctx, cause, tone);
    }
    ctx.restore();
  }

  marks() {
    const { ctx, bbox } = this.plot;
    const [from, to] = this.timeline.range;
    for (const [which, at] of Object.entries(this.timeline.cursors)) {
      if (at === null || at < from || at > to) continue;
      const x = this.plot.valToPos(at, "x", true);
      ctx.save();
      ctx.strokeStyle = ctx.fillStyle = tone("accent");
      ctx.lineWidth = devicePixelRatio;
      ctx.setLineDash(which === "a" ? [] : [5 * devicePixelRatio, 4 * devicePixelRatio]);
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      ctx.font = `600 ${11 * devicePixelRatio}px system-ui, sans-serif`;
      ctx.fillText(which.toUpperCase(), x + 4 * devicePixelRatio, bbox.top + 12 * devicePixelRatio);
      ctx.restore();
    }
  }
}

const lines = uPlot.paths.linear();

// Least and greatest value of every pixel as one upright stroke each, long enough to meet its
// neighbour: a polyline through them would be the same picture at several times the cost.
function columns(u, k, from, to) {
  const x = u.data[0], y = u.data[k], scale = u.series[k].scale;
  const path = new Path2D();
  let lastLow = null, lastHigh = null;
  for (let i = from & ~1; i < to; i += 2) {
    if (y[i] === null || y[i] === undefined) {
      lastLow = null;
      continue;
    }
    const at = Math.round(u.valToPos((x[i] + x[i + 1]) / 2, "x", true)) + 0.5;
    let low = u.valToPos(y[i], scale, true), high = u.valToPos(y[i + 1], scale, true); // on the screen low is below
    const [ownLow, ownHigh] = [low, high];
    if (lastLow !== null) {
      if (high > lastLow) high = lastLow;
      if (low < lastHigh) low = lastHigh;
    }
    path.moveTo(at, Math.max(low, high + 1));
    path.lineTo(at, high);
    [lastLow, lastHigh] = [ownLow, ownHigh];
  }
  return { stroke: path, fill: null, clip: null, band: null, gaps: null, flags: 1 };
}

function dragged(from, width, timeline) {
  let last = from;
  const move = (event) => {
    timeline.pan((last - event.clientX) / width);
    last = event.clientX;
  };
  const up = () => {
    removeEventListener("mousemove", move);
    removeEventListener("mouseup", up);
  };
  addEventListener("mousemove", move);
  addEventListener("mouseup", up);
}

// Values in the unit that is shown; where a pixel has no sample the line has a gap.
function shown(y, factor) {
  let holes = false;
  const scaled = new Float64Array(y.length);
  for (let i = 0; i < y.length; i++) {
    scaled[i] = y[i] / factor;
    if (scaled[i] !== scaled[i]) holes = true;
  }
  return holes ? Array.from(scaled, (v) => (v === v ? v : null)) : scaled;
}

function strong(text) {
  const element = document.createElement("strong");
  element.textContent = text;
  return element;
}

function legend(series) {
  const entry = document.createElement("span");
  entry.className = "key";
  const line = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  line.setAttribute("viewBox", "0 0 26 8");
  line.setAttribute("aria-hidden", "true");
  const path = document.createElementNS("http://www.w3.org/2000/svg", "path");
  path.setAttribute("d", "M0 4H26");
  path.setAttribute("stroke", `var(--${series.tone})`);
  path.setAttribute("stroke-width", "2");
  path.setAttribute("stroke-dasharray", (DASHES[(series.dash ?? 0) % DASHES.length]).join(" "));
  line.append(path);
  entry.append(line, series.label);
  return entry;
}

// Small still charts: a curve with its band, stems of a correlation. SVG, sized by the page.

const NS = "http://www.w3.org/2000/svg";
const W = 330, H = 150, L = 64, R = 8, T = 8, B = 30;

function s(name, attributes, text) {
  const element = document.createElementNS(NS, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  return element;
}

function ticks(low, high, count) {
  const step0 = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(step0));
  const step = [1, 2, 5, 10].map((k) => k * power).find((k) => k >= step0);
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high + 1e-9 * step; k++) found.push(Number((k * step).toPrecision(6)));
  return found;
}

function frame(x, y, labels, words) {
  const [x0, x1] = x, [y0, y1] = y;
  const px = (v) => L + (v - x0) / (x1 - x0 || 1) * (W - L - R);
  const py = (v) => H - B - (v - y0) / (y1 - y0 || 1) * (H - T - B);
  const svg = s("svg", { viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": words, class: "chart" });
  for (const v of ticks(y0, y1, 4)) {
    svg.append(s("path", { d: `M${L} ${py(v)}H${W - R}`, class: "grid" }), s("text", { x: L - 5, y: py(v) + 3.5, "text-anchor": "end" }, short(v)));
  }
  for (const v of ticks(x0, x1, 5)) svg.append(s("text", { x: px(v), y: H - B + 13, "text-anchor": "middle" }, short(v)));
  svg.append(s("text", { x: (L + W - R) / 2, y: H - 3, "text-anchor": "middle", class: "axis" }, labels[0]));
  svg.append(s("text", { x: 10, y: (T + H - B) / 2, "text-anchor": "middle", class: "axis", transform: `rotate(-90 10 ${(T + H - B) / 2})` }, labels[1]));
  return { svg, px, py };
}

const short = (v) => (v < 0 ? "−" : "") + Number(Math.abs(v).toPrecision(3)).toString();
const bounds = (values, edge = 0.06) => {
  const low = Math.min(...values), high = Math.max(...values), more = edge * (high - low || 1);
  return [low - more, high + more];
};

// The missing torque along a coordinate, with its 95 % band.
export function curve(shape) {
  const unit = (u) => (u ? ` [${u}]` : "");
  const words = `${shape.equation}: what is missing along ${shape.coordinate}, from ${short(Math.min(...shape.value))} to ${short(Math.max(...shape.value))} ${shape.unit}`;
  const { svg, px, py } = frame(bounds(shape.at, 0.02), bounds([...shape.low, ...shape.high, 0]), [`${shape.coordinate}${unit(shape.coordinate_unit)}`, `missing${unit(shape.unit)}`], words);
  const line = (ys) => shape.at.map((x, k) => `${px(x).toFixed(1)} ${py(ys[k]).toFixed(1)}`);
  svg.append(s("path", { d: `M${[...line(shape.low), ...line(shape.high).reverse()].join("L")}Z`, class: "band" }));
  svg.append(s("path", { d: `M${px(shape.at[0])} ${py(0)}H${px(shape.at[shape.at.length - 1])}`, class: "zero" }));
  svg.append(s("path", { d: `M${line(shape.value).join("L")}`, class: "line" }));
  if (shape.at.length < 30) shape.at.forEach((x, k) => svg.append(s("circle", { cx: px(x), cy: py(shape.value[k]), r: 2.2, class: "dot" })));
  return svg;
}

// Correlations over lags: stems outside of the band are coloured.
export function stems(lags, values, band, labels, words) {
  const { svg, px, py } = frame(bounds(lags, 0.02), bounds([...values, band, -band]), labels, words);
  svg.append(s("rect", { x: L, y: py(band), width: W - L - R, height: py(-band) - py(band), class: "band" }));
  lags.forEach((x, k) => svg.append(s("path", { d: `M${px(x).toFixed(1)} ${py(0).toFixed(1)}V${py(values[k]).toFixed(1)}`, class: Math.abs(values[k]) > band ? "stem out" : "stem" })));
  svg.append(s("path", { d: `M${L} ${py(0)}H${W - R}`, class: "zero" }));
  return svg;
}

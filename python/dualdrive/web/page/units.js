// Numbers as an engineer reads them. Which unit goes up to which size is told by the server.

let known = {};

export function learn(units) {
  known = units;
}

// The unit in which values up to `peak` (SI) read best: shown = si / factor.
export function readable(unit, peak) {
  const rungs = known[unit] ?? [{ top: null, factor: 1, unit }];
  return rungs.find((rung) => rung.top === null || peak < rung.top) ?? rungs[rungs.length - 1];
}

export function percent(share, count = 3) {
  return share === null || share === undefined || !isFinite(share) ? "–" : `${digits(100 * share, count)} %`;
}

export function digits(value, count = 3) {
  if (value === null || value === undefined || !isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) return value.toExponential(count - 1).replace("-", "−").replace("e+", "e");
  return (size >= 10 ** count ? Math.round(value).toString() : value.toPrecision(count)).replace(/^-/, "−");
}

// peak: the size that chooses the unit, where values stand beside one another.
export function human(value, unit, peak = Math.abs(value)) {
  if (value === null || value === undefined) return "–";
  const rung = readable(unit, peak);
  return `${digits(value / rung.factor, 4)}${rung.unit ? ` ${rung.unit}` : ""}`;
}

// The same without zeros at the end, for axes.
export function short(value) {
  const [number, power] = digits(value, 4).split("e");
  const plain = number.includes(".") ? number.replace(/0+$/, "").replace(/\.$/, "") : number;
  return power === undefined ? plain : `${plain}e${power}`;
}

export function seconds(value) {
  return `${digits(value, 4)} s`;
}

// A remark as a whole sentence.
export function whole(line) {
  return `${line.slice(0, 1).toUpperCase()}${line.slice(1)}${/[.!?]$/.test(line) ? "" : "."}`;
}

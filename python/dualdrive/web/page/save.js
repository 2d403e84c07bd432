// Taking things away: files of the project, the plots as a picture, what they show as a table.

import uPlot from "uplot";
import { h } from "dd/dom.js";
import { tone } from "dd/plot.js";

export async function saveFile(name) {
  const answer = await fetch(`file/${encodeURIComponent(name)}`);
  if (answer.ok) download(await answer.blob(), name);
  return answer.ok;
}

export function download(blob, name) {
  const link = h("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

// The panels below each other on one canvas, with their titles and keys.
export function picture(stack, title) {
  const ratio = devicePixelRatio, line = 20 * ratio;
  const sources = stack.panels.map((panel) => panel.plot.ctx.canvas);
  const canvas = document.createElement("canvas");
  canvas.width = Math.max(...sources.map((c) => c.width)) + 16 * ratio;
  canvas.height = sources.reduce((sum, c) => sum + c.height + line, 2.2 * line);
  const ctx = canvas.getContext("2d");
  ctx.fillStyle = tone("paper");
  ctx.fillRect(0, 0, canvas.width, canvas.height);
  ctx.fillStyle = tone("ink");
  ctx.font = `600 ${14 * ratio}px system-ui, sans-serif`;
  ctx.fillText(title, 8 * ratio, 1.2 * line);
  let y = 1.8 * line;
  stack.panels.forEach((panel, k) => {
    let x = 8 * ratio;
    const write = (text, colour, weight) => {
      ctx.font = `${weight} ${12 * ratio}px system-ui, sans-serif`;
      ctx.fillStyle = tone(colour);
      ctx.fillText(text, x, y + 0.7 * line);
      x += ctx.measureText(text).width + 14 * ratio;
    };
    write(panel.label(), "ink", 600);
    panel.spec.series.forEach((s) => write(`— ${s.label}`, s.tone, 400));
    ctx.drawImage(sources[k], 8 * ratio, y + line);
    y += sources[k].height + line;
  });
  return new Promise((resolve) => canvas.toBlob(resolve, "image/png"));
}

export async function copyPicture(stack, title) {
  const blob = await picture(stack, title);
  try {
    await navigator.clipboard.write([new ClipboardItem({ "image/png": blob })]);
    return "The picture is in the clipboard.";
  } catch {
    download(blob, "plots.png");
    return "The picture is saved as plots.png (the browser keeps its clipboard).";
  }
}

export async function copyTable(stack) {
  try {
    await navigator.clipboard.writeText(csv(stack));
    return "The table is in the clipboard.";
  } catch {
    download(new Blob([csv(stack)], { type: "text/csv" }), "plots.csv");
    return "The table is saved as plots.csv (the browser keeps its clipboard).";
  }
}

// What the panels show as one table: time, then a column per series with its unit in the header.
// Where pixels are fewer than samples, a first line says that it holds least and greatest values.
export function csv(stack) {
  const { panels, timeline: { range: [from, to] } } = stack;
  const [t, ...columns] = uPlot.join(panels.map((panel) => panel.data), panels.map((panel) => panel.data.map(() => 0)));
  const heads = panels.flatMap((panel) => panel.spec.series.map((s) => head(panel, s)));
  const lines = panels.every((panel) => panel.exact) ? [] : ["# least and greatest value of every pixel; zoom in for every sample"];
  lines.push(["t [s]", ...heads].map(quoted).join(","));
  for (let k = 0; k < t.length; k++) {
    if (t[k] >= from && t[k] <= to) lines.push([t[k], ...columns.map((c) => c[k])].map(number).join(","));
  }
  return `${lines.join("\n")}\n`;
}

// A flank has no unit: its numbers have names.
function head(panel, series) {
  const names = panel.spec.ticks ? `: ${Object.entries(panel.spec.ticks).sort(([a], [b]) => a - b).map((pair) => pair.join(" ")).join(", ")}` : "";
  return `${panel.spec.title}, ${series.label}${names}${panel.rung.unit ? ` [${panel.rung.unit}]` : ""}`;
}

// As a cell that no spreadsheet takes for a formula: names come from recordings.
function quoted(text) {
  return `"${(/^[=+\-@\t\r]/.test(text) ? `'${text}` : text).replaceAll('"', '""')}"`;
}

// Twelve digits: beyond them stands what the change of units leaves.
function number(value) {
  return Number.isFinite(value) ? String(Number(value.toPrecision(12))) : "";
}

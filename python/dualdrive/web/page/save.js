// Taking things away: files of the project, the plots as a picture, what they show as a table.

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

// What the panels show, a column per series; where samples are fewer than pixels, every sample.
export function csv(stack) {
  const lines = [];
  for (const panel of stack.panels) {
    const [t, ...columns] = panel.data;
    const [from, to] = panel.timeline.range;
    lines.push(`# ${panel.exact ? "every sample" : "least and greatest value of every pixel"}`);
    lines.push(["t [s]", ...panel.spec.series.map((s) => `"${panel.spec.title}, ${s.label} [${panel.rung.unit}]"`)].join(","));
    for (let k = 0; k < t.length; k++) {
      if (t[k] < from || t[k] > to) continue;
      lines.push([t[k], ...columns.map((c) => c[k] ?? "")].join(","));
    }
    lines.push("");
  }
  return lines.join("\n");
}

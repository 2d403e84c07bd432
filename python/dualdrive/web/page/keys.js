// The keyboard: everything a mouse can do on the plots.

export const KEYS = [
  ["← →", "move cursor A (with Alt: cursor B) by a hundredth of what is shown; with Ctrl by a thousandth"],
  ["Shift ← →", "pan"],
  ["+ −", "zoom about cursor A"],
  ["0 or Home", "show everything"],
  ["A, B", "set a cursor where the mouse is, or in the middle"],
  ["Esc", "clear both cursors"],
  ["↑ ↓", "the panel above, below"],
  ["Ctrl Z, Ctrl Shift Z", "undo, redo"],
  ["?", "this list"],
];

export function keysFor(element, timeline) {
  element.addEventListener("keydown", (event) => {
    if (event.target.closest("input, select, textarea, button, summary, dialog")) return;
    const act = action(event, timeline);
    if (act) {
      event.preventDefault();
      act();
    }
  });
}

function action(event, timeline) {
  const middle = () => timeline.hover ?? (timeline.range[0] + timeline.range[1]) / 2;
  const sign = event.key === "ArrowLeft" ? -1 : 1;
  switch (event.key) {
    case "ArrowLeft":
    case "ArrowRight":
      if (event.shiftKey) return () => timeline.pan(0.1 * sign);
      return () => timeline.step(event.altKey ? "b" : "a", sign * (event.ctrlKey ? 0.001 : 0.01));
    case "+":
    case "=": return () => timeline.zoom(0.7);
    case "-": return () => timeline.zoom(1 / 0.7);
    case "0":
    case "Home": return () => timeline.all();
    case "Escape": return () => { timeline.put("a", null); timeline.put("b", null); };
    case "ArrowUp":
    case "ArrowDown": {
      const panels = [...document.querySelectorAll(".panel")];
      const k = panels.indexOf(event.target.closest(".panel")) + (event.key === "ArrowUp" ? -1 : 1);
      return panels[k] ? () => panels[k].focus() : null;
    }
    default:
  }
  if (event.ctrlKey || event.metaKey) return null;
  if (event.key.toLowerCase() === "a") return () => timeline.put("a", middle(), true);
  if (event.key.toLowerCase() === "b") return () => timeline.put("b", middle(), true);
  return null;
}

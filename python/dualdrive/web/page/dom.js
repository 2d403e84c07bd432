// Elements from nested calls. Text is always text: nothing here takes markup.

export function h(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes ?? {})) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key === "style") Object.assign(element.style, value);
    else if (key in element && typeof value !== "string" && key !== "list") element[key] = value;
    else element.setAttribute(key, value === true ? "" : value);
  }
  element.append(...children.flat(9).filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

// Replaces what an element holds; the focus stays on the control that had it, found by its id.
export function fill(element, ...children) {
  const held = element.contains(document.activeElement) ? document.activeElement.id : "";
  const open = new Set([...element.querySelectorAll("details[open][id]")].map((d) => d.id));
  const shut = new Set([...element.querySelectorAll("details:not([open])[id]")].map((d) => d.id));
  element.replaceChildren(...children.flat(9).filter((child) => child !== null && child !== undefined && child !== false));
  for (const details of element.querySelectorAll("details[id]")) {
    if (open.has(details.id)) details.open = true;
    if (shut.has(details.id)) details.open = false;
  }
  if (held) document.getElementById(held)?.focus();
}

export function table(caption, head, rows, marked = () => false) {
  return h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": caption },
    h("table", {},
      h("caption", {}, caption),
      h("thead", {}, h("tr", {}, head.map((cell) => h("th", { scope: "col", class: cell.number ? "number" : null }, cell.text ?? cell)))),
      h("tbody", {}, rows.map((row, k) => h("tr", { class: marked(k) ? "marked" : null },
        row.map((cell, n) => n === 0
          ? h("th", { scope: "row" }, cell)
          : h("td", { class: head[n].number ? "number" : null }, cell)))))));
}

export function details(id, title, open, ...children) {
  return h("details", { id, open, class: "part" }, h("summary", {}, h("h2", {}, title)), ...children);
}

// One dialog for all; it closes with Escape, as dialogs do.
export function ask(title, ...children) {
  const dialog = document.getElementById("dialog");
  fill(dialog,
    h("div", { class: "dialog-head" }, h("h2", { id: "dialog-title" }, title),
      h("button", { type: "button", onclick: () => dialog.close(), "aria-label": "Close" }, "✕")),
    ...children);
  if (!dialog.open) dialog.showModal();
  return dialog;
}

// Recordings and the model: what is there, what role it has, what is switched on.

import { h, fill, details, table } from "dd/dom.js";
import { seconds } from "dd/units.js";

const ROLES = { fit: "fit to it", held_out: "hold it out", ignored: "leave it aside" };

export function inputs(element, state, connection, { map, presets, models, refresh }) {
  const empty = !state.traces.length && !state.steps.length;
  fill(element,
    details("part-recordings", "Recordings", true,
      state.traces.map((t) => recording(t, connection, map)),
      h("div", { class: "actions" }, picker(connection), empty ? h("button", { id: "demo", class: "primary", onclick: () => connection.do("demo") }, "Begin with the demo") : null)),
    details("part-model", "Model", true, state.machine ? model(state, connection, models, refresh) : preset(connection, presets),
      state.machine ? details("part-preset", "Another machine", false, preset(connection, presets)) : null));
}

// What the reader had to say of a recording: one line as it is, more of them folded.
function remarks(t, lines) {
  const told = lines.map((line) => h("p", { class: "fine" }, line));
  return told.length < 2 ? told : h("details", { id: `remarks-${t.id}` }, h("summary", {}, `${told.length} remarks on reading it`), told);
}

function recording(t, connection, map) {
  const role = h("select", { id: `role-${t.id}`, "aria-label": `Role of ${t.name}`, onchange: () => connection.do("role", { trace: t.id, role: role.value }) },
    Object.entries(ROLES).map(([value, text]) => h("option", { value }, text)));
  role.value = t.role;
  const records = Object.entries(t.records ?? {});
  return h("article", { class: "recording", "data-trace": t.name, "data-status": t.status },
    h("h3", {}, t.name),
    t.status === "reading" ? h("p", { class: "fine" }, "reading …") : null,
    t.status === "unread" ? h("p", { class: "warning" }, t.message) : null,
    records.length === 1 ? h("p", { class: "fine" }, `${records[0][1].samples.toLocaleString("en")} samples, ${seconds(records[0][1].span[1] - records[0][1].span[0])}`) : null,
    records.length > 1 ? parts(t, records, connection) : null,
    remarks(t, [...new Set(records.flatMap(([, r]) => r.log))]),
    h("div", { class: "actions" }, role,
      h("button", { id: `map-${t.id}`, onclick: () => map(t.id) }, t.status === "unread" ? "Map its columns" : "Columns"),
      t.map ? h("button", { id: `save-map-${t.id}`, "data-file": `${t.name}.map.toml` }, "Save mapping") : null,
      h("button", { id: `remove-${t.id}`, "aria-label": `Remove ${t.name}`, onclick: () => connection.do("remove", { trace: t.id }) }, "Remove")));
}

function parts(t, records, connection) {
  const chosen = new Set(t.parts ?? records.map(([name]) => name));
  const boxes = records.map(([name, r], k) => h("label", { class: "check" },
    h("input", { type: "checkbox", id: `part-${t.id}-${k}`, checked: chosen.has(name), onchange: (event) => {
      if (event.target.checked) chosen.add(name);
      else chosen.delete(name);
    } }), `${name}: ${seconds(r.span[1] - r.span[0])}`));
  return details(`parts-${t.id}`, `${chosen.size} of ${records.length} parts`, false, boxes,
    h("button", { id: `parts-go-${t.id}`, onclick: () => connection.do("parts", { trace: t.id, parts: [...chosen] }) }, "Use these"));
}

function picker(connection) {
  const input = h("input", { type: "file", id: "files", multiple: true, class: "unseen", tabindex: "-1", "aria-label": "Files", onchange: async () => {
    await take([...input.files], connection);
    input.value = "";
  } });
  return [h("button", { id: "pick", onclick: () => input.click() }, "Add files …"), input];
}

// Recordings first, so that a mapping finds its own.
export async function take(files, connection) {
  const late = (file) => file.name.toLowerCase().endsWith(".toml");
  for (const file of [...files].sort((a, b) => late(a) - late(b))) await connection.upload(file);
}

function preset(connection, presets) {
  const select = h("select", { id: "preset", "aria-label": "Machine that comes with dualdrive" }, presets.map((name) => h("option", { value: name }, name)));
  return h("div", { class: "actions" }, select, h("button", { id: "preset-go", onclick: () => connection.do("preset", { name: select.value }) }, "Take it"),
    h("p", { class: "fine" }, "or drop a machine file (.toml) on the page"));
}

function model(state, connection, models, refresh) {
  const m = state.machine;
  const off = new Set(state.variants.flatMap((v) => v.without));
  return [
    h("h3", {}, m.name), h("p", { class: "fine" }, m.title),
    h("fieldset", {}, h("legend", {}, "Drawn over the measured"),
      models.map((s) => h("label", { class: "check" },
        h("input", { type: "checkbox", id: `show-${s.id}`, checked: s.shown, disabled: s.status !== "ready", onchange: (event) => refresh(s.id, event.target.checked) }),
        s.label, s.status === "waiting" ? " …" : s.status === "failed" ? h("span", { class: "warning" }, ` ${s.message}`) : ""))),
    h("fieldset", {}, h("legend", {}, "Effects of the last model, switched off for a look"),
      effects(state).map((label) => h("label", { class: "check" },
        h("input", { type: "checkbox", id: `effect-${label}`, checked: !off.has(label), onchange: (event) => {
          if (event.target.checked) off.delete(label);
          else off.add(label);
          connection.do("variant", { without: [...off] });
        } }), label)),
      effects(state).length ? null : h("p", { class: "fine" }, "none in it")),
    details("part-numbers", "Numbers of the first model", false, table("Numbers of the machine", ["number", "value"], m.numbers.map(([path, value]) => [path, value]))),
  ];
}

// Those that the machine came with, and those of the rungs.
function effects(state) {
  const added = state.steps.flatMap((s) => s.label.startsWith("+ ") ? s.label.slice(2).split(" + ") : []);
  return [...state.machine.effects, ...added];
}

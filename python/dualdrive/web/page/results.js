// What was found: where it fails, what is missing, what could explain it, residuals, what to do next.

import { h, fill, details, table } from "dd/dom.js";
import { curve, stems } from "dd/chart.js";
import { digits, human, percent, whole } from "dd/units.js";

// view: comparison of the model that is looked at; diagnosis: the last one, or null.
export function results(element, state, view, diagnosis, connection, shade) {
  const side = view?.fit;
  const own = diagnosis && state.diagnosis.step === state.steps[state.steps.length - 1]?.id;
  const followed = diagnosis && state.steps.length > 1 && state.steps[state.steps.length - 2].id === state.diagnosis.step && state.steps[state.steps.length - 1].how === "refitted";
  fill(element,
    diagnosis ? details("part-candidates", "What could explain it", own || followed, own || followed ? null : h("p", { class: "fine" }, "found for an earlier model"), candidates(diagnosis, connection, own || followed, own)) : null,
    diagnosis?.shapes.length ? details("part-missing", "What is missing", true, shapes(diagnosis)) : null,
    side ? details("part-where", "Where it fails", true, where(side, shade)) : null,
    diagnosis?.moved.length ? details("part-moved", "Numbers that moved", false, table("Numbers that the refit moved", ["number", "refitted [95 % interval]"], diagnosis.moved)) : null,
    diagnosis?.next_experiment ? details("part-next", "What to measure next", true, next(diagnosis)) : null,
    side ? details("part-fit", "Fit of every channel", false, fits(view)) : null,
    side ? details("part-residuals", "Residual correlations", false, correlations(side)) : null,
    side?.notes.length ? details("part-notes", "Notes", false, side.notes.map((line) => h("p", { class: "fine" }, line))) : null);
}

function where(side, shade) {
  const seen = side.where.filter((c) => c.kind !== "order" && c.excess > 1).sort((a, b) => b.significant - a.significant || b.excess - a.excess).slice(0, 10);
  const sure = seen.filter((c) => c.significant).length;
  const key = (c) => `${c.kind}|${c.condition}`;
  const swatch = (c) => (shade.chosen.has(key(c)) ? h("i", { class: `swatch cause-${shade.chosen.get(key(c))}`, "aria-hidden": "true" }) : null);
  return [
    h("p", { class: "fine" }, sure ? "The error is larger here than elsewhere, beyond chance. Tick a condition to shade its stretches." : "Nowhere is the error larger beyond chance: what is wrong is wrong all over. Tick a condition to shade its stretches."),
    h("table", { class: "where" }, h("caption", { class: "unseen" }, "Residual by condition"),
      h("thead", {}, h("tr", {}, ["condition", "× average", "of the time"].map((t, k) => h("th", { scope: "col", class: k ? "number" : null }, t)))),
      h("tbody", {}, seen.map((c, k) => h("tr", { class: c.significant ? "marked" : null },
        h("th", { scope: "row" }, h("label", { class: "check" }, h("input", { type: "checkbox", id: `shade-${k}`, checked: shade.chosen.has(key(c)), onchange: (event) => shade.toggle(key(c), event.target.checked) }), c.condition, swatch(c))),
        h("td", { class: "number" }, digits(c.excess)), h("td", { class: "number" }, percent(c.time)))))),
    side.orders.map((o) => h("p", { class: "fine" }, `${o.title}: ripple of ${human(o.amplitude, o.unit)}, ${o.spoken}, ${percent(o.share)} of the residual's square`)),
  ];
}

function candidates(d, connection, current, own) {
  const rest = 1 - d.candidates.reduce((sum, c) => sum + (c.resolved ? c.probability : 0), 0);
  return [
    d.unjudged ? h("p", { class: "groups", id: "unjudged" }, d.unjudged) : null,
    d.groups.map((group) => h("p", { class: "groups" }, `This recording can't tell apart: ${group.join(", ")}.`)),
    own ? h("div", { class: "candidate" }, h("div", { class: "row" }, h("span", {}, "the same model, numbers refitted: ", h("strong", {}, percent(d.error.refitted))), h("button", { id: "add-refit", onclick: () => connection.do("add", { label: "" }) }, "Take these numbers"))) : null,
    d.candidates.slice(0, 3).map((c, k) => candidate(c, k, d, connection, current)),
    d.candidates.length > 3 ? h("details", { id: "more-candidates" }, h("summary", {}, `${d.candidates.length - 3} ${d.unjudged ? "more" : "less likely ones"}`), d.candidates.slice(3, 12).map((c, k) => candidate(c, k + 3, d, connection, current))) : null,
    d.candidates.length && !d.unjudged && rest > 0.01 ? h("p", { class: "fine", id: "rest" }, `probability ${digits(rest)}: nothing, more than one, or what is not listed`) : null,
    d.candidates.length ? null : h("p", {}, "No effect was tried."),
  ];
}

function candidate(c, k, d, connection, current) {
  const about = d.about[c.effect] ?? {};
  const judged = c.resolved && !d.unjudged;
  const gain = c.gain === null ? "–" : digits(Math.round(c.gain), 6).replace(/\.0+$/, "");
  return h("article", { class: `candidate ${c.label === d.named ? "named" : ""}`, "data-candidate": c.label },
    h("div", { class: "row" }, h("h3", {}, c.label),
      h("button", { id: `add-${k}`, class: k === 0 && !d.unjudged ? "primary add" : "add", disabled: !current, onclick: () => connection.do("add", { label: c.label }) }, "Add", h("span", { class: "unseen" }, ` ${c.label}`))),
    judged ? h("div", { class: "track", "aria-hidden": "true" }, h("i", { class: "fitted", style: { width: `${100 * c.probability}%` } })) : null,
    h("p", { class: "fine" }, c.resolved
      ? `${judged ? `probability ${c.probability < 5e-4 ? "< 0.001" : digits(c.probability)}; ` : ""}cross-validated ${percent(c.held_out)}; explains ${percent(c.explained)} of what is missing; gain ${gain}`
      : `gain ${d.unjudged ? "so far" : "expected"} ${gain}${c.note ? "" : "; screened only"}`),
    c.sizes.length ? h("ul", {}, c.sizes.map((line) => h("li", {}, line))) : null,
    c.note ? h("p", { class: "fine" }, c.note) : null,
    about.equation ? h("details", { id: `about-${k}` }, h("summary", {}, "equation, rivals"), h("p", { class: "equation" }, about.equation), h("p", { class: "fine" }, `confused with: ${about.confused_with.join(", ") || "nothing"}. ${about.source}`)) : null);
}

function shapes(d) {
  const shown = d.shapes.filter((s) => s.at.length > 1).sort((a, b) => b.explained - a.explained);
  const missing = Object.entries(d.missing_torque ?? {});
  return [
    missing.length ? table("Torque of unknown course that the refitted model asks for", ["equation", { text: "RMS", number: true }, { text: "of the drive", number: true }], missing.map(([name, m]) => [name, human(m.rms, "N*m"), percent(m.share)])) : null,
    shown.slice(0, 3).map(drawn),
    shown.length > 3 ? h("details", { id: "more-shapes" }, h("summary", {}, "Along what else"), shown.slice(3).map(drawn)) : null,
  ];
}

function drawn(s) {
  return h("figure", {}, curve(s), h("figcaption", {}, `${s.equation} along ${s.coordinate}, with its 95 % band: explains ${percent(s.explained)}`));
}

function next(d) {
  const e = d.next_experiment;
  const tells = e.expected_distance >= 11 ? "tells" : "goes some way to tell";
  return [
    h("p", {}, h("strong", {}, e.name), ` ${tells} ${e.separates[0]} from ${e.separates[1]} (expected distance ${digits(e.expected_distance)}, where 11 is right in 95 % of cases). ${whole(e.why)}`),
    h("pre", { tabindex: "0" }, e.motion),
    Object.keys(e.settings).length ? h("p", { class: "fine" }, `Set for it: ${Object.entries(e.settings).map(([p, v]) => `${p} = ${v}`).join(", ")}`) : null,
    h("p", {}, h("button", { id: "save-next", "data-file": "next-experiment.csv" }, "Save the commanded motion")),
    h("p", { class: "fine" }, "What the model expects of it:"),
    h("pre", { id: "try-next", tabindex: "0" }, ["dualdrive simulate machine.toml --motion next-experiment.csv", ...Object.entries(e.settings).map(([p, v]) => `--set ${p}=${v}`), "--plot expected.png"].join(" ")),
  ];
}

function fits(view) {
  return ["fit", "held_out"].filter((side) => view[side]).map((side) => table(side === "fit" ? "Fitted" : "Held out",
    ["channel", { text: "best fit", number: true }, { text: "error", number: true }, { text: "noise", number: true }, { text: "RMS residual", number: true }],
    view[side].quantities.slice(0, 40).map((q) => [view[side].records.length > 1 ? `${q.record}: ${q.name}` : q.name, q.fit_percent === null ? "–" : `${digits(q.fit_percent)} %`, percent(q.error, 2), percent(q.noise_floor, 2), human(q.rms, q.unit)])));
}

function correlations(side) {
  return [
    h("p", { class: "fine" }, "Of a model that lacks nothing the residual is white and free of the input: stems stay in the 99 % band."),
    side.correlations.slice(0, 8).map((c) => h("figure", {},
      stems(c.lags.slice(1), c.auto.slice(1), c.auto_band, ["lag [s]", "auto"], `Autocorrelation of the residual of ${c.name}`),
      stems(c.cross_lags, c.cross, c.cross_band, ["lag [s]", "with input"], `Cross-correlation of the residual of ${c.name} with the commanded speed`),
      h("figcaption", {}, `${c.record}: ${c.name}, with itself and with the commanded speed`))),
  ];
}

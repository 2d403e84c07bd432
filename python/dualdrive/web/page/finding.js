// The first thing to read: one sentence, the ladder of errors, and what to do next.

import { h, fill } from "dd/dom.js";
import { digits, percent, whole } from "dd/units.js";

export function finding(element, state, diagnosis, connection, effort) {
  const step = state.steps[state.steps.length - 1];
  const fit = step?.error?.fit;
  const busy = state.jobs.some((job) => ["diagnose", "add", "climb", "machine"].includes(job.kind));
  fill(element,
    h("p", { class: "sentence", id: "sentence" }, sentence(state, step, fit, diagnosis)),
    diagnosis && state.diagnosis.step === step?.id && diagnosis.paragraph ? h("details", { id: "in-full" }, h("summary", {}, "In full"), h("p", { class: "fine" }, diagnosis.paragraph)) : null,
    diagnosis && state.diagnosis.step === step?.id && diagnosis.warnings.map((line) => h("p", { class: "warning" }, whole(line))),
    h("div", { class: "actions" },
      h("button", { id: "diagnose", class: "primary", disabled: !state.ready || !step || busy, onclick: () => connection.do("diagnose", { effort: effort.value }) }, "Diagnose"),
      h("button", { id: "climb", disabled: !state.ready || !step || busy, onclick: () => connection.do("climb", { effort: effort.value }) }, "Improve until nothing is left"),
      h("label", {}, "effort ", effortChoice(effort))),
    under,
    state.steps.length ? ladder(state.steps, judged(state)) : null);
}

function effortChoice(effort) {
  const select = h("select", { id: "effort", onchange: () => { effort.value = select.value; } },
    ["quick", "normal", "thorough"].map((name) => h("option", { value: name }, name)));
  select.value = effort.value;
  return select;
}

function sentence(state, step, fit, diagnosis) {
  if (!state.traces.length && !step) return "Drop a recording and a machine file anywhere on this page, or begin with the demo.";
  if (!state.traces.length) return "There is a machine. Drop the recordings to hold it against.";
  const unread = state.traces.find((t) => t.status === "unread");
  if (unread) return `${unread.name} can't be read yet: say which column is which.`;
  if (!step) return "There are recordings. Drop a machine file, or choose a preset.";
  if (step.status === "failed") return `The model can't be held against the recordings: ${step.message}.`;
  if (diagnosis && state.diagnosis.step === step.id) return diagnosis.headline;
  if (!fit) return "Holding the model against the recordings …";
  const misses = `${step.label === "nominal" ? "As described" : `With ${step.label.replace(/^\+ /, "")}`} the model misses what was recorded by ${percent(fit.headline)}`;
  if (fit.noise_floor === null) return `${misses}.`;
  const times = fit.headline / fit.noise_floor;
  if (times < 1.2) return `${misses}, and the sensors alone leave ${percent(fit.noise_floor)}: there is nothing left to find.`;
  return `${misses}; the sensors alone would leave ${percent(fit.noise_floor)}. ${step.label === "nominal" ? "Something is missing, or numbers are off: diagnose it." : `Still ${digits(times, 2)} times the noise.`}`;
}

// What is computed now. Its elements stay while it goes on: a button that is replaced ten times a
// second loses the click.
const under = h("div", { id: "jobs" });
const lines = new Map();

export function progress(jobs, connection) {
  const now = new Set(jobs.map((job) => job.number));
  for (const [number, line] of lines) if (!now.has(number)) { line.element.remove(); lines.delete(number); }
  for (const job of jobs) {
    if (!lines.has(job.number)) lines.set(job.number, line(job, connection));
    lines.get(job.number).tell(job);
  }
}

function line(job, connection) {
  const bar = h("progress", { "aria-label": job.title });
  const what = h("span", { class: "fine what" });
  const cancel = (id, name, text, more) => h("button", { id: `${id}-${job.number}`, class: name, onclick: () => connection.do("cancel", { number: job.number, ...more }) }, text);
  const patient = ["diagnose", "climb"].includes(job.kind);
  const element = h("div", { class: "job", "data-job": job.number }, h("strong", {}, job.title), bar, what,
    patient ? cancel("keep", null, "Stop, keep what is known", { keep: true }) : null, cancel("cancel", "cancel", "Cancel", {}));
  under.append(element);
  return { element, tell: (told) => {
    if (told.of) { bar.max = told.of; bar.value = told.done; } else bar.removeAttribute("value");
    const best = told.leader ? `best so far ${told.leader}` : told.best === undefined ? "" : `${percent(told.best)} of the misfit left`;
    what.textContent = [told.text, best, told.seconds ? `${Math.round(told.seconds)} s` : ""].filter(Boolean).join(" · ");
  } };
}

// What the error is a share of, which depends on how the model is held against the recordings.
const JUDGED = {
  closed_loop: "RMS residual over RMS signal",
  balance: "by torque balance, RMS of what the equations of motion leave over RMS torque",
};

function judged(state) {
  const words = JUDGED[state.steps.findLast((s) => s.mode)?.mode ?? "closed_loop"];
  return state.machine?.axis === "linear" ? words.replaceAll("torque", "force") : words;
}

// A rung per row: bars to one scale, a line at the noise floor, numbers beside them.
function ladder(steps, judged) {
  const errors = steps.map((s) => [s.error?.fit?.headline, s.error?.held_out?.headline, s.error?.fit?.noise_floor]);
  const most = Math.max(...errors.flat().filter((x) => x !== undefined && x !== null), 1e-9) * 1.05;
  const share = (x) => `${100 * (x ?? 0) / most}%`;
  return h("table", { class: "ladder", id: "ladder" },
    h("caption", {}, `How the error falls: ${judged}, down to the noise floor`),
    h("thead", {}, h("tr", {}, ["model", "", "fitted", "held out", "noise floor"].map((t, k) => h("th", { scope: "col", class: k > 1 ? "number" : null }, t || h("span", { class: "unseen" }, "bar"))))),
    h("tbody", {}, steps.map((s, k) => {
      const [fit, held, floor] = errors[k];
      return h("tr", { class: k === steps.length - 1 ? "marked" : null },
        h("th", { scope: "row" }, s.label),
        h("td", { class: "bars" }, h("div", { class: "track", "aria-hidden": "true" },
          h("i", { class: "fitted", style: { width: share(fit) } }),
          held === undefined ? null : h("i", { class: "held", style: { left: share(held) } }),
          floor === undefined || floor === null ? null : h("i", { class: "floor", style: { left: share(floor) } }))),
        h("td", { class: "number" }, s.status === "waiting" ? "…" : s.status === "failed" ? "failed" : percent(fit)),
        h("td", { class: "number" }, percent(held)),
        h("td", { class: "number" }, percent(floor)));
    })));
}

// Which panels stand there: measured over model where there is a model, the channels before that,
// and what the person has put together.

const TONES = ["model", "second", "third", "fourth", "fifth", "sixth"];
const KINDS = ["following error", "deflection", "current", "torque", "speed", "angle", "equation"];

// models: [{label, job, view}] in the order of the ladder; record: which; residual: beside or instead.
export function panels(state, models, choice) {
  const own = compared(models, choice);
  const plain = own.length ? own : channels(state, choice.record);
  return [...plain, ...choice.custom];
}

function compared(models, { record, show, all }) {
  const first = models.find((m) => role(m.view, record));
  if (!first) return [];
  const store = (m) => `${m.job}/${role(m.view, record)}`;
  const known = models.filter((m) => role(m.view, record));
  const found = first.view[role(first.view, record)];
  const quantities = found.quantities.filter((q) => q.record === record && (q.headline || all));
  quantities.sort((a, b) => KINDS.indexOf(a.kind) - KINDS.indexOf(b.kind));
  const specs = quantities.map((q) => {
    const lines = known.map((m, k) => {
      const back = known.length - 1 - k; // the last model looks the same whatever came before it
      return { tone: TONES[back % TONES.length], dash: back + 1, label: m.label, m };
    });
    const measured = show === "residual" ? [] : [{ key: { store: store(first), record, name: `${q.name}.measured` }, label: "measured", tone: "measured" }];
    const kind = show === "residual" ? "residual" : "model";
    return {
      id: q.name,
      title: `${q.title}${show === "residual" ? ", model − measured" : ""}`,
      unit: q.unit,
      peak: show === "residual" ? q.rms * 3 : q.peak,
      series: [...measured, ...lines.map((l) => ({ key: { store: store(l.m), record, name: `${q.name}.${kind}` }, label: l.label, tone: l.tone, dash: l.dash }))],
    };
  });
  const last = known[known.length - 1];
  const meshes = last.view[role(last.view, record)].flanks[record] ?? [];
  if (meshes.length) {
    specs.push({
      id: "flanks", title: `flanks, ${last.label}`, unit: "", peak: 1, height: 60, ticks: { "-1": "back", 0: "gap", 1: "front" },
      series: meshes.map((mesh, k) => ({ key: { store: store(last), record, name: `${mesh}.flank` }, label: mesh, tone: k ? "model" : "second", dash: k ? 1 : 0 })),
    });
  }
  return specs;
}

// Which of a comparison's two sides holds the record.
function role(view, record) {
  return ["fit", "held_out"].find((side) => view?.[side]?.records.includes(record));
}

// Before there is a model: one panel per unit.
function channels(state, record) {
  const trace = state.traces.find((t) => t.status === "ready" && t.records[record]);
  if (!trace) return [];
  const groups = new Map();
  for (const c of trace.records[record].channels) {
    const level = c.peak > 0 ? Math.round(Math.log10(c.peak) / 2) : 0;
    const key = `${c.unit}|${level}`;
    if (!groups.has(key)) groups.set(key, []);
    groups.get(key).push(c);
  }
  return [...groups.values()].slice(0, 10).map((own) => ({
    id: own.map((c) => c.name).join(","),
    title: own.length === 1 ? own[0].long_name : common(own),
    unit: own[0].unit,
    peak: Math.max(...own.map((c) => c.peak)),
    series: own.slice(0, 6).map((c, k) => ({ key: { store: trace.store, record, name: c.name }, label: c.name, tone: ["measured", ...TONES][k], dash: k })),
  }));
}

function common(channels) {
  const words = { rad: "angles", "rad/s": "speeds", A: "currents", V: "voltages", "N*m": "torques", m: "positions", N: "forces" };
  return words[channels[0].unit] ?? "channels";
}

// Every record there is, and every series that can be put into a panel of one's own.
export function records(state) {
  return state.traces.filter((t) => t.status === "ready").flatMap((t) => Object.keys(t.records).filter((name) => !t.parts || t.parts.includes(name)));
}

export function everything(state, models) {
  const found = state.traces.filter((t) => t.status === "ready").flatMap((t) => Object.entries(t.records).flatMap(([record, r]) =>
    r.channels.map((c) => ({ key: { store: t.store, record, name: c.name }, label: `${record}: ${c.name}`, unit: c.unit, peak: c.peak }))));
  for (const m of models) {
    for (const side of ["fit", "held_out"]) {
      for (const q of m.view?.[side]?.quantities ?? []) {
        for (const kind of ["model", "residual"]) {
          found.push({ key: { store: `${m.job}/${side}`, record: q.record, name: `${q.name}.${kind}` }, label: `${q.record}: ${q.name}, ${kind} ${m.label}`, unit: q.unit, peak: q.peak });
        }
      }
    }
  }
  return found;
}

export function ownPanel(chosen, count) {
  return {
    id: `own-${count}`, title: "own panel", unit: chosen[0].unit, peak: Math.max(...chosen.map((c) => c.peak)),
    series: chosen.slice(0, 6).map((c, k) => ({ key: { ...c.key, shift: c.shift }, label: c.shift ? `${c.label} (${c.shift > 0 ? "+" : ""}${c.shift} s)` : c.label, tone: ["measured", ...TONES][k], dash: k })),
  };
}

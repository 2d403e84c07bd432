"""Results as the page reads them: plain JSON, every number there or ``null``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dualdrive import describe
from dualdrive.machine import Machine, MachineError
from dualdrive.plain import plain
from dualdrive.readable import interval, scale
from dualdrive.traces import CHANNELS, Proposal, Trace
from dualdrive.workbench.limits import MOST_STRETCHES
from dualdrive.workbench.series import write_store

if TYPE_CHECKING:
    from dualdrive.compare import Ripple
    from dualdrive.diagnose import Diagnosis

__all__ = ["compared", "diagnosis", "machine", "proposal", "record"]


def record(part: Trace) -> dict[str, Any]:
    """A recording in words: length, channels, what was repaired."""
    return {
        "samples": len(part),
        "step": part.step,
        "span": [float(part.t[0]), float(part.t[-1])],
        "labels": dict(part.labels),
        "channels": [
            {
                "name": n,
                "unit": part.units[n],
                "long_name": part.long_names[n],
                "peak": float(np.max(np.abs(part[n]))),
            }
            for n in part
        ],
        "log": [str(issue) for issue in part.log][:20],
    }


def proposal(found: Proposal) -> dict[str, Any]:
    """A proposed mapping, column by column, and the canonical names there are to choose from."""
    return dict(
        plain(
            {
                "mapping": found.mapping.as_dict(),
                "columns": [
                    {name: getattr(g, name) for name in type(g).__slots__} for g in found.columns
                ],
                "notes": list(found.notes),
                "channels": {n: [c.unit, c.long_name] for n, c in CHANNELS.items()},
            }
        )
    )


def machine(m: Machine) -> dict[str, Any]:
    """A machine in a few words: what stands beside the plots."""
    return {
        "name": m.name,
        "title": m.title,
        "axis": m.axis,
        "drive_train": m.drive_train,
        "effects": m.effects,
        "numbers": [[p.path, describe.reading(p), p.doc] for p in describe.tied(m)],
        "history": [entry.get("change", "") for entry in m.history],
    }


def compared(
    m: Machine, traces: Mapping[str, Trace], folder: Path, mode: str = "auto"
) -> dict[str, Any]:
    """Hold a machine against recordings: series into a store, the rest as JSON."""
    from dualdrive.compare import (
        compare,
        failing_stretches,
        of_evaluation,
        residual_correlations,
        ripples,
        situations_of,
    )
    from dualdrive.identify import evaluate, which_mode

    mode = which_mode(m.core, traces, None) if mode == "auto" else mode
    found = evaluate(m, traces) if mode == "closed_loop" else None
    c = of_evaluation(m, found) if found is not None else compare(m, traces, mode)
    situations = situations_of(c, found, traces)
    replays = found.replays if found is not None else []
    flanks = {
        r.record.name: {k: v for k, v in r.flanks.items() if m.core.kind(k) != "rigid"}
        for r in replays
    }
    store: dict[str, Any] = {}
    for q in c.quantities:
        t, own = store.setdefault(q.record, (q.t, {}))
        for kind, values in (
            ("measured", q.measured), ("model", q.simulated), ("residual", q.residual)
        ):  # fmt: skip
            if len(q.t) == len(t):
                own[f"{q.name}.{kind}"] = (values, q.unit, f"{q.long_name}, {kind}")
    for name, own in flanks.items():
        for mesh, contact in own.items():
            store[name][1][f"{mesh}.flank"] = (contact, "", f"{mesh}: -1 back, 0 gap, 1 front")
    write_store(folder, store)
    speed = {s.record: s.speed for s in situations}
    correlations = [
        residual_correlations(q.record, q.name, q.t, q.residual, speed[q.record])
        for q in c.quantities
        if q.headline and len(speed[q.record]) == len(q.t)
    ]
    titles = {q.name: q.title for q in c.quantities}
    return dict(
        plain(
            {
                **c.figures(),
                "orders": [_ripple(r, titles) for r in ripples(c.orders)[:3]],
                "quantities": [_quantity(q) for q in c.quantities],
                "remarks": c.remarks(),
                "stretches": [
                    {**vars(s), "intervals": s.intervals.tolist()}
                    for s in failing_stretches(c, situations, MOST_STRETCHES)
                ],
                "correlations": [
                    {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in vars(r).items()}
                    for r in correlations[:24]
                ],
                "flanks": {name: list(own) for name, own in flanks.items()},
            }
        )
    )


def _ripple(r: Ripple, titles: Mapping[str, str]) -> dict[str, Any]:
    """A line in the spectrum of a residual: of what, how often per turn, how large at most."""
    o = r.largest
    told = {"title": titles.get(o.channel, o.channel), "spoken": r.spoken}
    return {**told, "amplitude": o.amplitude, "unit": o.unit, "share": o.share}


def _quantity(q: Any) -> dict[str, Any]:
    """One quantity of one record; the fit in per cent is that of system identification (NRMSE)."""
    error, floor = q.shares
    return {
        "record": q.record,
        "name": q.name,
        "kind": q.kind,
        "title": q.title,
        "unit": q.unit,
        "long_name": q.long_name,
        "headline": q.headline,
        "error": error,
        "noise_floor": floor,
        "fit_percent": 100.0 * (1.0 - error),
        "rms": q.rms,
        "peak": float(np.max(np.abs(q.measured), initial=0.0)),
        "offset": q.offset,
    }


def diagnosis(d: Diagnosis, m: Machine) -> dict[str, Any]:
    """A diagnosis with what the library knows of its candidates."""
    from dualdrive.diagnose import headline
    from dualdrive.report.remedies import UNJUDGED, in_order, sizes

    figures, listed = d.figures(), in_order(d)
    told = {c.label: figure for c, figure in zip(d.candidates, figures["candidates"], strict=True)}
    return dict(
        plain(
            {
                **figures,
                "candidates": [{**told[c.label], "sizes": sizes(c)} for c in listed],
                "unjudged": UNJUDGED if d.verdict == "unfinished" else "",
                "headline": headline(d),
                "named": d.best.label if d.best else None,
                "where": [{**vars(c), "significant": c.significant} for c in d.where],
                "about": {
                    effect: _about(effect)
                    for effect in dict.fromkeys(e for c in d.candidates for e, _ in c.effects)
                },
                "shapes": [_shape(s) for s in d.shapes],
                "moved": [
                    [path, interval(v.value, v.low, v.high, v.unit)] for path, v in d.moved.items()
                ],
                "axis": m.axis,
            }
        )
    )


def _about(effect: str) -> dict[str, Any]:
    try:
        found = describe.effect(effect)
    except MachineError:
        return {}
    return {k: found[k] for k in ("equation", "source", "validity", "confused_with")}


def _shape(s: Any) -> dict[str, Any]:
    """Missing torque along a coordinate, in the units in which it reads best."""
    across, up = scale(s.coordinate_unit, s.at), scale(s.unit, s.value)
    return {
        "equation": s.equation,
        "coordinate": s.coordinate,
        "coordinate_unit": across.unit,
        "unit": up.unit,
        "explained": s.explained,
        "at": across(s.at).tolist(),
        **{name: up(getattr(s, name)).tolist() for name in ("value", "low", "high")},
    }

"""Diagnose: is the model good enough, where does it fail, what is missing, what to measure next."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.compare import check_records, compare, equation_at_fault
from dualdrive.compare.equation import EquationAtFault
from dualdrive.diagnose.clocks import evened
from dualdrive.diagnose.confront import Confrontation
from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.diagnose.experiment import next_experiment
from dualdrive.diagnose.heldout import held_out, intervals
from dualdrive.diagnose.judge import Judgement, judge
from dualdrive.diagnose.loop import ClosedLoop
from dualdrive.diagnose.refit import Refit
from dualdrive.diagnose.result import Candidate, Diagnosis, Experiment, Interval
from dualdrive.diagnose.shape import shapes
from dualdrive.diagnose.survey import Clock, Survey, floor_of, survey
from dualdrive.diagnose.words import paragraph
from dualdrive.identify import FitError, which_mode
from dualdrive.interrupt import interrupt
from dualdrive.replay import core_of, named, records
from dualdrive.traces import Trace

Array = NDArray[np.float64]

MODES = ("auto", "closed_loop", "balance")
#: warnings that would make any name a guess, though a comparison may live with them
SPOILT = ("scale", "sign", "swapped", "ratio")
#: what a current or voltage that stands at an extreme may be called: nothing else, then
LIMITS = ("current_limit", "voltage_limit", "torque_constant_saturation")
_TOLD = 8  # candidates in the result
_SEARCH, _PLAN = 0.75, 0.2  # of the budget: for the survey, for the next experiment
_FAR = 2.5  # standard deviations of its prior, or of its interval, from which a number has moved


def diagnose(
    machine: Any,
    traces: Trace | Sequence[Trace] | Mapping[str, Trace],
    *,
    settings: Mapping[str, Mapping[str, float]] | None = None,
    mode: str = "auto",
    motion: Any = None,
    interpolation: str = "auto",
    start: str = "auto",
    tolerance: float | Mapping[str, float] | None = None,
    budget: float = 60.0,
    threads: int | None = None,
    experiment: bool = True,
    checks: bool = True,
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Say what records tell of a machine.

    The machine is confronted with the records (closed loop simulated, or torque balance where the
    controller is unknown). Its nominal numbers are refitted within the tolerances of data sheets
    under every hypothesis; every effect of the library is tried at every place, the best are
    refitted, alone and two at once, and judged by their likelihood under the noise that the best
    one leaves, counted in effective samples. See docs/theory/diagnosis.md.

    Args:
        machine: a machine, or the core's.
        traces: one trace, several, or name -> trace.
        settings: name of a trace -> parameter path -> SI value that held while it was recorded.
        mode: ``closed_loop``, ``balance``, or ``auto``: closed loop where the machine has a
            controller and every trace a commanded motion.
        motion: commanded motion where the traces carry none.
        interpolation: how recorded inputs are read, see :func:`dualdrive.replay.records`.
        start: how the machine stood before, see there.
        tolerance: relative one-sigma tolerance of the nominal numbers, for all or by path; what
            `fit` takes unless given. A guess in the machine file wants a wide one.
        budget: seconds; what it cut is said in the result.
        threads: simulations side by side; as many as there are cores unless given.
        experiment: whether to plan the next experiment where names are left.
        checks: whether to look for swapped, flipped, clipped or foreign channels first.
        progress: told in words what is being tried; Ctrl-C ends the search and keeps what is known.

    Raises:
        ValueError: unknown mode or path, or a trace that can not be held against this machine.
        FitError: the machine itself can not be simulated on the records.

    """
    if mode not in MODES:
        raise ValueError(f"mode = {mode!r}; choose one of {', '.join(MODES)}")
    tell = progress or (lambda _: None)
    core, recorded = core_of(machine), named(traces)
    if mode == "auto":
        mode = which_mode(core, recorded, motion)
    own = dict(settings or {})
    if stray := set(own) - set(recorded):
        raise ValueError(
            f"settings: no trace {', '.join(sorted(stray))}; there are {', '.join(recorded)}"
        )
    with interrupt() as stop:
        clock = Clock(_SEARCH * budget, stop.is_set)
        warnings, late, clipped = list[str](), False, False
        if checks:
            tell("checking the records")
            found = check_records(machine, recorded, mode)
            warnings = [f"{w.trace}: {w.message.removeprefix(f'{w.trace}: ')}" for w in found]
            late = any(w.code == "skew" for w in found)
            clipped = any(w.code == "clipped" for w in found)
            if any(w.fatal or w.code in SPOILT for w in found):
                return _unfit(core, mode, recorded, warnings, clock)
        even = {name: evened(trace) for name, trace in recorded.items()}
        warnings += [
            f"{name}: its stamps jitter by {1e6 * jitter:.3g} us about an even clock, which was "
            "used instead."
            for name, (_, jitter) in even.items()
            if jitter > 0.0
        ]
        recorded = {name: trace for name, (trace, _) in even.items()}
        c: Confrontation
        if mode == "balance":
            c = TorqueBalance(core, recorded, own, apart=not late, tolerance=tolerance)
        else:
            played = records(
                machine,
                recorded,
                motion=motion,
                interpolation=interpolation,
                start=start,
                settings=own,
            )
            c = ClosedLoop(core, played, tolerance=tolerance)
        result = survey(c, clock, threads=threads or os.cpu_count() or 1, tell=tell)
        whole = Clock(budget, stop.is_set)
        whole.begin, whole.cut = clock.begin, clock.cut
        verdict = judge(result)
        if clipped and verdict.ranked and verdict.verdict in ("effect", "ambiguous"):
            [(effect, _), *_] = verdict.ranked[0][0].hypothesis.effects
            if effect not in LIMITS:
                verdict = replace(verdict, verdict="unknown", group=())
        return _told(machine, c, result, verdict, recorded, own, warnings, whole, experiment, tell)


def _told(
    machine: Any,
    c: Confrontation,
    found: Survey,
    verdict: Judgement,
    traces: Mapping[str, Trace],
    settings: Mapping[str, Mapping[str, float]],
    warnings: Sequence[str],
    clock: Clock,
    experiment: bool,
    tell: Callable[[str], None],
) -> Diagnosis:
    candidates = [_candidate(c, found, r, p) for r, p in verdict.ranked[:_TOLD]]
    candidates += _scored_only(c, found, candidates)
    groups = _groups(found, verdict)
    refitted = _machine(machine, c, found.plain)
    best = verdict.ranked[0][0] if verdict.ranked else found.base
    named_ = verdict.verdict in ("effect", "ambiguous")
    improved = _machine(machine, c, best) if named_ else None
    error = _errors(c, found, best if named_ else found.plain)
    known = intervals(found.evidence, found.plain, found.inflation)
    moved = {path: known[path] for path in _moved(c, found.plain, known)}
    tell("the shape of what is missing")
    equation = _equation(verdict, candidates, refitted, traces, clock)
    curves = [] if clock.stop() else shapes(core_of(refitted), traces, settings)
    plan = None
    if experiment and verdict.verdict == "ambiguous" and not clock.stop():
        tell("planning the next experiment")
        plan = _plan(machine, c, found, verdict, clock, tell)
    before = after = None
    if c.mode == "closed_loop" and not clock.stop() and not settings:
        before = compare(refitted, traces)
        after = compare(improved, traces) if improved is not None else None
    command = _command(candidates[0]) if named_ and candidates else ""
    said = paragraph(
        verdict.verdict,
        candidates,
        groups,
        error,
        equation,
        curves,
        plan,
        warnings,
        command,
        list(moved),
    )
    return Diagnosis(
        machine=core_of(machine).name,
        mode=c.mode,
        records=tuple(traces),
        verdict=verdict.verdict,
        candidates=candidates,
        groups=groups,
        equation=equation,
        where=before.where if before is not None else (),
        error=error,
        shapes=curves,
        next_experiment=plan,
        warnings=list(warnings),
        cut=list(clock.cut),
        paragraph=said,
        command=command,
        seconds=clock.used,
        refitted=refitted,
        improved=improved,
        before=before,
        after=after,
        moved=moved,
    )


def _candidate(c: Confrontation, found: Survey, r: Refit, p: float) -> Candidate:
    from dualdrive.diagnose.judge import explained_by

    known = intervals(found.evidence, r, found.inflation)
    own = {path: known[path] for path in r.values()}
    notes = []
    if stuck := r.at_bound():
        notes.append(f"{', '.join(stuck)} stands at its bound")
    if twins := found.twins.get(r.hypothesis.label):
        notes.append(f"the same here as {', '.join(dict.fromkeys(twins))}")
    if r.note:
        notes.append(r.note)
    return Candidate(
        r.hypothesis.effects,
        p,
        own | {path: Interval(x, x, x, "") for path, x in r.hypothesis.fixed.items()},
        c.headline(r.left),
        c.headline(held_out(found.evidence, r)),
        (found.base.chi - r.chi) / found.inflation,
        explained_by(found, r),
        r.resolved,
        "; ".join(notes),
    )


def _scored_only(c: Confrontation, found: Survey, known: Sequence[Candidate]) -> list[Candidate]:
    """The best by score alone, of those that were not refitted: a shortlist, no more."""
    labels = {x.label for x in known}
    rest = {s.label: s for s in reversed(found.scores) if s.label not in labels}
    best = sorted(rest.values(), key=lambda s: -s.gain.gain)[: max(0, _TOLD - len(known))]
    now = c.headline(found.base.left)
    note = "by its score alone, not refitted"
    return [
        Candidate(s.signature.hypothesis.effects, 0.0, {}, now, now, s.gain.gain, 0.0, False, note)
        for s in best
        if s.gain.gain > 0.0
    ]


def _groups(found: Survey, verdict: Judgement) -> list[tuple[str, ...]]:
    """Names that this record can not part: by probability, and by having the same signature."""
    groups = [verdict.group] if verdict.group else []
    if verdict.verdict in ("effect", "ambiguous") and verdict.ranked:
        leader = verdict.ranked[0][0].hypothesis.label
        if twins := [t for t in dict.fromkeys(found.twins.get(leader, ())) if t != leader]:
            groups.append((leader, *twins))
    return groups


def _machine(machine: Any, c: Confrontation, r: Refit) -> Any:
    """A copy of the machine with the refit's effects and numbers."""
    copy = machine.copy()
    core = core_of(copy)
    for effect, place in r.hypothesis.effects:
        if hasattr(copy, "add"):
            copy.add(effect, place)
        else:
            core.add_effect(effect, place)
    values = {p.path: p.value(float(x)) for p, x in zip(c.nominal, r.u, strict=False)}
    for path, value in {**values, **dict(r.hypothesis.fixed), **r.values()}.items():
        core.set(path, value)
    return copy


def _errors(c: Confrontation, found: Survey, best: Refit) -> dict[str, float]:
    floors = [floor_of(s, r) for s, r in zip(c.series, found.best.left, strict=True)]
    noise = [
        f * np.where(np.arange(len(s.t)) % 2, 1.0, -1.0)
        for f, s in zip(floors, c.series, strict=True)
    ]
    return {
        "nominal": c.headline(found.nominal.left),
        "refitted": c.headline(found.plain.left),
        "best": c.headline(best.left),
        "noise_floor": c.headline(noise),
        "held_out_refitted": c.headline(held_out(found.evidence, found.plain)),
        "held_out_best": c.headline(held_out(found.evidence, best)),
    }


def _moved(c: Confrontation, base: Refit, known: Mapping[str, Interval]) -> list[str]:
    """Nominal numbers that the records put elsewhere, beyond doubt."""
    found = []
    for p in c.nominal:
        k = known[p.path]
        if not k.low <= p.nominal <= k.high and abs(k.value - p.nominal) > 0.01 * abs(p.nominal):
            found.append(p.path)
    return found


_EQUATIONS = {"table": "table", "controller": "controller", "ring": "mesh"}


def _equation(
    verdict: Judgement,
    candidates: Sequence[Candidate],
    refitted: Any,
    traces: Mapping[str, Trace],
    clock: Clock,
) -> EquationAtFault | None:
    """From the names where there are any, else from the torque balance."""
    if verdict.verdict in ("adequate", "parameters"):
        return None
    if verdict.verdict == "unknown" or not candidates:
        if clock.stop():
            return None
        try:
            return equation_at_fault(refitted, traces)
        except (ValueError, KeyError, np.linalg.LinAlgError):
            return None
    shares: dict[str, float] = {}
    for candidate in candidates:
        name = equation_of(*candidate.effects[0])
        shares[name] = shares.get(name, 0.0) + candidate.probability
    best = max(shares, key=lambda n: shares[n])
    return EquationAtFault(best, min(shares[best], 1.0), shares)


def equation_of(effect: str, place: str) -> str:
    """The equation that an effect enters: mesh, table, drive, controller, sensors, electrical."""
    from dualdrive import _core

    acts = _core.effect_type(effect).acts_on
    if "sensor" in acts or "estimate" in acts:
        return "sensors"
    if "mesh" in acts:
        return "mesh"
    if "command" in acts or "limit" in acts:
        return "controller"
    if acts == "motor voltage":
        return "electrical"
    return "table" if place in ("table", "ring") else "drive"


def _plan(
    machine: Any,
    c: Confrontation,
    found: Survey,
    verdict: Judgement,
    clock: Clock,
    tell: Callable[[str], None],
) -> Experiment | None:
    rivals = [(r.hypothesis.label, _machine(machine, c, r)) for r, _ in verdict.ranked[:3]]
    noise: dict[str, float] = {}
    for s, r in zip(c.series, found.best.left, strict=True):
        noise[s.name] = max(noise.get(s.name, 0.0), floor_of(s, r))
    left = max(clock.budget - clock.used, 1.0)
    try:
        return next_experiment(
            rivals, noise=noise, channels=list(noise), budget=left, progress=tell
        )
    except (ValueError, FitError) as failure:
        clock.leave_out(f"no next experiment: {failure}")
        return None


def _command(best: Candidate) -> str:
    """The commands that add the leader, one per effect."""
    lines, source = [], "MACHINE"
    for k, (effect, place) in enumerate(best.effects, 1):
        label = f"{effect}@{place}"
        own = {p: v for p, v in best.parameters.items() if p.startswith(f"{label}.")}
        sets = " ".join(f"--set {p.rpartition('.')[2]}={v.value:.6g}" for p, v in own.items())
        target = "grown.toml" if k == len(best.effects) else f"grown-{k}.toml"
        lines.append(f"dualdrive add {source} {label} {sets} -o {target}".replace("  ", " "))
        source = target
    return " && ".join(lines)


def _unfit(
    core: Any, mode: str, traces: Mapping[str, Trace], warnings: Sequence[str], clock: Clock
) -> Diagnosis:
    """Records from which nothing could be concluded name nothing."""
    blank = Diagnosis(
        machine=core.name,
        mode=mode,
        records=tuple(traces),
        verdict="unknown",
        candidates=(),
        groups=(),
        equation=None,
        where=(),
        error={},
        shapes=(),
        next_experiment=None,
        warnings=list(warnings),
        cut=(),
        paragraph="",
        command="",
        seconds=clock.used,
        refitted=None,
        improved=None,
        before=None,
        after=None,
    )
    return replace(blank, paragraph=f"The records can not be judged. {' '.join(warnings)}")

"""Diagnosis where the controller is known: innovations, screening, selection, decision, words."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.compare import Comparison, compare
from dualdrive.compare.equation import EquationAtFault
from dualdrive.diagnose.axis import candidate_on, numbers_on, shape_on
from dualdrive.diagnose.decision import Decision, creeps, decide, removed, upheld
from dualdrive.diagnose.experiment import next_experiment
from dualdrive.diagnose.findings import (
    RIVALS,
    Effects,
    command_for,
    equation_by_name,
    moved_numbers,
    screened,
    with_effects,
)
from dualdrive.diagnose.headline_errors import headline_errors
from dualdrive.diagnose.paragraph import paragraph
from dualdrive.diagnose.result import Candidate, Diagnosis, Experiment, Shape
from dualdrive.diagnose.selection import EFFORTS, Fitted, Selection, select
from dualdrive.diagnose.shape import of_the_filter, shapes
from dualdrive.diagnose.uncertainty import Uncertainty
from dualdrive.estimation.unknowns import Unknown, default_free, default_tolerances, unknowns
from dualdrive.identify import FitError
from dualdrive.innovations import Counter, GreyBox, predictable
from dualdrive.replay import Record, core_of
from dualdrive.said import Counted, Said
from dualdrive.traces import Trace

Array = NDArray[np.float64]

#: relative tolerances of the motors' numbers that a record of currents shows
_ELECTRIC = {"K_d": 0.05, "R": 0.1}


@dataclass(frozen=True)
class Job:
    """What is asked of a diagnosis beside machine and records."""

    settings: Mapping[str, Mapping[str, float]]
    reading: Mapping[str, Any]  # motion, interpolation and start, as `compare` takes them
    tolerance: float | Mapping[str, float] | None
    effort: str
    experiment: bool
    threads: int
    tell: Callable[[str], None]
    stop: Callable[[], bool]

    def compared(self, machine: Any, traces: Mapping[str, Trace]) -> Comparison | None:
        """A machine beside the records, read as they were for the search; None once stopped."""
        if machine is None or self.stop():
            return None
        return compare(machine, traces, settings=self.settings, **self.reading)


def diagnose_closed_loop(
    machine: Any,
    played: Sequence[Record],
    traces: Mapping[str, Trace],
    warnings: Sequence[str],
    job: Job,
) -> Diagnosis:
    """Diagnose records that can be replayed; see :func:`dualdrive.diagnose.diagnose`."""
    core, tell = core_of(machine), Counted(job.tell)
    job = replace(job, tell=tell)
    counter = Counter(job.stop, tell.replays)
    grey = GreyBox(
        core,
        predictable(core, played),
        nominal_unknowns(core, job.tolerance),
        threads=job.threads,
        counter=counter,
    )
    found = select(core, grey, EFFORTS[job.effort], job.tell)
    grey = found.grey
    sure = Uncertainty(grey)
    decision = decide(core, grey, found, sure)
    best, probability = decision.ranked[0]
    leader = f"{best.variant.label}, probability {probability:.2g}" if best.variant.effects else ""
    job.tell(Said("errors of the simulated loop", leader))
    return _told(machine, grey, found, decision, sure, traces, warnings, job)


def nominal_unknowns(core: Any, tolerance: float | Mapping[str, float] | None) -> list[Unknown]:
    """Numbers of the data sheet that every hypothesis may move, each mesh's play by itself.

    Raises:
        ValueError: a tolerance for a number that is not among them.

    """
    paths: list[str] = []
    for path in default_free(core):
        paths += core.members(path) if path.endswith(".gap") else [path]
    electric = [f"{motor}.K_d" for motor in core.motors] + ["motors.R"]
    paths += [p for p in electric if _readable(core, p)]
    usual = default_tolerances(core, paths)
    usual.update({p: _ELECTRIC[p.rpartition(".")[2]] for p in electric if p in paths})
    if isinstance(tolerance, Mapping):
        for path, width in tolerance.items():
            try:
                moved = core.members(path)
            except ValueError as error:
                raise ValueError(f"tolerance: {error}") from None
            members = [p for p in paths if p == path or p in moved]
            if not members:
                raise ValueError(
                    f"tolerance: {path} is not refitted here; there are {', '.join(paths)}"
                )
            usual.update(dict.fromkeys(members, width))
    elif tolerance is not None:
        usual.update({p: tolerance for p in usual if "@" not in p})
    return unknowns(core, paths, usual, {})


def _readable(core: Any, path: str) -> bool:
    try:
        return bool(core.get(path) > 0.0 and not core.unread(path))
    except ValueError:
        return False


def _told(
    machine: Any,
    grey: GreyBox,
    found: Selection,
    decision: Decision,
    sure: Uncertainty,
    traces: Mapping[str, Trace],
    warnings: Sequence[str],
    job: Job,
) -> Diagnosis:
    each, error, out = headline_errors(grey, found, decision, sure)
    decision, error, why = upheld(found, decision, sure, error)
    warnings = [*warnings, *_left_out(sorted(out))]
    if why:
        warnings.append(f"no verdict but unknown can stand: {why}")
    elif why := creeps(decision.verdict, error):
        warnings.append(why)
    candidates = [
        candidate_on(machine, _candidate(grey, found, sure, f, p, each[f.variant.key], error))
        for f, p in decision.ranked
        if f.variant.effects and f.variant.key in each
    ]
    candidates += screened(_scores(found), candidates)
    stands = decision.stands(found)
    named = stands is not found.base
    numbers = numbers_on(machine, sure.intervals(stands))
    nominal = {p.path: numbers[p.path] for p in grey.nominal}
    moved = moved_numbers(grey.nominal, nominal)
    if decision.verdict == "parameters" and not moved:  # told apart, but by next to nothing
        decision = replace(decision, verdict="adequate")
    curves = _curves(machine, grey, found, decision, job)
    plan = _plan(machine, grey, found, decision, job)
    refitted = machine_at(machine, grey, found.base)
    improved = machine_at(machine, grey, stands) if named else None
    job.tell("comparing the refitted machine, and the one that stands, with the records")
    before, after = grey.pool.map(lambda m: job.compared(m, traces), (refitted, improved))
    told = Diagnosis(
        machine=core_of(machine).name,
        mode="closed_loop",
        records=tuple(traces),
        verdict=decision.verdict,
        candidates=candidates,
        groups=[decision.group] if decision.group else [],
        equation=_equation(decision, candidates),
        where=before.where if before is not None else (),
        error=error,
        shapes=curves,
        next_experiment=plan,
        warnings=warnings,
        cut=[] if found.finished else ["stopped before every law had its turn"],
        command=command_for(added(grey.core, stands), numbers) if named else "",
        seconds=0.0,
        refitted=refitted,
        improved=improved,
        before=before,
        after=after,
        moved=moved,
        numbers=nominal,
        over_floor=error["best"] / error["noise_floor"] if error["noise_floor"] else float("nan"),
        effort={"replays": grey.counter.replays, "of": grey.counter.replays},
        missing_torque=dict(decision.missing),
    )
    return replace(told, paragraph=paragraph(told))


def _left_out(names: Sequence[str]) -> list[str]:
    """What to say of records that the errors leave out."""
    if not names:
        return []
    which = f"record {names[0]}" if len(names) == 1 else f"records {', '.join(names)}"
    return [
        f"the errors of the simulated loop leave out {which}: begun as little elsewhere as the "
        "sensors can't tell, the same machine goes another way there, so that no simulation "
        "follows it. The likelihood, which decides, counts every record."
    ]


def machine_at(machine: Any, grey: GreyBox, f: Fitted) -> Any:
    """A copy of the machine with a hypothesis in it, all numbers as fitted."""
    fitted = grey.machine(f.variant, f.point.theta)
    paths = [*(p.path for p in (*grey.nominal, *f.variant.extra)), *f.variant.fixed]
    return with_effects(machine, added(grey.core, f), {path: fitted.get(path) for path in paths})


def added(core: Any, f: Fitted) -> list[tuple[str, str]]:
    """(effect, place) as they were put in: a group's members where each has its own numbers."""
    known = {e["label"] for e in core.effects}
    labels = [e["label"] for e in f.variant.grown.effects if e["label"] not in known]
    return [tuple(label.split("@", 1)) for label in labels]


def _candidate(
    grey: GreyBox,
    found: Selection,
    sure: Uncertainty,
    f: Fitted,
    p: float,
    fitted: float,
    error: Mapping[str, float],
) -> Candidate:
    known = sure.intervals(f)
    nominal = {q.path for q in grey.nominal}
    gain = found.base.point.minus_two_log - f.point.minus_two_log
    return Candidate(
        f.variant.effects,
        p,
        {path: x for path, x in known.items() if path not in nominal},
        fitted,
        fitted * sure.cross_validated(f),
        gain / found.best.inflation,
        removed(error["refitted"], fitted, error["noise_floor"]),
        True,
        _at_bound(grey, f),
    )


def _at_bound(grey: GreyBox, f: Fitted) -> str:
    """Numbers of an effect that stand at what they may be at most or at least."""
    stuck, at = [], grey.values(f.variant, f.point.theta)
    for p in f.variant.extra:
        name, x = p.path.rpartition(".")[2], at[p.path]
        if np.isfinite(p.high) and x >= p.high - 1e-9 * max(1.0, abs(p.high)):
            stuck.append(f"{name} = {x:.3g}, its upper limit")
        elif p.low != 0.0 and np.isfinite(p.low) and x <= p.low + 1e-9 * max(1.0, abs(p.low)):
            stuck.append(f"{name} = {x:.3g}, its lower limit")
    return f"needs {' and '.join(stuck)}: implausible" if stuck else ""


def _scores(found: Selection) -> Iterator[tuple[Effects, float, str]]:
    """Effects that have no fit of their own, what they gain, and a note, best score first."""
    for _, s in found.screened:
        refitted = found.tried.get(s.variant.key)
        if refitted is None:
            yield s.variant.effects, s.gain, "screened only"
        elif s.gain > 0.0:  # dropped where its score promised what no refit kept
            yield s.variant.effects, refitted, "refitted beside the data sheet's noise"


def _equation(decision: Decision, candidates: Sequence[Candidate]) -> EquationAtFault | None:
    """From the names where there are any, else where the torque of unknown course is largest."""
    if decision.verdict in ("adequate", "parameters"):
        return None
    if decision.verdict in ("effect", "ambiguous") and candidates:
        return equation_by_name(c for c in candidates if c.resolved)
    shares: dict[str, float] = {}
    for body, m in decision.missing.items():
        name = body if body == "table" else "drive"
        shares[name] = max(shares.get(name, 0.0), m.share)
    if not shares:
        return None
    best, whole = max(shares, key=lambda n: shares[n]), sum(shares.values())
    return EquationAtFault(best, shares[best] / whole if whole > 0.0 else 0.0, shares, "torque")


def _curves(
    machine: Any, grey: GreyBox, found: Selection, decision: Decision, job: Job
) -> list[Shape]:
    """The shape of what is missing, where anything is."""
    if decision.verdict in ("adequate", "parameters") or job.stop():
        return []
    job.tell("the shape of what is missing")
    courses = of_the_filter(grey, found.base.point, found.base.gains)
    return [shape_on(machine, s) for s in shapes(courses)]


def _plan(
    machine: Any, grey: GreyBox, found: Selection, decision: Decision, job: Job
) -> Experiment | None:
    """The experiment that tells the possible names apart, None where there is none."""
    if not job.experiment or decision.verdict != "ambiguous" or job.stop():
        return None
    job.tell("planning the next experiment")
    rivals, noise = list[tuple[str, Any]](), dict[str, float]()
    for f, _ in decision.ranked:
        if f.variant.label in decision.group and f.variant.label not in {n for n, _ in rivals}:
            rivals.append((f.variant.label, machine_at(machine, grey, f)))
    for r in grey.records:
        known = found.best.noise.variance(r)
        for c in r.record.channels:
            variance = sum(factor**2 * known.get(name, 0.0) for name, factor in c.parts)
            if c.headline:
                noise[c.name] = max(noise.get(c.name, 0.0), float(np.sqrt(variance)))
    try:
        return next_experiment(
            rivals[:RIVALS], noise=noise, channels=list(noise), progress=job.tell, stop=job.stop
        )
    except (ValueError, FitError):
        return None

"""Diagnosis where the controller is known: innovations, screening, selection, decision, words."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.compare import Comparison, compare
from dualdrive.compare.equation import EquationAtFault
from dualdrive.diagnose.axis import candidate_on, numbers_on, shape_on
from dualdrive.diagnose.decision import (
    Decision,
    MissingTorque,
    beside_the_data_sheet,
    decide,
    leaves_too_much,
    numbers_alone,
    objection,
    removed,
    takes_too_little,
)
from dualdrive.diagnose.experiment import next_experiment
from dualdrive.diagnose.findings import equation_of
from dualdrive.diagnose.paragraph import paragraph
from dualdrive.diagnose.result import Candidate, Diagnosis, Experiment, Interval
from dualdrive.diagnose.selection import EFFORTS, Fitted, Selection, select
from dualdrive.diagnose.shape import of_the_filter, shapes
from dualdrive.diagnose.simulated_errors import Simulation, noise_floor, of_the_data_sheet
from dualdrive.diagnose.uncertainty import Uncertainty
from dualdrive.estimation.unknowns import Unknown, default_free, default_tolerances, unknowns
from dualdrive.identify import FitError
from dualdrive.innovations import Counter, GreyBox, Noise, predictable, values
from dualdrive.replay import (
    Record,
    core_of,
)
from dualdrive.said import Counted, Said
from dualdrive.traces import Trace

Array = NDArray[np.float64]

_TOLD = 8  # candidates in the result
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
    return _told(machine, grey, found, decision, sure, played, traces, warnings, job)


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
            members = [p for p in paths if p == path or p in core.members(path)]
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
    played: Sequence[Record],
    traces: Mapping[str, Trace],
    warnings: Sequence[str],
    job: Job,
) -> Diagnosis:
    named = decision.verdict in ("effect", "ambiguous")
    leaders = [f for f, _ in decision.ranked if f.variant.effects]
    best = leaders[0] if leaders else found.base
    refitted = machine_at(machine, grey, found.base)
    improved = machine_at(machine, grey, best) if named else None
    loops = {f.variant.key: Simulation.of(grey, f) for f in (found.base, *leaders[:_TOLD])}
    told = (found.base, best) if named else (found.base,)
    out = _unfollowed(grey, [loops[f.variant.key] for f in told], decision.best.noise)
    errors = {key: loop.error(out) for key, loop in loops.items()}
    refitted_error = errors[found.base.variant.key]
    error = {
        "nominal": of_the_data_sheet(grey).error(out),
        "refitted": refitted_error,
        "noise_floor": noise_floor(grey, decision.best, out),
        "held_out_refitted": refitted_error * sure.cross_validated(found.base),
    }
    error["best"] = errors[best.variant.key] if named else refitted_error
    error["held_out_best"] = (
        error["best"] * sure.cross_validated(best) if named else error["held_out_refitted"]
    )
    if out:
        warnings = [*warnings, _left_out(sorted(out))]
    decision = replace(decision, verdict=beside_the_data_sheet(decision.verdict, error))
    denials = (objection, takes_too_little, leaves_too_much)
    why = next(filter(None, (deny(decision.verdict, error) for deny in denials)), "")
    if why and named and found.quiet:
        decision = numbers_alone(sure, found, decision)
        error |= {"best": refitted_error, "held_out_best": error["held_out_refitted"]}
        named, improved, why = False, None, ""
    if why:
        decision = replace(decision, verdict="unknown", group=())
        warnings = [*warnings, f"no verdict but unknown can stand: {why}"]
        named, improved = False, None
    candidates = [
        _candidate(grey, found, sure, f, p, errors[f.variant.key], error)
        for f, p in decision.ranked
        if f.variant.effects and f.variant.key in errors
    ]
    candidates = [candidate_on(machine, c) for c in candidates]
    candidates += _screened(found, candidates)
    stands = best if named else found.base
    numbers = numbers_on(machine, sure.intervals(stands))
    nominal = {p.path: numbers[p.path] for p in grey.nominal}
    moved = {
        p.path: nominal[p.path]
        for p in grey.nominal
        if not nominal[p.path].low <= p.nominal <= nominal[p.path].high
        and abs(nominal[p.path].value - p.nominal) > 0.01 * abs(p.nominal)
    }
    if decision.verdict == "parameters" and not moved:  # told apart, but by next to nothing
        decision = replace(decision, verdict="adequate")
    equation = _equation(decision, candidates)
    curves = []
    if decision.verdict not in ("adequate", "parameters") and not job.stop():
        job.tell("the shape of what is missing")
        courses = of_the_filter(grey, found.base.point, found.base.gains)
        curves = [shape_on(machine, s) for s in shapes(courses)]
    plan = None
    if job.experiment and decision.verdict == "ambiguous" and not job.stop():
        job.tell("planning the next experiment")
        plan = _plan(machine, grey, found, decision, played, job)
    before, after = (job.compared(m, traces) for m in (refitted, improved))
    groups = [decision.group] if decision.group else []
    command = command_for(best, grey.core, numbers) if named else ""
    cut = [] if found.finished else ["stopped before every law had its turn"]
    said = Diagnosis(
        machine=core_of(machine).name,
        mode="closed_loop",
        records=tuple(traces),
        verdict=decision.verdict,
        candidates=candidates,
        groups=groups,
        equation=equation,
        where=before.where if before is not None else (),
        error=error,
        shapes=curves,
        next_experiment=plan,
        warnings=list(warnings),
        cut=cut,
        command=command,
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
    return replace(said, paragraph=paragraph(said))


def _unfollowed(grey: GreyBox, loops: Sequence[Simulation], noise: Noise) -> set[str]:
    """Records that one of these machines can't follow; none where that would leave no record."""
    out = set[str]().union(*(loop.unfollowed(noise) for loop in loops))
    return out if len(out) < len(grey.records) else set()


def _left_out(names: Sequence[str]) -> str:
    which = f"record {names[0]}" if len(names) == 1 else f"records {', '.join(names)}"
    return (
        f"the errors of the simulated loop leave out {which}: begun as little elsewhere as the "
        "sensors can't tell, the same machine goes another way there, so that no simulation "
        "follows it. The likelihood, which decides, counts every record."
    )


def machine_at(machine: Any, grey: GreyBox, f: Fitted) -> Any:
    """A copy of the machine with a hypothesis in it, all numbers as fitted."""
    copy = machine.copy()
    core = core_of(copy)
    for effect, member in added(grey.core, f):
        if hasattr(copy, "add"):
            copy.add(effect, member)
        else:
            core.add_effect(effect, member)
    fitted = grey.machine(f.variant, f.point.theta)
    known = [p.path for p in grey.nominal] + [p.path for p in f.variant.extra]
    for path in [*known, *f.variant.fixed]:
        core.set(path, fitted.get(path))
    return copy


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
        _at_bound(f),
    )


def _at_bound(f: Fitted) -> str:
    """Numbers of an effect that stand at what they may be at most or at least."""
    stuck, own = [], f.variant.extra
    at = values(own, f.point.theta[len(f.point.theta) - len(own) :])
    for p in own:
        name, x = p.path.rpartition(".")[2], at[p.path]
        if np.isfinite(p.high) and x >= p.high - 1e-9 * max(1.0, abs(p.high)):
            stuck.append(f"{name} = {x:.3g}, its upper limit")
        elif p.low != 0.0 and np.isfinite(p.low) and x <= p.low + 1e-9 * max(1.0, abs(p.low)):
            stuck.append(f"{name} = {x:.3g}, its lower limit")
    return f"needs {' and '.join(stuck)}: implausible" if stuck else ""


def _screened(found: Selection, known: Sequence[Candidate]) -> list[Candidate]:
    """The best by score alone, of those without a refit of their own."""
    labels, rest, nan = {c.label for c in known}, list[Candidate](), float("nan")
    for _, s in found.screened:
        v = s.variant
        if v.label in labels or not s.gain > 0.0 or len(known) + len(rest) >= _TOLD:
            continue
        refitted = found.tried.get(v.key)
        if refitted is not None and not refitted > 0.0:
            continue  # its score promised what no refit kept
        labels.add(v.label)
        note = "screened only" if refitted is None else "refitted beside the data sheet's noise"
        gain = s.gain if refitted is None else refitted
        rest.append(Candidate(v.effects, 0.0, {}, nan, nan, gain, nan, False, note))
    return rest


def _equation(decision: Decision, candidates: Sequence[Candidate]) -> EquationAtFault | None:
    """From the names where there are any, else where the torque of unknown course is largest."""
    if decision.verdict in ("adequate", "parameters"):
        return None
    if decision.verdict in ("effect", "ambiguous") and candidates:
        shares: dict[str, float] = {}
        for c in candidates:
            if c.resolved:
                name = equation_of(*c.effects[0])
                shares[name] = shares.get(name, 0.0) + c.probability
        best = max(shares, key=lambda n: shares[n])
        return EquationAtFault(best, min(shares[best], 1.0), shares, "probability")
    missing: Mapping[str, MissingTorque] = decision.missing
    if not missing:
        return None
    shares = {body if body == "table" else "drive": 0.0 for body in missing}
    for body, m in missing.items():
        key = body if body == "table" else "drive"
        shares[key] = max(shares[key], m.share)
    best = max(shares, key=lambda n: shares[n])
    whole = sum(shares.values())
    probability = shares[best] / whole if whole > 0.0 else 0.0
    return EquationAtFault(best, probability, shares, "torque")


def _plan(
    machine: Any,
    grey: GreyBox,
    found: Selection,
    decision: Decision,
    played: Sequence[Record],
    job: Job,
) -> Experiment | None:
    """The experiment that tells the possible names apart, None where there is none."""
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
            rivals[:3], noise=noise, channels=list(noise), progress=job.tell, stop=job.stop
        )
    except (ValueError, FitError):
        return None


def command_for(best: Fitted, core: Any, known: Mapping[str, Interval]) -> str:
    """The commands that add the leader, one per effect."""
    lines, source, effects = [], "MACHINE", added(core, best)
    for k, (effect, place) in enumerate(effects, 1):
        label = f"{effect}@{place}"
        own = {p: v for p, v in known.items() if p.startswith(f"{label}.")}
        sets = " ".join(f"--set {p.rpartition('.')[2]}={v.value:.6g}" for p, v in own.items())
        target = "grown.toml" if k == len(effects) else f"grown-{k}.toml"
        lines.append(f"dualdrive add {source} {label} {sets} -o {target}".replace("  ", " "))
        source = target
    return " && ".join(lines)


def with_time(found: Diagnosis, seconds: float) -> Diagnosis:
    """The same with the time it took."""
    return replace(found, seconds=seconds)

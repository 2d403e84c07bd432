"""Findings of a torque balance: candidates, groups, errors, equation, what to do next."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from dualdrive.compare import Comparison, equation_at_fault
from dualdrive.compare.equation import EquationAtFault
from dualdrive.describe import unit_on
from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.diagnose.experiment import next_experiment
from dualdrive.diagnose.findings import RIVALS, Effects, equation_by_name, with_effects
from dualdrive.diagnose.heldout import held_out, intervals
from dualdrive.diagnose.judge import Judgement
from dualdrive.diagnose.printed import Printed
from dualdrive.diagnose.refit import Fitter, Refit, Start
from dualdrive.diagnose.result import Candidate, Experiment, Interval
from dualdrive.diagnose.starts import expected
from dualdrive.diagnose.survey import Survey, explained_by
from dualdrive.diagnose.work import Clock
from dualdrive.identify import FitError
from dualdrive.traces import Trace
from dualdrive.units import human


def candidate_of(
    machine: Any, c: TorqueBalance, found: Survey, r: Refit, p: float, printed: Printed
) -> Candidate:
    """A refit as a user reads it."""
    fitted = printed.error(machine_of(machine, c, r))
    known = intervals(found.evidence, r, found.inflation)
    own = {path: known[path] for path in r.values()}
    own |= {path: Interval(x, x, x, _unit(r, path)) for path, x in r.hypothesis.fixed.items()}
    notes = []
    if stuck := [_stuck(machine, r, path) for path in r.at_bound()]:
        notes.append(f"needs {' and '.join(stuck)}: implausible")
    if twins := found.twins.get(r.hypothesis.label):
        notes.append(f"the same here as {', '.join(dict.fromkeys(twins))}")
    if r.note:
        notes.append(r.note)
    return Candidate(
        r.hypothesis.effects,
        p,
        own,
        fitted,
        fitted * _foretold(c, found, r),
        (found.base.chi - r.chi) / found.inflation,
        explained_by(found, r),
        r.resolved,
        "; ".join(notes),
    )


def _stuck(machine: Any, r: Refit, path: str) -> str:
    """A number that stands on a bound, and which."""
    [(p, v)] = [(p, v) for p, v in zip(r.free, r.v, strict=True) if p.path == path]
    end = "upper" if abs(v - p.bounds[1]) < abs(v - p.bounds[0]) else "lower"
    unit = _unit(r, path)
    value = human(p.value(float(v)), unit_on(machine, path, unit) if unit else unit)
    return f"{path.rpartition('.')[2]} = {value}, its {end} limit"


def _unit(r: Refit, path: str) -> str:
    """SI unit of an effect's number."""
    return str(r.grown.parameter(r.grown.members(path)[0]).unit)


def scores_of(found: Survey) -> list[tuple[Effects, float, str]]:
    """Effects that were not refitted, what they would gain, and a note, best first."""
    refitted = {r.hypothesis.label for r in found.refits}
    rest = {s.label: s for s in reversed(found.scores) if s.label not in refitted}
    best = sorted(rest.values(), key=lambda s: -s.gain.gain)
    return [(s.signature.hypothesis.effects, s.gain.gain, "screened only") for s in best]


def groups_of(found: Survey, verdict: Judgement) -> list[tuple[str, ...]]:
    """Names that this record can not part: by probability, and by having the same signature."""
    groups = [verdict.group] if verdict.group else []
    if verdict.verdict in ("effect", "ambiguous") and verdict.ranked:
        leader = verdict.ranked[0][0].hypothesis.label
        twins = [t for t in dict.fromkeys(found.twins.get(leader, ())) if t != leader]
        if twins and not {leader, *twins} <= set(verdict.group):
            groups.append((leader, *twins))
    return groups


def machine_of(machine: Any, c: TorqueBalance, r: Refit) -> Any:
    """A copy of the machine with the refit's effects and numbers."""
    nominal = {p.path: p.value(float(x)) for p, x in zip(c.nominal, r.u, strict=False)}
    sets = {**nominal, **r.hypothesis.fixed, **r.values()}
    return with_effects(machine, r.hypothesis.effects, sets)


def errors_of(
    c: TorqueBalance, found: Survey, best: Refit, before: Comparison, after: Comparison | None
) -> dict[str, float]:
    """Headline errors: refitted, best, held out, and what the sensors alone leave.

    before, after: of the refitted machine, and of the one with the best explanation if there is one
    """
    refitted, whole = before.error["headline"], (after or before).error
    return {
        **errors_of_the_refitted(c, found, refitted),
        "best": whole["headline"],
        "noise_floor": whole["noise_floor"],
        "held_out_best": whole["headline"] * _foretold(c, found, best),
    }


def errors_of_the_refitted(c: TorqueBalance, found: Survey, refitted: float) -> dict[str, float]:
    """The same where a search was stopped: the best is the refitted machine, and no floor known."""
    held_out = refitted * _foretold(c, found, found.plain)
    return {
        "refitted": refitted,
        "best": refitted,
        "noise_floor": math.nan,
        "held_out_refitted": held_out,
        "held_out_best": held_out,
    }


def _foretold(c: TorqueBalance, found: Survey, r: Refit) -> float:
    """Error on stretches that a refit did not see, over that on those it saw."""
    seen = c.headline(r.left)
    return c.headline(held_out(found.evidence, r)) / seen if seen > 0.0 else float("nan")


def equation_at(
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
        if not clock.allows("which equation is at fault"):
            return None
        try:
            return equation_at_fault(refitted, traces)
        except (ValueError, KeyError, np.linalg.LinAlgError):
            return None
    return equation_by_name(candidates)


def plan_next(
    machine: Any,
    c: TorqueBalance,
    found: Survey,
    verdict: Judgement,
    clock: Clock,
    tell: Callable[[str], None],
) -> Experiment | None:
    """The experiment that parts the names that can't be told apart, None where there is none."""
    known = {r.hypothesis.label: r for r, _ in reversed(verdict.ranked)}
    refits = [known.get(k) or _twin(found, verdict, k, clock) for k in verdict.group[:RIVALS]]
    rivals = [(r.hypothesis.label, machine_of(machine, c, r)) for r in refits if r is not None]
    noise: dict[str, float] = {}
    for s in c.series:
        noise[s.name] = max(noise.get(s.name, 0.0), s.floor)
    try:
        return next_experiment(
            rivals,
            noise=noise,
            channels=list(noise),
            progress=tell,
            cut=clock.leave_out,
            stop=clock.stop,
        )
    except (ValueError, FitError) as failure:
        clock.leave_out(f"no next experiment: {failure}")
        return None


def _twin(found: Survey, verdict: Judgement, label: str, clock: Clock) -> Refit | None:
    """A law that was not refitted, since it does the same as the leader: as large as that is."""
    score = next((s for s in found.scores if s.label == label), None)
    if score is None or not verdict.ranked:
        return None
    leader, fitter = verdict.ranked[0][0], Fitter(found.evidence, clock.stop)
    trial = fitter.tried(score.signature.hypothesis, [Start(leader.u, expected(score))])
    return fitter(trial, leader.slopes) if trial else None

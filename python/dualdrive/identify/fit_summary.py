"""From the point where a closed-loop fit has ended to its report."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dualdrive.estimation.unknowns import Unknown
from dualdrive.identify.closed_loop import FitError, Problem
from dualdrive.identify.evaluation import Evaluation, at_point, evaluate_records
from dualdrive.identify.fit_result import Direction, Fit, Fitted
from dualdrive.identify.regression import Prior, Solution, solve
from dualdrive.identify.search import Search

#: a fitted value nearer to its bound than this share of its scale is at it
_AT_BOUND = 1e-3
#: a direction seen this much worse than the best one (columns scaled alike) is reported
_WEAK = 0.02


def summary(machine: Any, problem: Problem, search: Search, confidence: float) -> Fit:
    """Covariance, intervals and errors at the best point of a search."""
    from scipy.stats import t as student

    u, prior, (low, high) = search.best, problem.prior, problem.bounds
    moved = Prior(prior.mean - u, prior.sigma)
    solution = solve(problem.regression_rows(u), moved, low - u, high - u)
    freedom = max(solution.effective - problem.size, 1.0)
    reach = float(student.ppf(0.5 + confidence / 2, freedom)) * solution.width
    names = _names(problem)
    return Fit(
        _with_values(machine, problem, problem.values(u), search.status),
        {
            p.path: _fitted(p, _unit(machine, p), float(u[k]), float(reach[k]), solution, k)
            for k, p in enumerate(problem.parameters)
        },
        at_point(problem, u),
        _nominal(problem),
        _weak(solution, names),
        solution.effective,
        solution.condition,
        confidence,
        solution.covariance,
        names,
        search.status,
        search.message,
        tuple(problem.failures),
        problem.runs,
    )


def _nominal(problem: Problem) -> Evaluation | None:
    try:
        return evaluate_records(
            problem.core, problem.records, offsets=problem.granted, rtol=problem.rtol
        )
    except FitError:
        return None


def _unit(machine: Any, p: Unknown) -> str:
    """On a linear axis the table side counts in m, N and kg."""
    return str(machine.unit_of(p.path, p.unit)) if hasattr(machine, "unit_of") else p.unit


def _fitted(p: Unknown, unit: str, u: float, reach: float, solution: Solution, k: int) -> Fitted:
    low, high = (_inside(p, u + side * reach) for side in (-1, 1))
    value = p.value(u)
    tolerance, verdict = p.sigma, _verdict(solution, k, p.sigma)
    bound = _bound(value, p)
    if bound:
        low, high = (p.low, high) if "lower" in bound else (low, p.high)
    return Fitted(p.path, value, low, high, unit, p.nominal, tolerance, verdict, bound)


def _names(problem: Problem) -> list[str]:
    names = [p.path for p in problem.parameters]
    names += [f"offset of {c} in {problem.records[k].name}" for k, c in problem.offsets]
    return names + [
        f"initial {s.state} in {problem.records[s.record].name}" for s in problem.states
    ]


def _inside(p: Unknown, u: float) -> float:
    """The value at an end of an interval; the bound where that lies far out on a logarithm."""
    if not math.isfinite(u) or (p.logarithmic and abs(u) > 50.0):
        return p.low if u < 0 else p.high
    return p.value(u)


def _verdict(solution: Solution, k: int, sigma: float) -> str:
    if solution.open[k]:
        return "not identified"
    return "prior" if solution.width[k] > 0.8 * sigma else "identified"


def _bound(value: float, p: Unknown) -> str:
    near = _AT_BOUND * p.scale
    if value - p.low < near:
        return f"at its lower bound {p.low:.4g}"
    return f"at its upper bound {p.high:.4g}" if p.high - value < near else ""


def _weak(solution: Solution, names: Sequence[str]) -> list[Direction]:
    """Combinations that the records barely determine, weakest first."""
    found = []
    for k in reversed(range(len(solution.singular))):
        relative = float(solution.singular[k] / solution.singular[0])
        if relative > _WEAK:
            break
        vector = solution.directions[:, k]
        shares = {names[j]: float(vector[j]) for j in np.flatnonzero(np.abs(vector) > 0.2).tolist()}
        found.append(Direction(relative, shares))
    return found


def _with_values(machine: Any, problem: Problem, values: Mapping[str, float], status: str) -> Any:
    """A copy of the machine with these values; its history says so where it keeps one.

    status: of the search; one that is no success is told, too
    """
    copy = machine.copy()
    for path, value in values.items():
        copy.set(path, value)
    if hasattr(copy, "note"):
        names = ", ".join(record.name for record in problem.records)
        ended = "" if status == "success" else f" ({status})"
        copy.note(f"fitted to {names}{ended}: {', '.join(values)}")
    return copy

"""From the last step of a torque balance to its report."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dualdrive.identify.model import BalanceModel, CoreModel, Declared
from dualdrive.identify.regression import Solution
from dualdrive.identify.result import BalanceFit, Error, Estimate, Residual, Samples
from dualdrive.identify.trail import Offset, Trail

Array = NDArray[np.float64]

#: an interval wider than this share of the value, to either side, is no identification
VAGUE = 0.5


def summarise(
    *,
    nominal: Sequence[Trail],
    trails: Sequence[Trail],
    solution: Solution,
    declared: Sequence[Declared],
    values: Array,
    sigma: Array,
    offsets: Sequence[Offset],
    constants: Array,
    model: BalanceModel,
    processing: str,
    treatment: str,
    confidence: float,
) -> BalanceFit:
    """Turn the last step of a fit into its report."""
    from scipy.stats import t as student

    count = len(declared)
    freedom = max(solution.effective - len(solution.step), 1.0)
    reach = float(student.ppf(0.5 + confidence / 2, freedom)) * solution.width
    centre = np.concatenate([values, constants]) + solution.free_step
    per_unit = _torque_per_unit(trails, count)
    names = [p.path for p in declared] + [f"offset {r}, {e}" for r, e in offsets]
    parameters = {}
    for k, known in enumerate(declared):
        value = float(values[k])
        ends = np.clip([centre[k] - reach[k], centre[k] + reach[k]], known.low, known.high)
        low, high = min(float(ends[0]), value), max(float(ends[1]), value)
        worth = float(per_unit[k]) * (high - low)
        verdict, reason = _verdict(k, value, low, high, sigma[k], worth, solution, names)
        share = float(per_unit[k]) * abs(value)
        parameters[known.path] = Estimate(
            known.path, value, low, high, known.unit, known.value, share, verdict, reason
        )
    constant = {
        own: Estimate(
            names[count + k],
            float(constants[k]),
            float(centre[count + k] - reach[count + k]),
            float(centre[count + k] + reach[count + k]),
            _torque_unit(model, own[1]),
            0.0,
            float(abs(constants[k]) / _measured_rms(trails, own[1])),
            "identified",
            "",
        )
        for k, own in enumerate(offsets)
    }
    equations = trails[0].equations
    return BalanceFit(
        parameters,
        constant,
        {e: _error(trails, e) for e in equations},
        {e: _error(nominal, e) for e in equations},
        {e: _samples(trails, e) for e in equations},
        {
            (trail.record, e): Residual(
                trail.t, trail.residual[k], trail.measured[k], trail.keep[k]
            )
            for trail in trails
            for k, e in enumerate(trail.equations)
        },
        solution.effective,
        solution.condition,
        processing,
        treatment,
        confidence,
        model,
    )


def _verdict(
    k: int,
    value: float,
    low: float,
    high: float,
    sigma: float,
    worth: float,
    solution: Solution,
    names: Sequence[str],
) -> tuple[str, str]:
    """Is the number determined by these records, and if not, why."""
    if solution.open[k]:
        partners = [names[j] for j in np.flatnonzero(solution.open).tolist() if j != k]
        why = f"only together with {', '.join(partners)}" if partners else "nothing moves it here"
        return "not identified", f"cannot be identified from these records: {why}"
    half = max(high - value, value - low)
    if solution.width[k] > 0.8 * sigma:
        return "prior", "the records add next to nothing to the tolerance given"
    if low * high > 0 and half <= VAGUE * abs(value):
        return "identified", ""
    others = np.abs(solution.correlation[k]).copy()
    others[k] = 0.0
    partner = int(np.argmax(others))
    reason = (
        f"cannot be identified from these records: anything in {low:.3g} .. {high:.3g} fits; "
        f"the whole interval is worth {worth:.1%} of the measured torque"
    )
    if others[partner] > 0.5:
        reason += f"; correlated {solution.correlation[k, partner]:+.2f} with {names[partner]}"
    return "not identified", reason


def _torque_unit(model: BalanceModel, equation: str) -> str:
    return model.torque_unit(equation) if isinstance(model, CoreModel) else "N*m"


def _torque_per_unit(trails: Sequence[Trail], count: int) -> Array:
    """RMS torque of one unit of each parameter over RMS measured torque, all fitted samples."""
    power, total = np.zeros(count), 0.0
    for trail in trails:
        kept = np.where(trail.keep[..., None], trail.jacobian, 0.0)
        power += (kept**2).sum(axis=(0, 1))
        total += float((np.where(trail.keep, trail.measured, 0.0) ** 2).sum())
    return np.sqrt(power / total) if total else np.full(count, np.nan)


def _pooled(trails: Sequence[Trail], equation: str) -> list[tuple[Array, Array]]:
    """Residual and measured torque of every record's fitted samples."""
    found = []
    for trail in trails:
        k = trail.equations.index(equation)
        found.append((trail.residual[k][trail.keep[k]], trail.measured[k][trail.keep[k]]))
    return [(r, m) for r, m in found if len(r)]


def _measured_rms(trails: Sequence[Trail], equation: str) -> float:
    return _rms(np.concatenate([m for _, m in _pooled(trails, equation)]))


def _error(trails: Sequence[Trail], equation: str) -> Error:
    pooled = _pooled(trails, equation)
    left = _rms(np.concatenate([r for r, _ in pooled]))
    whole = _rms(np.concatenate([m for _, m in pooled]))
    moving = _rms(np.concatenate([m - m.mean() for _, m in pooled]))
    if whole == 0:
        return Error(math.nan, math.nan, left)
    return Error(left / moving if moving else math.inf, left / whole, left)


def _samples(trails: Sequence[Trail], equation: str) -> Samples:
    rows = [(trail, trail.equations.index(equation)) for trail in trails]
    return Samples(
        sum(len(trail.t) for trail, _ in rows),
        sum(int(trail.still[k].sum()) for trail, k in rows),
        sum(int(trail.keep[k].sum()) for trail, k in rows),
    )


def _rms(signal: Array) -> float:
    return float(np.sqrt(np.mean(signal**2)))

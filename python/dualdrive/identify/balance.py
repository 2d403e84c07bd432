"""Torque balance: confront a machine with a trace whose controller is unknown.

On recorded kinematics every equation of motion must close:

    inertia · acceleration + friction + effects + mesh torques − measured torque + offset = noise

Nothing is simulated, so nothing drifts, and most parameters enter linearly. Near standstill dry
friction is set-valued: those samples are masked, or only bounded, and counted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.identify.filtering import Piece, Processing, for_records, pieces
from dualdrive.identify.model import BalanceModel, as_model
from dualdrive.identify.regression import Prior, Solution, solve
from dualdrive.identify.result import BalanceFit
from dualdrive.identify.standstill import Standstill
from dualdrive.identify.summary import summarise
from dualdrive.identify.trail import Offset, Setup, Trail, follow, sensitive

Array = NDArray[np.float64]

#: relative one-sigma width of the nominal values where everything is free
WIDE = 0.3


def torque_balance(
    machine: Any,
    traces: Mapping[str, Any] | Sequence[Any] | Any,
    *,
    free: Sequence[str] | None = None,
    prior: float | Mapping[str, float] | None = None,
    offsets: bool = True,
    equations: Sequence[str] | None = None,
    processing: Processing | None = None,
    standstill: Standstill | None = None,
    confidence: float = 0.95,
    settings: Mapping[str, Mapping[str, float]] | None = None,
) -> BalanceFit:
    """Fit a machine to traces through its torque balance.

    Args:
        machine: a machine of the core, or any :class:`~dualdrive.identify.model.BalanceModel`.
        traces: one trace, several, or name -> trace; each is a record with offsets of its own. A
            trace has ``t`` and ``channels`` in SI units: at least an angle or speed of each body
            and the motor torques.
        free: parameter paths or tie groups to fit; all that the balance depends on unless given.
        prior: relative one-sigma tolerance of the nominal values, for all or by path; none unless
            given, or 0.3 where ``free`` is not given either, since then some are surely redundant.
        offsets: fit a constant torque per record and equation that has a measured torque.
        equations: which to close, see :class:`~dualdrive.identify.model.Balance`; the total where
            the machine has one, else all.
        processing: filters and decimation.
        standstill: treatment of dry friction at rest.
        confidence: of the intervals.
        settings: name of a trace -> parameter path -> SI value that held while it was recorded.

    Returns:
        Values with intervals, errors, what could not be identified, and the fitted machine.

    Raises:
        ValueError: unknown path or equation, a trace that cannot be filtered, nothing left to fit.

    """
    known = named(traces)
    if not known:
        raise ValueError("torque balance: no trace given")
    set_ = settings_of(known, settings)
    setup = Setup(
        for_records(processing, known), standstill or Standstill(), equations, settings=set_
    )
    model = as_model(machine)
    records = {n: list(pieces(t, n, setup.processing)) for n, t in known.items()}
    chosen = list(free) if free is not None else sensitive(model, records, setup)
    if both := sorted({path for own in set_.values() for path in own} & set(chosen)):
        raise ValueError(
            f"settings: {', '.join(both)} is free and set for a trace as well; leave it out of free"
        )
    tolerance = WIDE if free is None and prior is None else prior
    problem = _Problem(model, records, chosen, tolerance, setup, offsets)
    nominal = [trail.levelled() if offsets else trail for trail in problem.trails]
    solution = problem.solve()
    steps = {piece.step for parts in records.values() for piece in parts}
    return summarise(
        nominal=nominal,
        trails=problem.trails,
        solution=solution,
        declared=[model.declared(path) for path in chosen],
        values=problem.at,
        sigma=problem.sigma,
        offsets=problem.offsets,
        constants=problem.constants,
        model=problem.model,
        processing=" | ".join(sorted({setup.processing.describe(step) for step in steps})),
        treatment=setup.standstill.treatment,
        confidence=confidence,
    )


class _Problem:
    """Gauss-Newton on the balance; two steps where all parameters enter linearly."""

    def __init__(
        self,
        model: BalanceModel,
        records: Mapping[str, list[Piece]],
        free: list[str],
        tolerance: float | Mapping[str, float] | None,
        setup: Setup,
        offsets: bool,
    ) -> None:
        known = [model.declared(path) for path in free]
        self.nominal, self.model = model, model
        self.records, self.free, self.setup = records, free, setup
        self.start = np.array([p.value for p in known])
        self.low = np.array([p.low for p in known])
        self.high = np.array([p.high for p in known])
        self.sigma = _sigma(model, free, tolerance)
        self.at = self.start
        self.offsets: list[Offset] = []
        self.constants = np.zeros(0)
        self.trails = self._follow()
        if offsets:
            self.offsets = _offsets(self.trails)
            self.constants = np.zeros(len(self.offsets))

    def solve(self) -> Solution:
        """Step until nothing moves; the last step carries the covariance.

        Raises:
            ValueError: no convergence.

        """
        count = len(self.free)
        for iteration in range(30):
            moved = self._step(long_run=False)
            change = moved.step[:count]
            self.at = np.clip(self.at + change, self.low, self.high)
            self.constants = self.constants + moved.step[count:]
            values = dict(zip(self.free, self.at.tolist(), strict=True))
            self.model = self.nominal.with_values(values)
            self.trails = self._follow()
            settled = 1e-4 * moved.width[:count] + 1e-9 * np.abs(self.at)
            if iteration and np.all(np.abs(change) <= settled):
                return self._step(long_run=True)
        raise ValueError(
            "torque balance: no convergence in 30 steps; free fewer parameters or give priors"
        )

    def _follow(self) -> list[Trail]:
        constants = dict(zip(self.offsets, self.constants.tolist(), strict=True))
        return [
            follow(self.model, parts, self.free, self.setup, constants)
            for parts in self.records.values()
        ]

    def _step(self, *, long_run: bool) -> Solution:
        open_ended = np.full(len(self.offsets), np.inf)
        prior = Prior(
            np.concatenate([self.start - self.at, np.zeros(len(self.offsets))]),
            np.concatenate([self.sigma, open_ended]),
        )
        return solve(
            [trail.rows(self.offsets) for trail in self.trails],
            prior,
            np.concatenate([self.low - self.at, -open_ended]),
            np.concatenate([self.high - self.at, open_ended]),
            long_run=long_run,
        )


def _sigma(
    model: BalanceModel, free: Sequence[str], tolerance: float | Mapping[str, float] | None
) -> Array:
    """One-sigma width of each prior, infinite where there is none."""
    if isinstance(tolerance, Mapping) and (unknown := set(tolerance) - set(free)):
        raise ValueError(f"prior: {', '.join(sorted(unknown))} is not among the free parameters")
    widths = []
    for path in free:
        own = tolerance.get(path) if isinstance(tolerance, Mapping) else tolerance
        known = model.declared(path)
        size = abs(known.value) or known.typical
        widths.append(np.inf if own is None else own * size)
    return np.array(widths)


def _offsets(trails: Sequence[Trail]) -> list[Offset]:
    """One per record and equation with a measured torque."""
    return [
        (trail.record, equation)
        for trail in trails
        for equation, measured in zip(trail.equations, trail.measured, strict=True)
        if np.any(measured != 0)
    ]


def settings_of(
    traces: Mapping[str, Any], settings: Mapping[str, Mapping[str, float]] | None
) -> dict[str, dict[str, float]]:
    """Settings by name of a trace.

    Raises:
        ValueError: settings for a trace that is not there.

    """
    if stray := set(settings or {}) - set(traces):
        raise ValueError(
            f"settings: no trace {', '.join(sorted(stray))}; there are {', '.join(traces)}"
        )
    return {name: dict(own) for name, own in (settings or {}).items()}


def named(traces: Any) -> dict[str, Any]:
    """Name -> trace, names unique."""
    if isinstance(traces, Mapping):
        return dict(traces)
    several = [traces] if hasattr(traces, "t") else list(traces)
    names = [str(getattr(t, "name", "") or f"record {k}") for k, t in enumerate(several, 1)]
    if len(set(names)) < len(names):
        names = [f"{name} ({k})" for k, name in enumerate(names, 1)]
    return dict(zip(names, several, strict=True))

"""A record after model and filters: what each of its equations leaves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from dualdrive.identify.filtering import Piece, Processing
from dualdrive.identify.model import TORQUES, Balance, BalanceModel
from dualdrive.identify.regression import Rows
from dualdrive.identify.standstill import Standstill, at_rest, creeping, outside_limits

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: a constant torque: record, equation
Offset = tuple[str, str]


@dataclass(frozen=True)
class Setup:
    """Everything a torque balance is told beside the machine, the traces and what is free."""

    processing: Processing = field(default_factory=Processing)
    standstill: Standstill = field(default_factory=Standstill)
    equations: Sequence[str] | None = None
    settings: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def of(self, model: BalanceModel, record: str) -> BalanceModel:
        """The machine as it was set while a record was taken."""
        own = self.settings.get(record)
        return model.with_values(own) if own else model


@dataclass(frozen=True)
class Trail:
    """One record on the decimated grid; shapes (equations, n[, parameters]), ``t`` (n,) in s.

    ``residual`` includes the record's offsets, ``shown`` is its slope against its equation's
    offset, ``still`` marks samples at standstill, ``keep`` those that are fitted.
    """

    record: str
    equations: tuple[str, ...]
    t: Array
    residual: Array
    jacobian: Array
    measured: Array
    shown: Array
    still: Flags
    keep: Flags

    def rows(self, offsets: Sequence[Offset]) -> Rows:
        """For the regression: parameters first, then one column per offset."""
        columns = np.zeros((*self.residual.shape, len(offsets)))
        for k, (record, equation) in enumerate(offsets):
            if record == self.record:
                row = self.equations.index(equation)
                columns[row, :, k] = self.shown[row]
        whole = np.concatenate([self.jacobian, columns], axis=2)
        return Rows(self.residual, whole, self.measured, self.keep)

    def levelled(self) -> Trail:
        """With the constant torque of every measured equation at its best, all else as it stands.

        An error of a machine is told so, before a fit as after it.
        """
        residual = self.residual.copy()
        for row, measured in enumerate(self.measured):
            shown = self.shown[row][self.keep[row]]
            size = float(shown @ shown)
            if size > 0.0 and np.any(measured != 0.0):
                constant = float(shown @ residual[row][self.keep[row]]) / size
                residual[row] -= constant * self.shown[row]
        return replace(self, residual=residual)


def follow(
    model: BalanceModel,
    parts: Sequence[Piece],
    free: Sequence[str],
    setup: Setup,
    offsets: Mapping[Offset, float],
) -> Trail:
    """All pieces of one record through the model and the common filter, end to end."""
    limits = setup.standstill.limits(parts)
    model = setup.of(model, parts[0].record)
    reduced = [_reduced(model, piece, free, setup, offsets, limits) for piece in parts]
    return Trail(
        reduced[0].record,
        reduced[0].equations,
        np.concatenate([r.t for r in reduced]),
        *(
            np.concatenate([getattr(r, name) for r in reduced], axis=1)
            for name in ("residual", "jacobian", "measured", "shown", "still", "keep")
        ),
    )


def sensitive(
    model: BalanceModel, records: Mapping[str, Sequence[Piece]], setup: Setup
) -> list[str]:
    """Every parameter that moves the balance on these records, but for ratios: those are counted.

    Raises:
        ValueError: there is none.

    """
    names = [p.path for p in model.parameters() if not p.path.endswith(".ratio")]
    moved = np.zeros(len(names), dtype=bool)
    for record, parts in records.items():
        own = setup.of(model, record)
        for piece in parts:
            found = _evaluated(own, piece.samples, names, setup)
            moved |= np.any(found.jacobian != 0, axis=(0, 1))
    if not moved.any():
        raise ValueError("torque balance: no parameter of the machine moves it on these traces")
    return [name for name, m in zip(names, moved, strict=True) if m]


def _reduced(
    model: BalanceModel,
    piece: Piece,
    free: Sequence[str],
    setup: Setup,
    offsets: Mapping[Offset, float],
    limits: Mapping[str, float],
) -> Trail:
    def evaluate(samples: Mapping[str, Array]) -> Balance:
        found = _evaluated(model, samples, free, setup)
        constant = np.array([[offsets.get((piece.record, e), 0.0)] for e in found.equations])
        return replace(found, residual=found.residual + constant)

    process, step = setup.processing, piece.step
    # angles have passed the low-pass; on one side alone its gain would pose as less inertia
    torques = {n: process.low_pass(piece.samples[n], step) for n in TORQUES if n in piece.samples}
    samples = {**piece.samples, **torques}
    found = evaluate(samples)
    still = at_rest(found.equations, samples, limits)
    shown = np.ones_like(found.residual)
    if setup.standstill.treatment == "bound":
        found, shown = outside_limits(found, still, lambda sign: evaluate(creeping(samples, sign)))
    near = process.near(still, step)
    return Trail(
        piece.record,
        found.equations,
        piece.t[process.kept(len(piece), step)],
        process.reduce(found.residual, step),
        np.moveaxis(process.reduce(np.moveaxis(found.jacobian, 1, -1), step), -1, 1),
        process.reduce(found.measured, step),
        process.reduce(shown, step),
        near,
        ~near if setup.standstill.treatment == "mask" else np.ones_like(near),
    )


def _evaluated(
    model: BalanceModel, samples: Mapping[str, Array], free: Sequence[str], setup: Setup
) -> Balance:
    return model.balance(samples, free).select(setup.equations)

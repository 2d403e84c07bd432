"""A proposed mapping with what speaks for it, and what reading with it shows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Final

import numpy as np

from .log import TraceError
from .mapping import ColumnRule, TraceMap
from .names import DRIVES
from .rates import PAIRS, rate_ratio
from .reading import read
from .table import Table
from .trace import Trace

__all__ = ["ColumnGuess", "Proposal", "agreeing", "tried"]

# Change of a raw angle over the integral of a raw speed -> their likely units.
_RATES: Final = {
    1.0: ("rad", "rad/s"),
    6.0: ("deg", "rpm"),
    180 / np.pi: ("deg", "rad/s"),
    360.0: ("deg", "turn/s"),
    np.pi / 30: ("rad", "rpm"),
    1 / 60: ("turn", "rpm"),
}
_CLEAR: Final = 0.99  # correlation from which on two angles are geared
_REFERRED: Final = 0.02  # from 1, of a motor's angle that was divided by its gear ratio


@dataclass(frozen=True, slots=True)
class ColumnGuess:
    """One column of a file: the channel proposed ("" for none), unit, raw range, and why."""

    column: str
    channel: str
    unit: str
    low: float
    high: float
    reason: str


@dataclass(frozen=True)
class Proposal:
    """A mapping and what speaks for it.

    columns:  every column of the file in its order, those without a channel too
    notes:    what concerns the file as a whole: the clock, drives, contradictions
    """

    path: Path
    mapping: TraceMap
    columns: tuple[ColumnGuess, ...]
    notes: tuple[str, ...]

    @property
    def unmapped(self) -> tuple[ColumnGuess, ...]:
        """Columns that get no channel: read under their own names, used by no model."""
        return tuple(guess for guess in self.columns if not guess.channel)

    def trace(self) -> Trace:
        """The recording as read with the proposal, where nothing was recognised with all columns.

        Raises TraceError where that can't be.
        """
        if self.mapping.columns:
            return read(self.path, self.mapping)
        plain = {g.column: ColumnRule(channel=g.column) for g in self.columns if isfinite(g.low)}
        return read(self.path, replace(self.mapping, columns=plain))


def agreeing(
    path: Path, mapping: TraceMap, taken: dict[str, str], table: Table
) -> tuple[dict[str, ColumnRule], dict[str, str]]:
    """The rules with units and signs under which angles are the integrals of their speeds."""
    rules, told = dict(mapping.columns), dict[str, str]()
    try:
        trace = read(path, mapping)
    except TraceError:
        return rules, told
    for theta, omega in PAIRS:
        if theta not in trace or omega not in trace:
            continue
        pauses = np.array(trace.breaks, dtype=np.int64)
        ratio = rate_ratio(trace.t, trace[theta], trace[omega], pauses)
        angle, speed = taken[theta], taken[omega]
        if ratio is None or any(rules[c].unit or table.units.get(c) for c in (angle, speed)):
            continue
        for factor, units in _RATES.items():
            if abs(abs(ratio) / factor - 1) < 0.1:
                sign = 1 if ratio > 0 else -1
                rules[angle] = replace(rules[angle], unit=units[0], sign=sign)
                rules[speed] = replace(rules[speed], unit=units[1])
                flip = ", counted the other way" if sign < 0 else ""
                words = f"; {angle} in {units[0]} and {speed} in {units[1]}{flip}"
                told |= dict.fromkeys(
                    (angle, speed), f"{words}, so that they agree (ratio {ratio:.4g})"
                )
    return rules, told


def tried(path: Path, mapping: TraceMap) -> Iterable[str]:
    """What reading with the proposal says about itself: contradictions, wraps, resets."""
    try:
        trace = read(path, mapping)
    except TraceError as error:
        return [f"Reading with it fails: {error}"]
    said = [str(issue) for kind in ("rates", "wrapped", "reset") for issue in trace.log[kind]]
    return [*said, *_geared(trace)]


def _geared(trace: Trace) -> list[str]:
    """How far a motor turns per turn of the table: a ratio of 1 is one that was taken out."""
    told = []
    for n in DRIVES:
        if f"theta_{n}" in trace and "theta_m" in trace:
            motor, table = (trace[name] - trace[name].mean() for name in (f"theta_{n}", "theta_m"))
            both = float(np.sqrt(np.dot(motor, motor) * np.dot(table, table)))
            if both and abs(np.dot(motor, table)) > _CLEAR * both:
                ratio = float(np.dot(motor, table) / np.dot(table, table))
                told.append(
                    f"theta_{n} turns {ratio:.4g} times as far as theta_m"
                    + (": referred to the table; scale is the gear ratio, or the machine's is 1."
                       if abs(abs(ratio) - 1) < _REFERRED else ".")
                )  # fmt: skip
    return told

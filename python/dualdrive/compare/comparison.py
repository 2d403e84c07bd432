"""A machine beside measured traces: errors, noise floors, residuals, and where it fails."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from dualdrive.compare.noise import NoiseFloor
from dualdrive.compare.orders import Order, ripples
from dualdrive.compare.time_skew import Skew
from dualdrive.compare.where import Condition
from dualdrive.describe import linear_words
from dualdrive.plain import plain
from dualdrive.units import human

Array = NDArray[np.float64]

#: what a drive engineer calls an equation of motion
EQUATIONS: Final = {
    "total": "table",
    "m": "table",
    "c1": "drive 1",
    "c2": "drive 2",
    "1": "motor 1",
    "2": "motor 2",
}
_LINEAR: Final = ("m", "m/s", "N")  # units of a linear axis


@dataclass(frozen=True, eq=False)
class Quantity:
    """One quantity of one record, measured and simulated; arrays of shape (n,), SI.

    kind:      following error, current, torque, deflection (these make the headline), speed, ...;
               ``equation`` in a torque balance
    simulated: with the sensor's constant `offset` already added
    counted:   samples that count (all but those near standstill in a torque balance)
    """

    record: str
    name: str
    kind: str
    unit: str
    long_name: str
    headline: bool
    t: Array
    measured: Array
    simulated: Array
    counted: NDArray[np.bool_]
    offset: float
    noise: NoiseFloor

    @property
    def title(self) -> str:
        """As plots call it: ``following error``, ``current I_1``; linear: ``force T_1``."""
        title = f"{self.kind} {self.name}"
        if self.kind == "following error":
            title = self.kind
        elif self.kind == "equation":
            title = f"torque balance, {EQUATIONS.get(self.name, self.name)}"
        return linear_words(title) if self.unit in _LINEAR else title

    @property
    def residual(self) -> Array:
        """Simulated minus measured, shape (n,)."""
        return np.asarray(self.simulated - self.measured)

    @property
    def spread(self) -> float:
        """RMS of the measured values about their mean."""
        return float(np.std(self.measured[self.counted]))

    @property
    def rms(self) -> float:
        """RMS residual in SI."""
        return float(np.sqrt(np.mean(self.residual[self.counted] ** 2)))

    @property
    def shares(self) -> tuple[float, float]:
        """RMS residual and noise floor over the spread; infinite where nothing varied."""
        spread = self.spread
        return (self.rms / spread, self.noise.rms / spread) if spread else (math.inf, math.inf)


@dataclass(frozen=True)
class ChannelError:
    """One channel over all records, relative to the RMS of the mean-free measured signal."""

    name: str
    kind: str
    unit: str
    long_name: str
    headline: bool
    error: float
    noise_floor: float
    rms: float


@dataclass(frozen=True, eq=False)
class Comparison:
    """How a machine meets measured traces.

    mode:       closed_loop | balance
    quantities: every compared quantity of every record
    where:      error under conditions, see :class:`~dualdrive.compare.where.Condition`
    starts:     record -> rest | settled: how the machine was taken to stand before it
    initial:    (record, state) -> initial value found, SI
    notes:      what a reader should know, one line each
    orders:     lines of the residuals' spectra over angles that stand out, clearest first
    skews:      delays between channels that could be estimated; those that matter are significant
    """

    machine: str
    mode: str
    quantities: Sequence[Quantity]
    where: Sequence[Condition]
    starts: Mapping[str, str]
    initial: Mapping[tuple[str, str], float]
    notes: Sequence[str]
    orders: Sequence[Order] = ()
    skews: Sequence[Skew] = ()

    @property
    def records(self) -> tuple[str, ...]:
        """Names of the records."""
        return tuple(dict.fromkeys(q.record for q in self.quantities))

    def __getitem__(self, key: str | tuple[str, str]) -> Quantity:
        """One quantity, by name, or by record and name. KeyError says what there is."""
        record, name = key if isinstance(key, tuple) else (self.records[0], key)
        for q in self.quantities:
            if (q.record, q.name) == (record, name):
                return q
        raise KeyError(f"{record}, {name}: not compared; there are {', '.join(self.names)}")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the compared channels."""
        return tuple(dict.fromkeys(q.name for q in self.quantities))

    @property
    def channels(self) -> list[ChannelError]:
        """Each channel, all records together."""
        found = []
        for name in self.names:
            own = [q for q in self.quantities if q.name == name]
            count = np.array([q.counted.sum() for q in own], dtype=float)
            whole = float(np.sum(count * [q.spread**2 for q in own]))
            left = float(np.sum(count * [q.rms**2 for q in own]))
            noise = float(np.sum(count * [q.noise.rms**2 for q in own]))
            q = own[0]
            found.append(
                ChannelError(
                    name,
                    q.kind,
                    q.unit,
                    q.long_name,
                    q.headline,
                    math.sqrt(left / whole),
                    math.sqrt(noise / whole),
                    math.sqrt(left / count.sum()),
                )
            )
        return found

    @property
    def error(self) -> dict[str, float]:
        """``headline`` and its ``noise_floor``, then every channel by name."""
        counted = [c for c in self.channels if c.headline]
        own = {c.name: c.error for c in self.channels}
        return {
            "headline": _over_kinds(counted, "error"),
            "noise_floor": _over_kinds(counted, "noise_floor"),
            **own,
        }

    # --- for people -------------------------------------------------------------------------------

    def rows(self) -> list[tuple[str, ...]]:
        """Cells of the table: a head, one row per channel, the headline last.

        Below each equation of a torque balance every record has a row of its own.
        """
        head = ("channel", "kind", "error", "noise floor", "RMS residual", "")
        rows = []
        for c in self.channels:
            remark = "" if c.headline else "not in the headline"
            rows.append((c.name, c.kind, *_cells(c.error, c.noise_floor, c.rms, c.unit), remark))
            if c.kind == "equation" and len(self.records) > 1:
                rows += [
                    (f"  {q.record}", "", *_cells(*q.shares, q.rms, q.unit), "")
                    for q in self.quantities
                    if q.name == c.name
                ]
        error = self.error
        last = ("headline", "", _percent(error["headline"]), _percent(error["noise_floor"]), "", "")
        return [head, *rows, last]

    def table(self) -> str:
        """Errors, where they are largest, and notes, as lines of text."""
        rows = self.rows()
        widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
        lines = [f"{self.machine} against {', '.join(self.records)} ({_MODES[self.mode]})"]
        for row in rows:
            cells = (f"{cell:<{w}}" for cell, w in zip(row, widths, strict=True))
            lines.append("  ".join(cells).rstrip())
        return "\n".join([*lines, *self.remarks()])

    def remarks(self) -> list[str]:
        """Where the error is larger than elsewhere, and what a reader should know."""
        worst = sorted((c for c in self.where if _told(c)), key=lambda c: -c.excess)[:6]
        found = (f"{c.condition} ×{c.excess:.2g} ({c.time:.0%} of the time)" for c in worst)
        lines = [f"error is larger in: {'; '.join(found)}"] if worst else []
        return [*lines, *(r.sentence for r in ripples(self.orders)[:4]), *self.notes]

    def __repr__(self) -> str:
        return f"<Comparison\n{self.table()}>"

    def _repr_html_(self) -> str:
        def cells(row: Sequence[str], tag: str) -> str:
            return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in row) + "</tr>"

        head, *body = self.rows()
        title = escape(f"{self.machine} against {', '.join(self.records)}")
        rows = cells(head, "th") + "".join(cells(row, "td") for row in body)
        notes = "".join(f"<p>{escape(note)}</p>" for note in self.notes)
        return f"<table><caption>{title}</caption>{rows}</table>{notes}"

    # --- for programs -----------------------------------------------------------------------------

    def figures(self) -> dict[str, Any]:
        """The same as plain JSON values; ``None`` where a number is not finite."""
        error = self.error
        own = {
            "machine": self.machine,
            "mode": self.mode,
            "records": list(self.records),
            "error": {name: error[name] for name in ("headline", "noise_floor")},
            "channels": {
                c.name: {k: v for k, v in vars(c).items() if k != "name"} for c in self.channels
            },
            "offsets": {
                f"{q.record}/{q.name}": q.offset for q in self.quantities if q.offset != 0.0
            },
            "starts": dict(self.starts),
            "initial": {f"{record}/{state}": v for (record, state), v in self.initial.items()},
            "where": [{**vars(c), "significant": c.significant} for c in self.where],
            "orders": [
                {**vars(o), "alike": list(o.alike), "also": list(o.also)} for o in self.orders
            ],
            "skews": [dict(vars(s)) for s in self.skews],
            "notes": list(self.notes),
        }
        return dict(plain(own))

    def to_csv(self) -> str:
        """Measured and simulated channels over time as CSV text, one row per sample."""
        lines: list[str] = []
        for record in self.records:
            own = [q for q in self.quantities if q.record == record]
            if not lines:
                names = [f"{q.name} {what} [{q.unit}]" for q in own for what in _COLUMNS]
                lines.append(",".join(["record", "t [s]", *names]))
            columns = [a for q in own for a in (q.measured, q.simulated)]
            for row in np.column_stack([own[0].t, *columns]).tolist():
                lines.append(",".join([f'"{record}"', *(f"{value:.12g}" for value in row)]))
        return "\n".join(lines) + "\n"

    def to_json(self) -> str:
        """:meth:`figures` as JSON text."""
        return json.dumps(self.figures(), indent=2)


_COLUMNS = ("measured", "simulated")
_MODES = {"closed_loop": "closed loop simulated", "balance": "torque balance"}


def _told(c: Condition) -> bool:
    """Worth a reader's attention: large, and beyond chance where that is known."""
    return c.kind != "order" and c.excess > 1.2 and (c.significant or not math.isfinite(c.p))


def _cells(error: float, noise: float, rms: float, unit: str) -> tuple[str, str, str]:
    return f"{error:.2%}", _percent(noise), human(rms, unit)


def _percent(share: float) -> str:
    return f"{share:.2%}" if math.isfinite(share) else "unknown"


def _over_kinds(channels: Sequence[ChannelError], which: str) -> float:
    """Mean over kinds of the mean over a kind's channels; NaN without any."""
    kinds = dict.fromkeys(c.kind for c in channels)
    sizes = [np.mean([getattr(c, which) for c in channels if c.kind == kind]) for kind in kinds]
    return float(np.mean(sizes)) if sizes else math.nan

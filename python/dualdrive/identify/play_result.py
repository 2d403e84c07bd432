"""The play of a mesh as it is reported: numbers with intervals, for people and for programs."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.display import Displayed
from dualdrive.identify.contact import Episode
from dualdrive.plain import plain

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Interval:
    """A number with its confidence limits."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Cloud:
    """All samples: torque in N*m and deflection in rad, free of skew and zero; shapes (n,)."""

    torque: Array
    deflection: Array


@dataclass(frozen=True)
class PlayEstimate(Displayed, picture="play"):
    """The play of one mesh, in rad of its drive's pinion; ``full`` is twice the half gap Δ.

    Attributes:
        drive: 1 to 8.
        status: ``estimated``, or ``bounded`` where one flank was never loaded: then ``full.low`` is
            how far the drive was seen to move against the ring and ``full.high`` is infinite.
        full: play at zero torque.
        loaded: distance between the flanks at the working torque ``torque``, as one would measure
            with a dial gauge; more than ``full`` by what bends. None when bounded.
        skew: the drive's angle is recorded this much later than the ring's, s; not a number, and
            without limits, where a single contact or a ring at rest does not tell.
        compliance: rad per N*m, flank closed; None when bounded.
        zero: deflection at mid-play, by record; empty when bounded.
        episodes: stretches of settled contact the estimate rests on.
        cloud: every sample, for drawing the loop that play makes.
        draws: bootstrap draws of the play; empty when bounded.
        scatter: robust standard deviation of single samples, rad.
        samples: settled in contact, and all.
        note: one line of what to know.

    """

    drive: int
    status: str
    full: Interval
    loaded: Interval | None
    skew: Interval
    compliance: Interval | None
    zero: dict[str, float]
    torque: float
    episodes: list[Episode]
    cloud: Cloud
    draws: Array
    scatter: float
    samples: tuple[int, int]
    note: str

    @property
    def half_gap(self) -> Interval:
        """Δ, as machines declare it."""
        return Interval(*(0.5 * x for x in (self.full.value, self.full.low, self.full.high)))

    def table(self) -> str:
        """A few lines for people, angles in degrees."""
        settled, total = self.samples
        lines = [f"mesh {self.drive}: {self.note}"]
        if self.status == "bounded":
            lines.append(f"full play       at least {np.degrees(self.full.low):.3g} deg")
        else:
            assert self.loaded is not None
            assert self.compliance is not None
            lines += [
                f"full play       {_degrees(self.full)} deg, at zero torque",
                f"between flanks  {_degrees(self.loaded)} deg, at ±{self.torque:.3g} N*m",
                f"compliance      {_degrees(self.compliance)} deg per N*m",
            ]
        lines += [
            f"time skew       {self._late()}",
            f"{len(self.episodes)} episodes of contact, {settled} of {total} samples, scatter "
            f"{np.degrees(self.scatter):.3g} deg",
        ]
        return "\n".join(lines)

    def _late(self) -> str:
        """Which angle is late, and by how much."""
        late, ends = "the drive's", (self.skew.value, self.skew.low, self.skew.high)
        if not np.isfinite(ends).all():
            return "can't be told: it takes several contacts while the ring turns"
        if self.skew.value < 0.0:
            late, ends = "the ring's", (-self.skew.value, -self.skew.high, -self.skew.low)
        return f"{_plain(Interval(*(1e3 * x for x in ends)))} ms, {late} angle is late"

    def figures(self) -> dict[str, Any]:
        """Plain JSON values, rad and s; ``None`` for no upper limit."""
        intervals = {
            name: None if value is None else asdict(value)
            for name, value in (
                ("full", self.full),
                ("half_gap", self.half_gap),
                ("loaded", self.loaded),
                ("skew", self.skew),
                ("compliance", self.compliance),
            )
        }
        own = {
            "drive": self.drive,
            "status": self.status,
            **intervals,
            "zero": self.zero,
            "torque": self.torque,
            "episodes": len(self.episodes),
            "samples": {"settled": self.samples[0], "total": self.samples[1]},
            "scatter": self.scatter,
            "note": self.note,
        }
        return dict(plain(own))

    def to_json(self) -> str:
        """:meth:`figures` as JSON text."""
        return json.dumps(self.figures(), indent=2)


def _plain(interval: Interval) -> str:
    return f"{interval.value:.4g} [{interval.low:.4g} .. {interval.high:.4g}]"


def _degrees(interval: Interval) -> str:
    return _plain(Interval(*np.degrees([interval.value, interval.low, interval.high]).tolist()))

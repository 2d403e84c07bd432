"""Errors of simulated loops, and what the sensors' noise alone would leave."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dualdrive.innovations import GreyBox, Noise, Simulated, Variant, predictable, simulated
from dualdrive.replay import Compared, Record, headline

if TYPE_CHECKING:
    from dualdrive.diagnose.selection.fitted import Fitted


def simulated_error(core: Any, played: Sequence[Record]) -> float:
    """Headline error of a machine simulated over records, its numbers held.

    Constants of the sensors and the first angles are fitted. Not a number where the machine does
    not run there.
    """
    return of_the_data_sheet(GreyBox(core, predictable(core, played), [])).error()


@dataclass(frozen=True, eq=False)
class Simulation:
    """A machine simulated over the records.

    found: None where it does not run
    """

    grey: GreyBox
    found: Simulated | None

    @classmethod
    def of(cls, grey: GreyBox, f: Fitted) -> Simulation:
        """Of a hypothesis as fitted."""
        return cls(grey, simulated(grey, f.variant, f.point.theta))

    def unfollowed(self, noise: Noise) -> set[str]:
        """Names of the records that no simulation follows; see `Simulated.followed`."""
        if self.found is None:
            return set()
        every = zip(self.grey.records, self.found.followed(noise), strict=True)
        return {r.name for r, followed in every if not followed}

    def creeping(self, noise: Noise) -> Simulation:
        """The same where what dry friction holds follows its creep; see `Simulated.creeping`."""
        if self.found is None or not noise.creep:
            return self
        return Simulation(self.grey, self.found.creeping(noise))

    def error(self, without: Collection[str] = ()) -> float:
        """Headline error, over all records but these; NaN where it does not run, or none is left.

        without: names of records
        """
        if self.found is None:
            return float("nan")
        left = _Sums()
        for r, missed in zip(self.grey.records, self.found.missed, strict=True):
            if r.name in without:
                continue
            own = dict(zip(r.channels, missed.T, strict=True))
            for c in r.record.channels:
                total = sum(factor * own[name] for name, factor in c.parts if name in own)
                residual = np.broadcast_to(total, len(r.record.t))
                residual = residual - np.mean(residual) if c.floating else residual
                left.add(c, len(r.record.t), float(residual @ residual))
        return left.headline()


def of_the_data_sheet(grey: GreyBox) -> Simulation:
    """The machine as given, its numbers where they are nominal."""
    nothing = Variant(grey.core)
    return Simulation(grey, simulated(grey, nothing, grey.of_the_data_sheet(nothing)))


def noise_floor(grey: GreyBox, f: Fitted, without: Collection[str] = ()) -> float:
    """Headline error that the sensors' noise alone would leave, as the likelihood has it.

    without: names of records that do not count
    """
    left = _Sums()
    for r in grey.records:
        if r.name in without:
            continue
        variance = f.noise.variance(r)
        for c in r.record.channels:
            own = sum(factor**2 * variance.get(name, 0.0) for name, factor in c.parts)
            left.add(c, len(r.record.t), own * len(r.record.t))
    return left.headline()


class _Sums:
    """Squares of what is left, channel by channel, beside those of the signals."""

    def __init__(self) -> None:
        self.left, self.whole = dict[str, float](), dict[str, float]()
        self.channels: list[Compared] = []

    def add(self, c: Compared, rows: int, squares: float) -> None:
        self.channels.append(c)
        self.left[c.name] = self.left.get(c.name, 0.0) + squares
        self.whole[c.name] = self.whole.get(c.name, 0.0) + c.spread**2 * rows

    def headline(self) -> float:
        relative = {n: float(np.sqrt(self.left[n] / self.whole[n])) for n in self.left}
        return headline(relative, self.channels)

"""Whether the oscillations of figure 4 last: by their Floquet multipliers, and by a nudge.

Two equal drives stay in step for ever in a simulation, whether or not the least difference would
part them. A motion that repeats is stable where all its multipliers are below 1 in size.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from dualdrive.cycles import CycleError, shooting
from dualdrive.motion import step
from dualdrive.paper.exhibit import Table
from dualdrive.paper.response import Oscillation, oscillation
from dualdrive.paper.settings import ARCSEC, GAP_HALF, STEP, simulated, untuned

__all__ = ["Lasting", "lasting", "note", "table"]

#: rad/s at the pinions, one forward and one back, when the step comes
NUDGE: Final = 1e-3
#: s; what is left is read off the last ten
END, LAST = 120.0, 10.0


@dataclass(frozen=True)
class Lasting:
    """A limit cycle's stability.

    simulated:  what a run with equal drives settles on
    nudged:     what is left after END when the drives start apart
    multiplier: the largest Floquet multiplier of the orbit found by shooting; None if none closes
    frequency:  of that orbit, Hz
    """

    simulated: Oscillation
    nudged: Oscillation
    multiplier: float | None
    frequency: float | None

    @property
    def stable(self) -> bool:
        """Whether the nudge changes nothing in the end."""
        return abs(self.nudged.amplitude / self.simulated.amplitude - 1.0) < 1e-3


def lasting(gain: float, seen: Oscillation) -> Lasting:
    """Nudge the limit cycle of this gain, and look for it as a periodic orbit.

    seen: what a run with equal drives settles on
    """
    machine = untuned(gain, GAP_HALF)
    apart = {"omega_c1": NUDGE, "omega_c2": -NUDGE}
    run = simulated(machine, step(STEP), end=END, initial=apart, signals=["theta_m"])
    nudged = oscillation(run.t, run["theta_m"], LAST, 0.01 * ARCSEC)
    try:
        orbit = shooting(machine)
    except CycleError:
        return Lasting(seen, nudged, None, None)
    multiplier = float(np.abs(orbit.multipliers).max())
    return Lasting(seen, nudged, multiplier, orbit.frequency_hz)


def table(found: dict[float, Lasting]) -> Table:
    """Frequency and amplitude against gain: simulated, shot, nudged."""
    rows = tuple(
        (
            gain,
            one.simulated.frequency,
            one.simulated.amplitude / ARCSEC,
            one.frequency,
            one.multiplier,
            one.nudged.frequency,
            one.nudged.amplitude / ARCSEC,
        )
        for gain, one in found.items()
    )
    columns = (
        "K [1/s]",
        "frequency [Hz]",
        "amplitude [″]",
        "by shooting [Hz]",
        "largest multiplier",
        "drives started apart: [Hz]",
        "[″]",
    )
    return Table("Limit cycle against gain, Δ 1.1 mrad", columns, rows)


def note(found: dict[float, Lasting]) -> str:
    """What the table says of stability."""
    unstable = [f"{gain:g}" for gain, one in found.items() if not one.stable]
    if not unstable:
        return "Drives that start apart come to the same limit cycle at every gain."
    return (
        f"At K = {' and '.join(unstable)} the oscillation is one of two exactly equal drives: "
        "started apart by 1 mrad/s, they do not come back to it but go on in another, slower one. "
        "The orbits that shooting finds say the same: their largest multiplier is above 1 there."
    )

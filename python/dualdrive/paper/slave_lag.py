"""The paper's slave lag: the second drive gets the speed command that much later."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from dualdrive.motion import move
from dualdrive.paper.exhibit import Claim, Table, verdict
from dualdrive.paper.flanks import flanks_since
from dualdrive.paper.settings import ARCSEC, heavy_table, simulated
from dualdrive.run import Run

__all__ = ["CHOSEN", "LAGS", "SPEED_GAINS", "SlaveLag", "claim", "lagging", "table"]

LAGS: Final = (0.0, 0.01, 0.05, 0.2)
#: N m s/rad at the pinion; the heavy table's own last
SPEED_GAINS: Final = (1e5, 2e5)
CHOSEN: Final = (
    "slave lag δt: 100 t, 200 N·m, 0.02 rad, 0.03 rad/s, 0.01 rad/s², 0.05 rad/s³; speed gain "
    "k_p 2e5 N·m·s/rad as preset, and half of it; last row 550 t with 100 N·m"
)


@dataclass(frozen=True)
class SlaveLag:
    """Runs through the same move.

    light: (speed gain, lag in s) -> 100 t with motors of 200 N m
    heavy: (speed gain, lag in s) -> 550 t with motors of 100 N m
    """

    light: Mapping[tuple[float, float], Run]
    heavy: Mapping[tuple[float, float], Run]


def lagging() -> SlaveLag:
    """Run every lag."""
    weak, soft = {"motors.T_max": 100.0}, (SPEED_GAINS[0], LAGS[-1])
    return SlaveLag(
        light={(gain, lag): _run("100t", gain, lag, {}) for gain in SPEED_GAINS for lag in LAGS},
        heavy={soft: _run("550t", *soft, weak)},
    )


def _run(load: str, gain: float, lag: float, numbers: Mapping[str, float]) -> Run:
    own = {"controller.k_p": gain, "controller.delta_t": lag}
    motion = move(0.02, 0.03, 0.01, 0.05, start=2.0, end=14.0)
    return simulated(heavy_table(load, {**numbers, **own}), motion, signals=["e"])


def claim(data: SlaveLag) -> Claim:
    """What the paper has the lag do."""
    peaks = {key: _peak(run) for key, run in data.light.items()}
    gain = SPEED_GAINS[-1]
    worse = [peaks[k, lag] > peaks[k, 0.0] for k in SPEED_GAINS for lag in LAGS[1:]]
    return Claim(
        "the slave follows after δt, which improves synchronism and stability",
        f"following error {peaks[gain, 0.0]:.1f}″ without lag, {peaks[gain, 0.2]:.1f}″ at 200 ms; "
        f"a lag makes it worse in {sum(worse)} of {len(worse)} runs",
        verdict(*(not one for one in worse)),
    )


def table(data: SlaveLag) -> Table:
    """Every run: its error, its flank changes, whether it comes to rest."""
    rows = []
    for name, runs in (("100 t, 200 N·m", data.light), ("550 t, 100 N·m", data.heavy)):
        for (gain, lag), run in runs.items():
            without = runs.get((gain, 0.0))
            over = 100 * (_peak(run) / _peak(without) - 1) if without and lag else None
            changes = len(flanks_since(run, 2.0)) - 1
            rest = float(np.ptp(run["e"][run.t >= 12.0])) / ARCSEC
            row = (1e3 * lag, _peak(run), over, float(changes), round(rest, 2))
            rows.append((name, f"{gain / 1e5:g}e5", *row))
    columns = (
        "machine",
        "k_p [N·m·s/rad]",
        "δt [ms]",
        "peak following error [″]",
        "more than without [%]",
        "flank changes in the move",
        "left at rest, 12 to 14 s [″]",
    )
    return Table("Slave lag", columns, tuple(rows))


def _peak(run: Run) -> float:
    """Largest following error, arcsec."""
    return float(np.abs(run["e"]).max()) / ARCSEC

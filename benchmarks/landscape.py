"""How many valleys a fit meets: simulated error and innovations, on a record that hunts.

    python benchmarks/landscape.py                print the table
    python benchmarks/landscape.py --write        and draw docs/theory/landscape.png

The heavy table of 550 t without tension hunts through its play. Of its inertia, friction and play
one at a time is moved about the truth, all else is true. What a simulated record leaves of a motion
that repeats itself depends on where in its period it is; what the samples before do not predict
hardly does.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks, lfilter

import dualdrive as dd
from dualdrive.diagnose.closed_loop import nominal_unknowns
from dualdrive.innovations import GreyBox, Noise, Variant, first_noise, predictable
from dualdrive.replay import core_of, records
from dualdrive.traces import Trace
from report import table
from surroundings import ROOT

Array = NDArray[np.float64]

STEP, SPAN = 2e-3, 20.0  # s
#: channel -> what drives its noise, SI, and how much of itself that remembers each sample
SENSORS = {
    "theta_m": (1e-6, 0.9),
    "theta_1": (1e-5, 0.5),
    "theta_2": (1e-5, 0.5),
    "I_1": (5e-3, 0.9),
    "I_2": (5e-3, 0.9),
}
KINDS = {"theta_m": "table angle", "theta_1": "drive angle", "I_1": "drive current"}
#: of the drives' torque, what of unknown course is allowed for; None: the record is simulated
LEVELS: dict[str, float | None] = {
    "simulated": None,
    "unknown torque 1e-5": 1e-5,
    "1e-3": 1e-3,
    "0.1": 0.1,
}
#: what is moved -> how far, as a factor
MOVED = {"table.J": 0.2, "coulomb@table.torque": 0.5, "meshes.gap": 0.2}
POINTS = 161
DEEP = 4.0  # of -2 log L: two sigma, from which a valley counts


@dataclass(frozen=True)
class Profile:
    """-2 log L over its least, along a factor of one number; NaN where a replay was lost."""

    number: str
    level: str
    factor: Array
    height: Array

    @property
    def valleys(self) -> int:
        """Local minima that are deeper than two sigma."""
        known = np.nan_to_num(self.height, nan=np.nanmax(self.height))
        walled = np.r_[np.inf, known, np.inf]
        top = np.minimum(walled, 2.0 * float(np.nanmax(known)) + 2.0 * DEEP)
        return len(find_peaks(-top, prominence=DEEP)[0])

    @property
    def lowest(self) -> float:
        """The factor at the least height."""
        return float(self.factor[int(np.nanargmin(self.height))])

    @property
    def wide(self) -> float:
        """How far from the least, as a share of the number, the height is below half its most."""
        below = self.height < 0.5 * float(np.nanmax(self.height))
        k = int(np.nanargmin(self.height))
        low, high = (
            np.argmin(row) if not row.all() else len(row) for row in (below[k::-1], below[k:])
        )
        return 0.5 * float(low + high - 1) * float(self.factor[1] - self.factor[0])


def coloured(
    random: np.random.Generator, samples: int, drive: float, memory: float, first: float = 1.0
) -> Array:
    """A sensor's noise, shape (samples,): an autoregression of order one.

    first: of the standard deviation that it has once it is stationary, that of the first sample
    """
    w = drive * random.standard_normal(samples)
    w[0] *= first / np.sqrt(1.0 - memory**2)
    noise: Array = lfilter([1.0], [1.0, -memory], w)
    return noise


def hunting() -> dd.Machine:
    """A heavy table without tension."""
    machine = dd.Machine.load("heavy-table-550t")
    machine.set("controller.T_ten", 0.0)
    return machine


def measured(machine: dd.Machine, seed: int = 1) -> Trace:
    """A move, and what follows it, as its sensors say."""
    random, t = np.random.default_rng(seed), STEP * np.arange(round(SPAN / STEP), dtype=np.float64)
    motion = dd.motion.move(1e-3, 1e-3, 1e-2, 1.0)
    run = dd.simulate(machine, motion, times=t, signals=["theta_ref", *SENSORS], energy=False)
    columns = {"theta_ref": np.array(run["theta_ref"])}
    for channel, sensor in SENSORS.items():
        columns[channel] = np.array(run[channel]) + coloured(random, len(t), *sensor)
    return Trace(t, columns, name="hunting")


def profiles(machine: dd.Machine, trace: Trace) -> list[Profile]:
    """Every number at every level."""
    core = core_of(machine)
    played = predictable(core, records(machine, {"hunting": trace}, start="rest"))
    found = []
    wide = first_noise(core, played, 1.0)
    drive = {KINDS[c]: SENSORS[c][0] for c in KINDS}
    memory = {KINDS[c]: SENSORS[c][1] for c in KINDS}
    for number, far in MOVED.items():
        factors = 1.0 + far * np.linspace(-1.0, 1.0, POINTS)
        for level, share in LEVELS.items():
            torque = {b: share * s for b, s in wide.torque.items()} if share else {}
            noise = Noise(drive, memory, torque, wide.course)
            heights = []
            for factor in factors:
                moved = core.copy()
                moved.set(number, factor * core.get(number))
                grey = GreyBox(moved, played, nominal_unknowns(moved, None))
                nothing = Variant(moved)
                [at] = grey.likelihoods(nothing, [(grey.start(nothing), noise)])
                heights.append(at[0].minus_two_log if at else np.nan)
            height = np.array(heights)
            found.append(Profile(number, level, factors, height - np.nanmin(height)))
    return found


def draw(found: Sequence[Profile]) -> None:
    """A panel for every number, a line for every level."""
    from matplotlib.figure import Figure

    from dualdrive.plots.style import drive_colour

    figure = Figure(figsize=(11.0, 4.2), layout="constrained")
    panels = figure.subplots(1, len(MOVED), sharey=True)
    for axes, number in zip(panels, MOVED, strict=True):
        for k, p in enumerate(p for p in found if p.number == number):
            axes.semilogy(
                p.factor, 1.0 + p.height, color=drive_colour(k + 1), lw=1.3, label=p.level
            )
        axes.axvline(1.0, color="0.6", lw=0.8, ls=":")
        axes.set_xlabel(f"{number} over the true one")
    panels[0].set_ylabel("1 + (-2 log L less its least)")
    panels[-1].legend(title="of the drives' torque", fontsize="small")
    figure.savefig(ROOT / "docs/theory/landscape.png", dpi=110)


def main() -> None:
    """Print the table; draw it, if asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--write", action="store_true", help="draw docs/theory/landscape.png, too")
    asked = parser.parse_args()
    machine = hunting()
    trace = measured(machine)
    rest = trace["theta_m"][trace.t > SPAN / 2]
    print(f"the table swings by {np.ptp(rest):.3g} rad in the last {SPAN / 2:g} s of {SPAN:g}")
    found = profiles(machine, trace)
    rows = [
        [p.number, p.level, str(p.valleys), f"{p.lowest:.4f}", f"± {100.0 * p.wide:.2g} %"]
        for p in found
    ]
    print(table(["number", "of the drives' torque", "valleys", "least at", "half up at"], rows))
    if asked.write:
        draw(found)


if __name__ == "__main__":
    main()

"""Heat against accuracy: designs on a grid, each at its worst corner, and the best trades of them.

A design is dominated where another one is at least as good in both and better in one. What is left
is the front of Pareto. With one to three numbers to choose and runs of some milliseconds a grid is
exact to its step, shows what lies beside the front, and needs no luck.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualdrive.display import Displayed
from dualdrive.machine import Machine
from dualdrive.motion import Motion
from dualdrive.optimise.duty import duty_cycle
from dualdrive.optimise.errors import OptimiseError, refuse_all_but_two_drives
from dualdrive.optimise.objective import TENSION, Design, Progress, evaluate
from dualdrive.optimise.tension import LeastTension, least_tension, refuse_unstable
from dualdrive.optimise.worst_case import Corner, corners
from dualdrive.units import human

__all__ = ["ACCURACY", "Front", "non_dominated", "optimise"]

#: what may stand for accuracy -> in words
ACCURACY = {
    "peak_error": "largest following error",
    "rms_error": "RMS following error",
    "hunting": "following error at rest, peak to peak",
}
_TENSIONS = 21
_WORTH = 1e-3  # of the error: what gains less is no trade for more heat
_ROUNDING = 1e-9  # of the largest figure in the same unit: what is less is none
_GAINS = (0.5, 0.75, 1.0, 1.25, 1.5)


@dataclass(frozen=True, eq=False)
class Front(Displayed, picture="pareto"):
    """What was tried, and the best trades in it.

    designs:   all, in the order of the grid
    best:      the front, by rising heat: places in `designs`
    accuracy:  name of the figure that stands for it, of `ACCURACY`
    cost:      torque_rms or heat: heat where the machine has windings
    least:     the least tension that keeps every flank closed, with the machine's own gain
    """

    machine: Machine
    motion: Motion
    cases: tuple[Corner, ...]
    designs: tuple[Design, ...]
    best: tuple[int, ...]
    accuracy: str
    cost: str
    least: LeastTension

    @property
    def unstable(self) -> int:
        """How many designs have no figures, since their loop is unstable."""
        return sum(not design.stable for design in self.designs)

    def units(self) -> dict[str, str]:
        """SI unit of every figure of a design."""
        angle = self.machine.unit_of("e", "rad")
        return {
            "growth": "1/s",
            "margin": "N*m",
            **dict.fromkeys(("peak_error", "rms_error", "hunting"), angle),
            "torque_rms": "N*m",
            "torque_peak": "N*m",
            "heat": "W",
        }

    def rows(self) -> list[tuple[str, ...]]:
        """The front as text: a head, then one row per design."""
        paths = list(self.designs[0].values)
        names = [self.cost, "torque_rms", self.accuracy, "hunting", "margin"]
        columns = {name: self._column(name) for name in names}
        rows = [(*paths, *columns, "flanks")]
        for place, *numbers in zip(self.best, *columns.values(), strict=True):
            design = self.designs[place]
            chosen = [
                human(value, self.machine.parameter(path).unit)
                for path, value in design.values.items()
            ]
            rows.append((*chosen, *numbers, "closed" if design.apart else "open"))
        return rows

    def _column(self, name: str) -> list[str]:
        """A figure of every design of the front, all in one unit; what rounding leaves is 0."""
        unit = self.units()[name]
        alike = [other for other, own in self.units().items() if own == unit]
        best = [self.designs[place] for place in self.best]
        most = max(abs(getattr(design, other) or 0.0) for design in best for other in alike)
        values = [float(getattr(design, name)) for design in best]
        sizes = [0.0 if abs(value) < _ROUNDING * most else value for value in values]
        like = max(map(abs, sizes)) or most
        return [human(size, unit, like=like) for size in sizes]

    def remarks(self) -> list[str]:
        """Lines to print below the table."""
        found = [
            f"the best {len(self.best)} of {len(self.designs)} designs: no other has both less "
            f"{self.cost.replace('_', ' ')} and less {self.accuracy.replace('_', ' ')}",
            f"each at {len(self.cases)} corners: " + "; ".join(case.name for case in self.cases),
        ]
        if self.unstable:
            found.append(f"{self.unstable} designs are unstable at a corner and have no figures")
        failed = [design for design in self.designs if design.note]
        if failed:
            found.append(f"{len(failed)} designs have no figures; the first: {failed[0].note}")
        if self.least.tension is None:
            found.append(f"least tension: none, {self.least.reason}")
        else:
            size = human(self.least.tension, "N*m")
            found.append(
                f"least tension that keeps every flank closed: {size}; {self.least.reason}"
            )
        return found

    def table(self) -> str:
        """The front as aligned text, and what is to be said of it."""
        rows = self.rows()
        widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
        lines = ["  ".join(word.rjust(w) for word, w in zip(r, widths, strict=True)) for r in rows]
        return "\n".join([*lines, *self.remarks()])

    def figures(self) -> dict[str, Any]:
        """Plain numbers for JSON, SI; None where a design is unstable."""
        return {
            "machine": self.machine.name,
            "motion": self.motion.text,
            "corners": [{"name": case.name, "values": dict(case.values)} for case in self.cases],
            "accuracy": self.accuracy,
            "cost": self.cost,
            "units": self.units(),
            "least_tension": {
                "value": self.least.tension,
                "unit": "N*m",
                "reason": self.least.reason,
            },
            "front": list(self.best),
            "designs": [{**asdict(d), "apart": d.apart} for d in self.designs],
        }


def optimise(
    machine: Machine,
    motion: Motion | None = None,
    *,
    over: Mapping[str, ArrayLike] | None = None,
    cases: Sequence[Corner] | None = None,
    accuracy: str = "peak_error",
    progress: Progress | None = None,
) -> Front:
    """Try designs on a grid at all corners and keep the trades of heat against accuracy.

    over:      path -> SI values; default: controller.T_ten from 0 to the rated torque and
               controller.K_v from half to one and a half of the machine's
    cases:     default: `corners` of the machine
    accuracy:  one of `ACCURACY`

    A design counts with its worst corner. Raises OptimiseError for a machine without two drives,
    an unknown accuracy, and where no design is stable.
    """
    refuse_all_but_two_drives(machine)
    if accuracy not in ACCURACY:
        raise OptimiseError(f"accuracy = {accuracy!r}: must be one of {', '.join(ACCURACY)}")
    motion = duty_cycle(machine) if motion is None else motion
    cases = list(corners(machine) if cases is None else cases)
    grid = {
        path: np.atleast_1d(np.asarray(v, float)) for path, v in (over or usual(machine)).items()
    }
    for path in grid:
        machine.parameter(path)
    designs = evaluate(
        machine,
        motion,
        [dict(zip(grid, map(float, chosen), strict=True)) for chosen in product(*grid.values())],
        cases,
        progress,
    )
    refuse_unstable(machine, designs)
    cost = "heat" if all(d.heat is not None for d in designs if d.known) else "torque_rms"
    trades = np.array([_trade(design, cost, accuracy) for design in designs])
    best = sorted(
        np.flatnonzero(non_dominated(trades, _WORTH)).tolist(), key=lambda k: trades[k, 0]
    )
    least = least_tension(machine, motion, cases=cases)
    return Front(machine, motion, tuple(cases), tuple(designs), tuple(best), accuracy, cost, least)


def usual(machine: Machine) -> dict[str, NDArray[np.float64]]:
    """The grid where nothing is said: tension up to the rated torque, gain around its own."""
    rated = machine.get("motor_1.T_rated")
    if not math.isfinite(rated):
        raise OptimiseError(
            f"{machine.name}: motor_1.T_rated = {rated}: tension has no upper end; give `over`"
        )
    found = {TENSION: np.linspace(0.0, rated, _TENSIONS)}
    gain = machine.get("controller.K_v")
    return found | ({"controller.K_v": gain * np.array(_GAINS)} if gain else {})


def non_dominated(points: ArrayLike, least: float = 0.0) -> NDArray[np.bool_]:
    """Which points no other one beats: smaller is better. points: shape (n, 2); result (n,).

    Walking along rising first coordinates, a point is on the front where its second one is below
    all before (Kung, Luccio & Preparata 1975), by the fraction `least` of it. Points with an
    infinite coordinate are not on it.
    """
    values = np.asarray(points, float).reshape(-1, 2)
    kept = np.zeros(len(values), bool)
    lowest = math.inf
    for k in np.lexsort((values[:, 1], values[:, 0])):
        if np.isfinite(values[k]).all() and values[k, 1] < lowest * (1.0 - least):
            kept[k], lowest = True, values[k, 1]
    return kept


def _trade(design: Design, cost: str, accuracy: str) -> tuple[float, float]:
    """What is traded; infinite where there are no figures, an unstable loop say."""
    if not design.known:
        return math.inf, math.inf
    return float(getattr(design, cost)), float(getattr(design, accuracy))

"""Drive train x position sensor x gap x gear grade x reading x load, over one error budget.

The experiment of docs/adr/0010-tables-by-an-experiment-that-can-fail.md, whose ranges were fixed
before it ran. Each target is approached from both sides by itself, with the pitch errors that the
two meshes have there: an error that is constant while the table stops is a twist that a mesh
starts with (`approach`). What geometry then adds to the table at rest is put on top:

    table's encoder    - a cos(theta + phi)     the loop follows its grating's error
    motor's encoder    + offset_1 / i_m         the ring follows the pitch error of mesh 1

both read off the core's own laws. `check` drives whole machines round the circle, for comparison.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.display import Tabled
from dualdrive.indexing.approach import (
    DELAYS,
    DWELL,
    FROM,
    LIMITS,
    REPEATS,
    START,
    looks,
    read,
    readings,
)
from dualdrive.indexing.cycle import STILL
from dualdrive.indexing.error_budget import Draw, draw, geometry, mechanics
from dualdrive.indexing.iso230 import evaluate
from dualdrive.indexing.printed import ARCSEC, LOADS, loaded
from dualdrive.machine import Machine
from dualdrive.simulation import simulate

__all__ = [
    "DELAYS",
    "DRAWS",
    "GAPS",
    "GRADES",
    "PAIR",
    "SENSORS",
    "Cell",
    "Crossed",
    "check",
    "crossed",
]

Floats = NDArray[np.float64]


#: columns of the tables -> drive train
PAIR: Final[Mapping[str, str]] = {
    "traditional": "heavy-table-double-pinion",
    "double motors": "heavy-table-dual-servo",
}
SENSORS: Final = ("table", "motor")
GAPS: Final = (0.5, 1.0, 2.0)
GRADES: Final = (5.0, 8.0)
DRAWS: Final = 10

_COUNT: Final = 8  # targets round the circle


@dataclass(frozen=True)
class Cell:
    """One combination of levels; reading is the delay in s."""

    load: str
    sensor: str
    gap: float
    grade: float
    reading: float


@dataclass(frozen=True, eq=False)
class Crossed(Tabled):
    """What the experiment gave.

    figures:   (cell, column) -> A, R, B in arcsec, shape (draws, 3); NaN where it had no reading
    moved:     (cell, column) -> draws in which a target was read while the table moved by
               more than 1 arcsec
    """

    figures: Mapping[tuple[Cell, str], Floats]
    draws: int
    moved: Mapping[tuple[Cell, str], int]

    def values(self, cell: Cell, column: str, figure: str) -> Floats:
        """One figure over the draws, arcsec, shape (draws,)."""
        return self.figures[cell, column][:, "ARB".index(figure)]

    def unread(self, cell: Cell, column: str) -> int:
        """Draws in which a target was not in position in time."""
        return int(np.isnan(self.figures[cell, column]).any(axis=1).sum())

    def gains(self, cell: Cell, figure: str) -> Floats:
        """By how much two motors are better, as a share, draw by draw; shape (draws,)."""
        old, new = (self.values(cell, column, figure) for column in PAIR)
        return 1.0 - new / old

    def cells(self) -> list[Cell]:
        """All cells, in the order of the factors."""
        return list(dict.fromkeys(cell for cell, _ in self.figures))

    def _cells(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        """Means of the draws that had a reading."""
        factors = [f.name for f in fields(Cell)]
        rows = []
        for (cell, column), drawn in self.figures.items():
            read = drawn[np.isfinite(drawn).all(axis=1)]
            means = [f"{x:.3g}" for x in read.mean(axis=0)] if len(read) else ["–"] * 3
            rows.append((column, *(str(getattr(cell, f)) for f in factors), *means))
        return ("column", *factors, "A [arcsec]", "R [arcsec]", "B [arcsec]"), rows


def crossed(
    draws: int = DRAWS,
    *,
    first: int = 0,
    loads: Sequence[str] = tuple(LOADS),
    sensors: Sequence[str] = SENSORS,
    gaps: Sequence[float] = GAPS,
    grades: Sequence[float] = GRADES,
    jobs: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Crossed:
    """Run the experiment.

    draws:     of the error budget, from number `first` on
    loads, sensors, gaps, grades: levels of the factors
    jobs:      threads; the result is the same with any number of them
    progress:  called with runs done and runs in all

    Raises IndexingError for unknown levels.
    """
    plan = list(product(range(first, first + draws), loads, sensors, gaps, PAIR))
    grades = tuple(grades)
    found: dict[tuple[Cell, str], list[Floats]] = {}
    moved: Counter[tuple[Cell, str]] = Counter()

    def work(one: tuple[int, str, str, float, str]) -> tuple[str, dict[Cell, tuple[Floats, bool]]]:
        number, load, sensor, gap, column = one
        return column, _one(number, load, sensor, gap, column, grades)

    with ThreadPoolExecutor(jobs) as pool:
        for done, (column, rows) in enumerate(pool.map(work, plan), 1):
            for cell, (row, while_moving) in rows.items():
                found.setdefault((cell, column), []).append(row)
                moved[cell, column] += while_moving
            if progress is not None:
                progress(done, len(plan))
    figures = {key: np.array(rows) for key, rows in found.items()}
    return Crossed(figures, draws, moved)


def _one(
    number: int, load: str, sensor: str, gap: float, column: str, grades: Sequence[float]
) -> dict[Cell, tuple[Floats, bool]]:
    """Figures of one table, read at all delays, with each grade; and whether it moved meanwhile."""
    drawn = draw(number)
    machine = _machine(drawn, load, sensor, gap, column)
    targets = _targets(drawn)
    placed = [_geometry(machine, drawn, grade, targets) for grade in grades]
    seen = readings(machine, drawn, [twists for pitch, _ in placed for twists in pitch])
    rows = {}
    for k, grade in enumerate(grades):
        _, static = placed[k]
        for delay, stood in seen.items():
            own = slice(k * _COUNT, (k + 1) * _COUNT)
            figures = _figures(targets, stood.off[own] + static[:, None, None], drawn)
            rows[Cell(load, sensor, gap, grade, delay)] = (
                figures, bool((stood.moved[own] > STILL["rad"]).any())
            )  # fmt: skip
    return rows


def _machine(drawn: Draw, load: str, sensor: str, gap: float, column: str) -> Machine:
    machine = loaded(PAIR[column], load)
    core = machine.core
    core.set_controller(**{**core.controller_options, "position_sensor": sensor})
    mechanics(machine, drawn, gap=gap)
    return machine


def _targets(drawn: Draw) -> Floats:
    return np.asarray(drawn["target phase"] + np.arange(_COUNT) * math.tau / _COUNT)


def _geometry(
    machine: Machine, drawn: Draw, grade: float, targets: Floats
) -> tuple[list[dict[str, float]], Floats]:
    """Per target, rad: offsets of the meshes as the twists they start with, and of the table.

    The second, shape (targets,), is what geometry adds to the table at rest.
    """
    whole = machine.copy()
    geometry(whole, drawn, grade=grade)
    offsets = [_offsets(whole.core, target) for target in targets.tolist()]
    if machine.core.controller_options["position_sensor"] == "motor":
        static = np.array([o["mesh_1.twist"] for o in offsets]) / whole.get("mesh_1.ratio")
        return offsets, static
    scale = Machine.load("heavy-table-empty")  # of which only the grating counts
    numbers = {"amplitude": drawn["grating"], "phase": drawn["grating phase"]}
    scale.add("encoder_eccentricity", "table", **numbers)
    read, _, _ = _core.record(scale.core, "table", np.zeros(targets.size), targets)
    return offsets, np.asarray(targets - read)


def _offsets(core: _core.Machine, angle: float) -> dict[str, float]:
    """What pitch errors add to the deflection of each mesh at an angle of the table, rad."""
    system = _core.linearise(core, state={"theta_m": angle})
    z = np.array([angle if name == "theta_m" else 0.0 for name in system.states])
    values = np.asarray(system.C) @ z + np.asarray(system.c)
    found = {}
    for mesh in (name for name in core.connections if name.startswith("mesh_")):
        twist, deflection = (system.signals.index(f"{mesh}.{n}") for n in ("twist", "deflection"))
        found[f"{mesh}.twist"] = float(values[deflection] - values[twist])
    return found


def _figures(targets: Floats, seen: Floats, drawn: Draw) -> Floats:
    """A, R and B, arcsec, of deviations of shape (targets, cycles, 2); NaN where one is missing."""
    if np.isnan(seen).any():
        return np.full(3, np.nan)
    # in the order of the test: upwards through all targets, then back, cycle by cycle
    errors = drawn.instrument(seen.size).reshape(REPEATS, 2, targets.size)
    up = targets[:, None] + seen[:, :, 0] + errors[:, 0].T
    down = targets[:, None] + seen[:, :, 1] + errors[:, 1, ::-1].T
    figures = evaluate(targets, up, down, unit="rad", name="crossed").figures()
    return np.array([float(figures[name] or 0.0) / ARCSEC for name in "ARB"])


@dataclass(frozen=True)
class Check:
    """Targets by themselves against a whole machine driven round the circle, arcsec.

    difference: of where the table stands 3 s after it was in position, at any target either way,
                without a common zero
    spread:     range of those positions, for scale
    """

    column: str
    sensor: str
    difference: float
    spread: float


def check(grade: float = 8.0, number: int = 0, load: str = "100t") -> Iterator[Check]:
    """Drive whole machines, pitch errors, grating and all, and compare where they stand."""
    drawn = draw(number)
    targets = _targets(drawn)
    for column, sensor in product(PAIR, SENSORS):
        machine = _machine(drawn, load, sensor, 1.0, column)
        pitch, static = _geometry(machine, drawn, grade, targets)
        parts = readings(machine, drawn, pitch)[3.0].off[:, -1] + static[:, None]
        whole = machine.copy()
        geometry(whole, drawn, grade=grade)
        stood = _round(whole, drawn, targets)
        apart = np.stack([stood[0], stood[1, ::-1]], axis=1) - parts
        apart -= apart.mean()
        yield Check(
            column, sensor, float(np.abs(apart).max()) / ARCSEC, float(np.ptp(parts)) / ARCSEC
        )


def _round(machine: Machine, drawn: Draw, targets: Floats) -> Floats:
    """Where a machine stands at every target of a turn forth and back, rad, shape (2, targets)."""
    turns = [targets[0] - FROM, *targets, targets[-1] + FROM, *targets[::-1]]
    timing = (*LIMITS, DWELL, START, 1)
    stops = np.delete(np.asarray(_core.dwells_of_cycle(turns, *timing)), [0, _COUNT + 1], axis=0)
    run = simulate(
        machine,
        inputs={"theta_ref": _core.cycle_of_moves(turns, *timing)},
        end=float(stops[-1, 2]),
        signals=["theta_m", "sensed.table"],
        times=looks(stops).ravel(),
        energy=False,
        rtol=1e-7,
    )
    true, sensed = (run[name].reshape(len(stops), -1) for name in ("theta_m", "sensed.table"))
    return read(true, sensed, stops, drawn)[3.0].off.reshape(2, _COUNT)

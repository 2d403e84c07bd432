"""A positioning test as a machine makes it: targets from both sides, a dwell at each, repeated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualdrive import _core
from dualdrive.figures import is_controlled
from dualdrive.machine import Machine
from dualdrive.motion import Motion, cycle, default_motion
from dualdrive.run import Run
from dualdrive.simulation import simulate

from .iso230 import Iso230, evaluate
from .rules import REPEATS, IndexingError

__all__ = ["STILL", "Cycle", "cycle_for", "measure"]

Floats = NDArray[np.float64]

#: by how much a table may move while its position is read: 1 arc second, 1 µm
STILL: Final = {"rad": np.pi / 648000, "m": 1e-6}
#: samples within the window in which a position is read
_SAMPLES: Final = 21


@dataclass(frozen=True)
class Cycle:
    """A bidirectional test cycle; angles in rad (m on a linear axis), times in s.

    targets:  increasing, at least two;  overrun: how far beyond the outer ones it turns back
    v, a, j:  limits of the moves between them
    dwell:    at every target;  window: the end of it, over which the position is averaged
    still:    by how much the table may move within the window
    repeats:  of the whole cycle;  start: of the first move
    """

    targets: tuple[float, ...]
    overrun: float
    v: float
    a: float
    j: float
    dwell: float
    window: float
    still: float
    repeats: int = REPEATS
    start: float = 0.0

    def __post_init__(self) -> None:
        if not 0 < self.window <= self.dwell:
            raise IndexingError(
                f"window = {self.window:g} s of a dwell of {self.dwell:g} s: must be positive and "
                "no longer than the dwell"
            )

    @property
    def motion(self) -> Motion:
        """The commanded motion. Raises ValueError naming what can't be."""
        turns = _core.bidirectional_targets(list(self.targets), self.overrun)
        limits = {"v": self.v, "a": self.a, "j": self.j, "dwell": self.dwell, "start": self.start}
        return cycle(turns, repeats=self.repeats, **limits)

    def dwells(self) -> Floats:
        """When the command rests at its targets: (target, begin, end), shape (moves, 3)."""
        turns = _core.bidirectional_targets(list(self.targets), self.overrun)
        return np.asarray(
            _core.dwells_of_cycle(
                turns, self.v, self.a, self.j, self.dwell, self.start, self.repeats
            )
        )

    def readings(self) -> Floats:
        """When the position is read, s, shape (moves, samples)."""
        ends = self.dwells()[:, 2]
        # the dwell's end belongs to the next move already
        return ends[:, None] - np.linspace(self.window, 1e-3 * self.window, _SAMPLES)

    def words(self) -> str:
        """The cycle in a line."""
        return self.motion.text


def cycle_for(machine: Machine, targets: ArrayLike | None = None, **changes: Any) -> Cycle:
    """A test cycle that suits a machine.

    targets:  rad or m; else eight round the circle, or five over 0.2 m on a linear axis
    changes:  any of `Cycle`: dwell=8, repeats=5, still=5e-6. Moves and dwells that are not named
              follow the machine's own default motion. A value None counts as not named

    Raises IndexingError for fewer than two targets, or a machine without controller.
    """
    if not is_controlled(machine):
        raise IndexingError(f"{machine.name}: no controller, so nothing goes to a target")
    unit = machine.unit_of("e", "rad")
    places = _usual_targets(unit) if targets is None else np.array(targets, float).reshape(-1)
    if places.size < 2 or (np.diff(places) <= 0).any():
        raise IndexingError(f"targets {places.tolist()}: give two or more, increasing")
    usual = default_motion(machine).arguments
    settle = usual["settle"]
    settings = {
        "targets": tuple(places.tolist()),
        "overrun": 0.05 * float(np.diff(places).min()),
        **{name: usual[name] for name in ("v", "a", "j", "start")},
        "dwell": 1.2 * settle,
        "still": STILL[unit],
    }
    given = {name: value for name, value in changes.items() if value is not None}
    settings |= given
    settings.setdefault("window", min(0.2 * settle, settings["dwell"]))
    return Cycle(**settings)


def _usual_targets(unit: str) -> Floats:
    count, spacing = (8, np.pi / 4) if unit == "rad" else (5, 0.05)
    return np.arange(count) * np.float64(spacing)


def measure(
    machine: Machine,
    cycle: Cycle | None = None,
    *,
    travel: float | None = None,
    engine: str = "auto",
    rtol: float | None = None,
) -> Iso230:
    """Drive a machine through a test cycle and evaluate where the table came to rest.

    The position is the true one of the table, as an interferometer on it would see it: what its
    own sensor reads does not enter. It is the mean over the window at the end of each dwell.

    Raises IndexingError where the simulation fails, or the table still moves while it is read.
    """
    cycle = cycle or cycle_for(machine)
    run = _driven(machine, cycle, engine, rtol)
    up, down = _read(machine, cycle, run["theta_m"].reshape(-1, _SAMPLES))
    return evaluate(
        cycle.targets,
        up,
        down,
        unit=machine.unit_of("e", "rad"),
        travel=travel,
        name=machine.name,
    )


def _driven(machine: Machine, cycle: Cycle, engine: str, rtol: float | None) -> Run:
    """The run, sampled where positions are read."""
    motion = cycle.motion
    run = simulate(
        machine,
        motion,
        end=motion.end,
        signals=["theta_m"],
        times=cycle.readings().ravel(),
        energy=False,
        engine=engine,
        rtol=rtol,
    )
    if not run.ok:
        raise IndexingError(f"{machine.name}: {run.status}: {run.message}; no position was read")
    return run


def _read(machine: Machine, cycle: Cycle, seen: Floats) -> tuple[Floats, Floats]:
    """Positions upwards and downwards, shapes (m, n), from samples of shape (moves, samples)."""
    targets = cycle.dwells()[:, 0]
    count = len(cycle.targets)
    # one cycle: below the first, up through all, beyond the last, down through all
    ways = np.array([0, *[1] * count, 0, *[-1] * count] * cycle.repeats)
    restless = np.ptp(seen, axis=1)
    worst = int(np.argmax(np.where(ways != 0, restless, -1.0)))
    if not restless[worst] <= cycle.still:
        raise IndexingError(_unsettled(machine, cycle, targets[worst], restless[worst], seen))
    at_rest = seen.mean(axis=1)
    shape = (cycle.repeats, count)
    up = at_rest[ways > 0].reshape(shape).T
    down = at_rest[ways < 0].reshape(shape).T[::-1]
    return up, down


def _unsettled(machine: Machine, cycle: Cycle, target: float, moved: float, seen: Floats) -> str:
    from dualdrive.units import human

    unit = machine.unit_of("e", "rad")
    if not np.isfinite(seen).all() or moved > 0.1 * np.ptp(cycle.targets):
        return f"{machine.name}: the loop is unstable: the table leaves its targets; no position"
    place = human(float(target), unit, prefer={"rad": "deg"}.get(unit))
    return (
        f"{machine.name}: the table does not stand still: at target {place} "
        f"it moves by {human(float(moved), unit)} within the last {cycle.window:g} s of its dwell "
        f"(allowed {human(cycle.still, unit)}): it hunts or has not settled; no position is read. "
        f"Give a --dwell (dwell=) longer than {cycle.dwell:g} s, tension or tune the drives, or "
        "allow more: --still (still=)"
    )

"""How a cycle changes with one number of the machine, through folds: pseudo-arclength continuation.

Source: Keller, *Numerical solution of bifurcation and nonlinear eigenvalue problems*, in
Applications of Bifurcation Theory, 1977. The phase, across the flow of the orbit before: Seydel,
*Practical Bifurcation and Stability Analysis*, 2010, chapter 7.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.cycles.errors import CycleError
from dualdrive.cycles.flow import Flow
from dualdrive.cycles.orbit import Orbit, describe
from dualdrive.cycles.shooting_method import refuse_rest, scales
from dualdrive.display import Displayed

__all__ = ["Branch", "branch"]

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

_CLOSED = 1e-8
_ITERATIONS = 8
_SHORTEST, _LONGEST = 1 / 256, 2.0  # of the first step
#: cosine of the largest angle between one step and the next. At half the angle steps get too short
#: to pass the fold of the heavy table with 60 points; at twice the same fold is found
_BENDS = 0.5
_DIFFERENCE = 1e-5  # of the parameter's range


@dataclass(frozen=True, eq=False)
class Branch(Displayed, picture="cycle_branch"):
    """Orbits along a curve, in the order in which they were followed.

    path:    the parameter, values: its value at each orbit, shape (n,), SI
    ended:   why the curve ends
    """

    path: str
    values: Array
    orbits: tuple[Orbit, ...]
    ended: str

    @property
    def amplitude(self) -> Array:
        """Of the table, half peak to peak, rad, shape (n,)."""
        return np.array([orbit.amplitude for orbit in self.orbits])

    @property
    def frequency_hz(self) -> Array:
        """Shape (n,)."""
        return np.array([orbit.frequency_hz for orbit in self.orbits])

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Shape (n,)."""
        return np.array([orbit.stable for orbit in self.orbits])

    @property
    def folds(self) -> list[float]:
        """Values at which the curve turns back: two orbits meet there and vanish.

        Each is the outermost orbit that was met; the fold is a little beyond it.
        """
        turns = np.flatnonzero(np.diff(np.sign(np.diff(self.values)))) + 1
        return [float(value) for value in self.values[turns]]

    def figures(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "path": self.path,
            "values": self.values.tolist(),
            "folds": self.folds,
            "ended": self.ended,
            "orbits": [orbit.figures() for orbit in self.orbits],
        }


def branch(
    orbit: Orbit,
    path: str,
    stop: float,
    *,
    points: int = 40,
    progress: Progress | None = None,
) -> Branch:
    """Follow an orbit from its machine's own value of `path` towards `stop`.

    points: at most so many orbits; the first step is stop - start over half of them

    The curve ends at `stop`, back at its start value, where no orbit continues it, or after
    `points`. Raises CycleError where path is not a number that can be followed.
    """
    start = orbit.machine.get(path)
    if start == stop or not np.isfinite([start, stop]).all():
        raise CycleError(f"branch: {path} from {start:g} to {stop:g}: needs two finite numbers")
    curve = _Curve(orbit, path, start, stop)
    step = first = 2.0 / points
    ended = f"{points} orbits"
    while len(curve.orbits) < points:
        if not curve.advance(step):
            step /= 2
            if step < _SHORTEST * first:
                ended = f"no orbit continues it beyond {path} = {curve.value:g}"
                break
            continue
        step = min(1.4 * step, _LONGEST * first)
        if progress:
            progress(len(curve.orbits), points)
        if min(abs(curve.value - end) for end in (start, stop)) <= 1e-9 * abs(stop - start):
            ended = f"{path} = {curve.value:g} reached"
            break
    values = np.array([point[-1] for point in curve.points])
    return Branch(path, values, tuple(curve.orbits), ended)


class _Curve:
    """Points (state, period, parameter).

    Lengths along the curve count the parameter over its range, the logarithm of the period and the
    moving parts over their size; states of the controller follow.
    """

    def __init__(self, orbit: Orbit, path: str, start: float, stop: float) -> None:
        self.machine, self.path, self.range = orbit.machine, path, stop - start
        self.limits = sorted((start, stop))
        flow = Flow(orbit.machine)
        state = np.array([orbit.state[name] for name in flow.states])
        self.moving = np.array([not name.startswith("controller.") for name in flow.states])
        self.points: list[Array] = [np.array([*state, orbit.period, start])]
        self.orbits = [orbit]

    @property
    def value(self) -> float:
        """The parameter where the curve is now."""
        return float(self.points[-1][-1])

    def advance(self, step: float) -> bool:
        """One step along the curve; False where no orbit is found."""
        last = self.points[-1]
        size = self._size(last)
        weight = self._weight(size)
        way = np.zeros_like(last)
        way[-1] = self.range
        if len(self.points) > 1:
            way = last - self.points[-2]
        phase = self._phase(last, weight)
        way -= phase * (phase * weight**2 @ way)  # the same orbit from another point is no way
        way /= np.linalg.norm(way * weight)
        predicted, way = self._within(last, way, step)
        try:
            found = self._correct(predicted, way, phase, size, weight)
            if found is None:
                return False
            point, M, miss = found
            if not self._goes_on(point, weight):
                return False
            refuse_rest(self._flow(point), point[:-2], float(point[-2]), size[:-2])
            orbit = describe(self._flow(point), point[:-2], float(point[-2]), M, miss)
        except ValueError:  # a number the machine refuses, a run that fails
            return False
        self.points.append(point)
        self.orbits.append(orbit)
        return True

    def _goes_on(self, point: Array, weight: Array) -> bool:
        """Whether the curve bends little on the way to a point; else it may lie on another one.

        The angle between two steps: Allgower, Georg, *Introduction to Numerical Continuation
        Methods*, 2003, chapter 6. Through a fold, shorter steps bend less each.
        """
        if len(self.points) == 1:
            return True
        before = (self.points[-1] - self.points[-2]) * weight
        now = (point - self.points[-1]) * weight
        along = before @ now / (np.linalg.norm(before) * np.linalg.norm(now))
        return bool(along > _BENDS)

    def _phase(self, point: Array, weight: Array) -> Array:
        """The unit vector along the orbit itself."""
        along = np.zeros_like(point)
        along[:-2] = self._flow(point).rate(point[:-2], float(point[-2]))
        return np.asarray(along / np.linalg.norm(along * weight))

    def _within(self, last: Array, way: Array, step: float) -> tuple[Array, Array]:
        """A step's end and what is held there: the parameter itself where it meets its limits."""
        change = way[-1] * step
        room = (self.limits[1] if change > 0 else self.limits[0]) - last[-1]
        if abs(change) < abs(room) or room == 0:
            return np.asarray(last + step * way), way
        across = np.zeros_like(way)
        across[-1] = way[-1]
        return np.asarray(last + step * room / change * way), across

    def _size(self, point: Array) -> Array:
        """What each coordinate is measured in."""
        flow = self._flow(point)
        return np.array([*scales(flow, point[:-2], float(point[-2])), point[-2], abs(self.range)])

    def _weight(self, size: Array) -> Array:
        share = np.concatenate([self.moving / np.sqrt(self.moving.sum()), [1.0, 1.0]])
        return np.asarray(share / size)

    def _flow(self, point: Array) -> Flow:
        machine = self.machine.copy()
        machine.set(self.path, float(point[-1]))
        return Flow(machine)

    def _miss(self, point: Array) -> Array:
        return self._flow(point).after(point[:-2], float(point[-2])) - point[:-2]

    def _correct(
        self, predicted: Array, way: Array, phase: Array, size: Array, weight: Array
    ) -> tuple[Array, Array, float] | None:
        """Newton's method on the map, the plane across the flow, and the one across the way.

        Across the flow of the point before: a phase that drifts with the steps would count as a
        way along the curve, and what turned back in it as a fold.
        """
        n, point = predicted.size - 2, predicted
        across = phase * weight**2
        miss = self._miss(point)
        size = size.copy()
        size[:n] = np.maximum(size[:n], np.abs(miss))  # a filter that stood at zero wakes
        for _ in range(_ITERATIONS):
            flow, state, period = self._flow(point), point[:-2], float(point[-2])
            worst = float(np.abs(miss / size[:n]).max())
            if worst < _CLOSED:
                return point, flow.monodromy(state, period, size[:n]), worst
            M = flow.monodromy(state, period, size[:n], state + miss)
            rate = flow.rate(state, period)
            nudge = np.zeros_like(point)
            nudge[-1] = _DIFFERENCE * self.range
            by_number = (self._miss(point + nudge) - self._miss(point - nudge)) / (2 * nudge[-1])
            J = np.zeros((n + 2, n + 2))
            J[:n] = np.column_stack([M - np.eye(n), rate, by_number]) * size / size[:n, None]
            J[n] = across * size
            J[n + 1] = way * weight**2 * size
            wrong = np.concatenate(
                [
                    miss / size[:n],
                    [across @ (point - predicted), (way * weight**2) @ (point - predicted)],
                ]
            )
            point = point - size * np.linalg.lstsq(J, wrong, rcond=1e-14)[0]
            if not (np.isfinite(point).all() and 0.3 < point[-2] / predicted[-2] < 3):
                return None
            miss = self._miss(point)
        return None

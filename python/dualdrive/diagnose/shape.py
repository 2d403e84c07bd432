"""What shape the missing torque has: along which coordinate it is a curve, with bands.

What a refitted machine lacks is a torque at every sample. Its mean in bins of a coordinate is a
curve; the share of its mean square that the curve takes tells whether the coordinate is the one.
Neighbouring samples are alike, so that a band counts effective samples.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.compare.comparison import EQUATIONS
from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.diagnose.result import Shape
from dualdrive.identify import Processing
from dualdrive.identify.coloured import correlation_time
from dualdrive.innovations import Filtered, GreyBox, Point, Predictable
from dualdrive.replay import deflections, ratio_to_table
from dualdrive.traces import Trace

Array = NDArray[np.float64]

BINS = 24
_COARSE = 5  # bins at least: with fewer no curve is told from a line
_BY_CHANCE = (
    0.1  # of any noise, what a curve may explain that is judged; of the demo half and twice
)
#: as much say the same
_FEWEST = 6  # samples of a bin
_Z = 1.96


@dataclass(frozen=True, eq=False)
class Course:
    """What an equation of motion lacks, sample by sample over all records; arrays of shape (n,).

    equation:    its name, as it is told
    torque:      N*m in the frame of its body
    coordinates: (name, unit, values) of what the torque may depend on
    """

    equation: str
    torque: Array
    coordinates: Sequence[tuple[str, str, Array]]


def shapes(courses: Sequence[Course], count: int = 6) -> list[Shape]:
    """Curves of the missing torque, those that explain most first.

    The few that explain most of all, and the best along every coordinate: what a torque does not
    depend on is told by a flat curve too.

    Args:
        courses: one of every equation.
        count: how many of those that explain most of all.

    """
    found: list[Shape] = []
    for own in courses:
        if len(own.torque) < 4 * BINS:
            continue
        torque = own.torque - np.mean(own.torque)
        for coordinate, unit, values in own.coordinates:
            shape = _curve(own.equation, coordinate, unit, values, torque)
            if shape is not None:
                found.append(shape)
    found.sort(key=lambda s: -s.explained)
    best = {s.coordinate: s for s in reversed(found)}
    return [s for k, s in enumerate(found) if k < count or best[s.coordinate] is s]


def of_the_filter(grey: GreyBox, point: Point, gains: Sequence[Any]) -> list[Course]:
    """The torques of unknown course that a filter of a refitted machine asks for.

    Args:
        grey: whole records.
        point: the machine.
        gains: Kalman gains there, per record.

    """
    ways = grey.filtered(point, gains)
    found = []
    for body in ways[0].torques:
        where = [_where(grey.core, r, own, body) for r, own in zip(grey.records, ways, strict=True)]
        found.append(
            Course(
                body.replace("_", " "),
                np.concatenate([own.torques[body] for own in ways]),
                [
                    (name, unit, np.concatenate([own[name][1] for own in where]))
                    for name, (unit, _) in where[0].items()
                    if all(name in own for own in where)
                ],
            )
        )
    return found


def _where(
    core: Any, record: Predictable, way: Filtered, body: str
) -> dict[str, tuple[str, Array]]:
    """Coordinate -> (unit, values at the samples of a record) of what a body's torque may feel.

    A drive's torque may depend on the deflection of its own mesh, the table's on those of all.
    """
    drive = body.rpartition("_")[2] if body in core.motors else ""
    states = way.states
    read = dict(zip(record.channels, record.measured.T, strict=True))
    found: dict[str, tuple[str, Array]] = {}
    speeds = (f"omega_{drive}", f"omega_c{drive}", "omega_m")
    if speed := next((name for name in speeds if name in states), ""):
        found["speed"] = "rad/s", states[speed]
        found["direction"] = "", np.sign(states[speed])
    if "theta_m" in states:
        found["angle"] = "rad", states["theta_m"]
    for twist in deflections(core, read):
        if not drive or twist.name.endswith(drive):
            found[f"deflection {twist.name}"] = twist.unit, twist.measured
    given = [
        (1.0 if drive else ratio_to_table(core, motor), _given(core, motor, read))
        for motor in core.motors
        if motor == body or not drive
    ]
    known = [ratio * torque for ratio, torque in given if torque is not None]
    if known and len(known) == len(given):
        found["drive torque"] = "N*m", np.sum(known, axis=0)
    found["time"] = "s", np.asarray(record.record.t)
    return found


def _given(core: Any, motor: str, read: Mapping[str, Array]) -> Array | None:
    """A motor's torque as it was recorded, N*m; None where it was not."""
    n = motor.rpartition("_")[2]
    if f"I_{n}" in read:
        given: Array = core.get(f"{motor}.K_d") * read[f"I_{n}"]
        return given
    return read.get(f"T_{n}")


def of_the_balance(
    machine: Any,
    traces: Mapping[str, Trace],
    settings: Mapping[str, Mapping[str, float]],
    processing: Processing | None = None,
) -> list[Course]:
    """What the torque balance of a refitted machine leaves; none without torques and angles.

    Args:
        machine: the core's machine, its nominal numbers refitted.
        traces: with torques or currents and angles.
        settings: of each trace.
        processing: filters of the torque balance.

    """
    try:
        balance = TorqueBalance(machine, traces, settings, processing)
    except (ValueError, KeyError, StopIteration):
        return []
    left = balance.left(machine, balance.levelled(machine, balance.start))
    if left is None:
        return []
    found = []
    for e, name in enumerate(balance.equations):
        rows = range(e, len(left), len(balance.equations))
        torque = np.concatenate([left[k][balance.series[k].keep] for k in rows])
        if len(torque):
            where = _coordinates(machine, balance, e)
            found.append(Course(EQUATIONS.get(name, name), torque, where))
    return found


def _coordinates(core: Any, balance: TorqueBalance, equation: int) -> list[tuple[str, str, Array]]:
    """(name, unit, values at the counted samples) of what the torque may depend on.

    A drive's torque may depend on the deflection of its own mesh, the table's on those of all.
    """
    count = len(balance.equations)
    rows = range(equation, len(balance.series), count)
    held = [balance.held[k // count] for k in rows]
    keep = [balance.series[k].keep for k in rows]

    def joined(name: str) -> Array | None:
        if not all(name in h.samples for h in held):
            return None
        return np.concatenate([h.samples[name][own] for h, own in zip(held, keep, strict=True)])

    speed = next(
        (s for n in ("omega_m", "omega_1", "omega_c1") if (s := joined(n)) is not None), None
    )
    angle = next(
        (s for n in ("theta_m", "theta_1", "theta_c1") if (s := joined(n)) is not None), None
    )
    found = []
    if speed is not None:
        found += [("speed", "rad/s", speed), ("direction", "", np.sign(speed))]
    if angle is not None:
        found.append(("angle", "rad", angle))
    drive = balance.equations[equation].lstrip("c")
    twists = [deflections(core, h.samples) for h in held]
    for twist in twists[0]:
        if drive.isdecimal() and not twist.name.endswith(drive):
            continue
        same = [t.measured for own in twists for t in own if t.name == twist.name]
        if len(same) == len(held):
            values = np.concatenate([x[own] for x, own in zip(same, keep, strict=True)])
            found.append((f"deflection {twist.name}", twist.unit, values))
    measured = np.concatenate(
        [balance.series[k].measured[own] for k, own in zip(rows, keep, strict=True)]
    )
    found.append(("drive torque", "N*m", measured))
    time = np.concatenate([h.t[own] for h, own in zip(held, keep, strict=True)])
    found.append(("time", "s", time))
    return found


def _curve(equation: str, coordinate: str, unit: str, values: Array, torque: Array) -> Shape | None:
    """The curve over fine bins; the share that it explains is judged over coarse ones.

    A curve through as many bins explains some of any noise, and that is taken off: where samples
    are so alike that fine bins explain all of it, nothing would be left to judge by.
    """
    alike = 1.0 + 2.0 * correlation_time(torque)
    coarse = int(np.clip(_BY_CHANCE * len(torque) / alike, _COARSE, BINS))
    drawn = _binned(coordinate, values, torque, BINS)
    judged = _binned(coordinate, values, torque, coarse)
    whole = float(torque @ torque)
    if len(drawn) < 2 or len(judged) < 2 or whole <= 0.0:
        return None
    square = sum(len(own) * float(np.mean(own)) ** 2 for _, own in judged)
    chance = (len(judged) - 1) * alike / len(torque)
    explained = min(max((square / whole - chance) / max(1.0 - chance, 1e-9), 0.0), 1.0)
    a = np.array([at for at, _ in drawn])
    m = np.array([np.mean(own) for _, own in drawn])
    w = [_Z * np.std(own) / np.sqrt(max(len(own) / alike, 2.0)) for _, own in drawn]
    return Shape(equation, coordinate, unit, "N*m", a, m, m - w, m + w, explained)


def _binned(coordinate: str, values: Array, torque: Array, count: int) -> list[tuple[float, Array]]:
    """Bins of as many samples each: where they lie, and the torque of their samples."""
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, count + 1)))
    if coordinate == "direction":
        edges = np.array([-1.5, 0.0, 1.5])
    if len(edges) < 3:
        return []
    where = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    bins = [where == b for b in range(len(edges) - 1)]
    return [(float(np.mean(values[b])), torque[b]) for b in bins if b.sum() >= _FEWEST]

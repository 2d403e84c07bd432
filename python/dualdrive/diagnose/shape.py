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
from dualdrive.identify import Processing, with_torques
from dualdrive.identify.coloured import correlation_time
from dualdrive.innovations import GreyBox, Point
from dualdrive.replay import deflections, ratio_to_table
from dualdrive.traces import Trace

Array = NDArray[np.float64]

BINS = 24
_COARSE = 5  # bins at least: with fewer no curve is told from a line
#: of any noise, what a curve may explain that is judged; of the demo half and twice as much say the
#: same
_BY_CHANCE = 0.1
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
    core, ways = grey.core, grey.filtered(point, gains)
    found = []
    for body in ways[0].torques:
        drive = body.rpartition("_")[2] if body in core.motors else ""
        where = []
        for record, way in zip(grey.records, ways, strict=True):
            read = dict(zip(record.channels, record.measured.T, strict=True))
            given = _given(core, with_torques(core, record.record.trace), drive)
            where.append(_where(core, {**way.states, **read}, drive, given, record.record.t))
        found.append(_course(body.replace("_", " "), [own.torques[body] for own in ways], where))
    return found


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
    count, found = len(balance.equations), []
    for e, name in enumerate(balance.equations):
        drive = name.lstrip("c")
        torques, where = [], []
        for held, series, own in zip(
            balance.held, balance.series[e::count], left[e::count], strict=True
        ):
            keep = series.keep
            samples = {channel: held.samples[channel][keep] for channel in held.samples}
            torques.append(own[keep])
            where.append(
                _where(
                    machine, samples, drive if drive.isdecimal() else "", series.measured[keep],
                    held.t[keep],
                )
            )  # fmt: skip
        found.append(_course(EQUATIONS.get(name, name), torques, where))
    return found


#: coordinate -> its unit, and values at the samples of a record
_Where = dict[str, tuple[str, Array]]


def _course(equation: str, torques: Sequence[Array], where: Sequence[_Where]) -> Course:
    """Records end to end, along the coordinates that all of them have."""
    coordinates = [
        (name, unit, np.concatenate([own[name][1] for own in where]))
        for name, (unit, _) in where[0].items()
        if all(name in own for own in where)
    ]
    return Course(equation, np.concatenate(torques), coordinates)


def _where(
    core: Any, samples: Mapping[str, Array], drive: str, given: Array | None, t: Array
) -> _Where:
    """What a torque may depend on, at the samples of a record.

    A drive's torque may depend on the deflection of its own mesh, the table's on those of all.

    Args:
        core: the machine.
        samples: angles and speeds, by channel.
        drive: number of the drive on which it acts; empty: on the table.
        given: what the drives gave there, N*m; None where that was not recorded.
        t: s.

    """
    found: _Where = {}
    own = (f"omega_{drive}", f"omega_c{drive}") if drive else ()
    speeds, angles = (*own, "omega_m", "omega_1", "omega_c1"), ("theta_m", "theta_1", "theta_c1")
    if speed := next((name for name in speeds if name in samples), ""):
        found["speed"] = "rad/s", samples[speed]
        found["direction"] = "", np.sign(samples[speed])
    if angle := next((name for name in angles if name in samples), ""):
        found["angle"] = "rad", samples[angle]
    for twist in deflections(core, samples):
        if not drive or twist.name.endswith(drive):
            found[f"deflection {twist.name}"] = twist.unit, twist.measured
    if given is not None:
        found["drive torque"] = "N*m", given
    found["time"] = "s", t
    return found


def _given(core: Any, trace: Trace, drive: str) -> Array | None:
    """What a drive gave, or all of them at the table, N*m; None where that was not recorded."""
    ratios = {
        f"T_{motor.rpartition('_')[2]}": 1.0 if drive else ratio_to_table(core, motor)
        for motor in core.motors
    }
    wanted = [f"T_{drive}"] if drive else list(ratios)
    if not all(name in trace for name in wanted):
        return None
    given: Array = np.sum([ratios[name] * trace[name] for name in wanted], axis=0)
    return given


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

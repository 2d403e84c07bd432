"""Whether the channels of a record belong to this machine and to each other, signs included."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dualdrive.identify import Processing
from dualdrive.identify.filtering import pieces
from dualdrive.identify.model import CoreModel
from dualdrive.identify.passivity import torque_doubts
from dualdrive.replay import ratio_to_table
from dualdrive.traces import Trace

Array = NDArray[np.float64]

_FILTER = Processing(decimate=10)
#: code, message, fatal
Finding = tuple[str, str, bool]

_OFF = 0.02  # of a ratio, beyond what play and twist allow
_REST = 2.0  # times what no ratio explains: as much of a twist may go with the travel
_HARDLY = 0.3  # of a ratio: play that leaves it open
_RELATED = 0.8  # correlation of angles that move together
_RINGING = 4.0  # times the twist under a steady torque, at a resonance
_CLEAR = 0.6  # correlation that makes a sign certain
_ALIKE = 0.8  # correlation with what the motion needs from which a torque's size can be told
_ORDERS = 4.0  # times too large or too small a torque
#: factors by which a unit, or a frame, is commonly mistaken
_UNITS = {
    180.0 / np.pi: "it looks like degrees",
    np.pi / 180.0: "the other looks like degrees",
    1.0 / (2.0 * np.pi): "it looks like turns",
    2.0 * np.pi: "the other looks like turns",
    1e3: "it looks like thousandths",
    1e-3: "the other looks like thousandths",
}


def train_fits(core: Any, trace: Trace) -> Iterator[Finding]:
    """Ratios, signs and places of the encoders, by how far they travel together."""
    if "theta_m" not in trace:
        return
    table = trace["theta_m"]
    for motor in core.motors:
        n = motor.rpartition("_")[2]
        for angle, part in ((f"theta_{n}", motor), (f"theta_c{n}", f"pinion_{n}")):
            if angle in trace and np.ptp(trace[angle]) > 0.0 and np.ptp(table) > 0.0:
                ratio = ratio_to_table(core, part)
                yield from _ratio(core, trace, angle, n, ratio)
    if {"theta_1", "theta_2"} <= set(trace) or {"theta_c1", "theta_c2"} <= set(trace):
        yield from _swapped_drives(core, trace)


def _ratio(core: Any, trace: Trace, angle: str, n: str, ratio: float) -> Iterator[Finding]:
    """Where a drive is, by its ratio, but for play and twist: these do not grow with the travel."""
    line = _together(trace[angle] / ratio, trace["theta_m"], trace)
    play, twist = _loose(core, trace, n)
    if abs(line.correlation) < _RELATED:
        if line.rest > play + twist:
            yield (
                "ratio",
                f"{angle} and theta_m do not move together; one of them is another axis, or its "
                "counter is broken",
                True,
            )
        return
    allowed = _OFF + (0.5 * play + _REST * line.rest / abs(line.slope)) / line.travel
    if allowed > _HARDLY:
        return  # within its play a drive need not move with the table
    slope = line.slope * ratio
    off = slope / ratio
    if abs(off - 1.0) <= allowed:
        return
    if abs(off + 1.0) <= allowed:
        yield (
            "sign",
            f"{angle} turns against theta_m; turn one round with sign = -1 in the mapping",
            True,
        )
    elif abs(slope * ratio - 1.0) <= allowed and abs(ratio) > 1.5:
        yield "swapped", f"{angle} and theta_m look exchanged; see the mapping", True
    else:
        yield "ratio", _wrong_ratio(angle, slope, ratio), True


def _wrong_ratio(angle: str, slope: float, ratio: float) -> str:
    hint = "the trace is of another machine, or a ratio of the machine file is wrong"
    for factor, words in _UNITS.items():
        if abs(abs(slope / ratio) / factor - 1.0) < _OFF:
            hint = words
    if abs(abs(slope) - 1.0) < _OFF:
        hint = f"it is referred to the table already; give scale = {ratio:g} in the mapping"
    return f"{angle} moves {slope:.5g} times as far as theta_m, not {ratio:.5g} times; {hint}"


class _Line(NamedTuple):
    """One angle as a straight line of the table's: slope, correlation, RMS of both about it, rad.

    travel: RMS of the table's angle
    rest:   RMS of what no line explains
    """

    slope: float
    correlation: float
    travel: float
    rest: float


def _together(own: Array, table: Array, trace: Trace) -> _Line:
    """One angle, referred to the table, over that of the table: where both are, not how fast.

    From sample to sample a drive that hunts in its play, or a table at its resonance, goes ways of
    its own. What a counter lost at a break of the record is no travel.
    """
    breaks = np.asarray(getattr(trace, "breaks", ()), dtype=int)
    a, b = (
        np.concatenate([x - x.mean() for x in np.split(angle, breaks) if len(x)])
        for angle in (own, table)
    )
    power, size, product = float(np.mean(b**2)), float(np.mean(a**2)), float(np.mean(a * b))
    if power == 0.0 or size == 0.0:
        return _Line(0.0, 0.0, math.sqrt(power), math.sqrt(size))
    slope = product / power
    rest = math.sqrt(max(0.0, size - slope * product))
    return _Line(slope, product / math.sqrt(size * power), math.sqrt(power), rest)


def _loose(core: Any, trace: Trace, n: str) -> tuple[float, float]:
    """Play between a drive and the table, and a twist that its torque may bring, rad at the table.

    From the recorded torque, or the largest that the motor has; infinite where neither is known.
    """
    joints = [c for c in (f"mesh_{n}", f"gearbox_{n}") if c in core.connections]
    down = core.get(f"mesh_{n}.ratio") if f"mesh_{n}" in core.connections else 1.0
    play = sum(core.get(f"{c}.gap") for c in joints if core.kind(c) == "gap") / abs(down)
    soft = sum(1.0 / core.get(f"{c}.stiffness") for c in joints if core.kind(c) != "rigid")
    motor = f"motor_{n}"
    if f"T_{n}" in trace:
        torque = float(np.max(np.abs(trace[f"T_{n}"])))
    elif f"I_{n}" in trace:
        torque = abs(core.get(f"{motor}.K_d")) * float(np.max(np.abs(trace[f"I_{n}"])))
    else:
        torque = float(core.get(f"{motor}.T_max"))
    if soft == 0.0:
        return play, 0.0
    return play, _RINGING * soft * torque * abs(ratio_to_table(core, motor)) / down**2


def _swapped_drives(core: Any, trace: Trace) -> Iterator[Finding]:
    """Tension twists the drives against each other the way the torques differ, or they are mixed.

    The sign of the tension, where a controller sets one, tells angles from torques.
    """
    kind = "theta_" if {"theta_1", "theta_2"} <= set(trace) else "theta_c"
    if not {"T_1", "T_2"} <= set(trace):
        return
    apart = trace[f"{kind}1"] - trace[f"{kind}2"]
    differ = trace["T_1"] - trace["T_2"]
    # what grows with the travel is no twist
    basis = np.stack([np.ones(len(apart)), trace["theta_m"]], axis=1)
    apart, differ = (x - basis @ np.linalg.lstsq(basis, x, rcond=None)[0] for x in (apart, differ))
    size = float(np.std(apart) * np.std(differ))
    tension = _tension(core)
    mean = float(np.median(trace["T_1"] - trace["T_2"]))
    reversed_ = bool(tension) and mean * tension < 0.0 and abs(mean) > 0.3 * abs(tension)
    # where no tension is known, load and play may part the drives either way
    against = bool(tension) and size > 0.0 and float(np.mean(apart * differ)) < -_CLEAR * size
    if reversed_ and against:
        what = "the torques (or currents) of motors 1 and 2 look exchanged, or both their signs"
    elif reversed_:
        what = "motors 1 and 2 look exchanged, or the tension has the other sign"
    elif against:
        what = f"{kind}1 and {kind}2 look exchanged: they part against the torques' difference"
    else:
        return
    yield "swapped", f"{what}; T_1 - T_2 is {mean:.3g} N*m; see the mapping", True


def _tension(core: Any) -> float:
    if core.controller_options["kind"] == "none" or len(core.motors) != 2:
        return 0.0
    return float(core.get("controller.T_ten"))


def torques_fit(core: Any, trace: Trace) -> Iterator[Finding]:
    """Signs of the measured torques by power, and their size against what the motion needs."""
    doubts = torque_doubts(core, trace)
    for doubt in doubts:
        yield doubt.code, doubt.message, True
    torques = [f"T_{motor.rpartition('_')[2]}" for motor in core.motors]
    if doubts or not set(torques) <= set(trace):
        return
    try:
        parts = list(pieces(trace, trace.name, _FILTER))
        needed, total = _needed(core, parts)
    except ValueError:
        return
    if float(np.std(needed)) == 0.0 or _correlation(total, needed) < _ALIKE:
        return
    size = float(np.std(total) / np.std(needed))
    most = sum(ratio_to_table(core, motor) * core.get(f"{motor}.T_max") for motor in core.motors)
    if size >= _ORDERS and float(np.max(np.abs(total))) < most:
        # slow motion needs next to nothing but what rubs or pulls: no reason to refuse it
        yield (
            "friction",
            f"{' + '.join(torques)} is {size:.2g} times what this machine needs for that motion, "
            "and within what its drives can give: a friction or a load is missing; else a unit or "
            "the frame of the torques is wrong",
            False,
        )
    elif not 1.0 / _ORDERS < size < _ORDERS:
        yield (
            "scale",
            f"{' + '.join(torques)} is {size:.2g} times what this machine needs for that motion; "
            "the trace is of another machine, or a unit or the frame of the torques is wrong",
            True,
        )


def _needed(core: Any, parts: Any) -> tuple[Array, Array]:
    """Torque the machine asks for at the table, and what the motors give there, filtered."""
    process, model = _FILTER, CoreModel(core)
    needed, given = [], []
    for p in parts:
        balance = model.balance(p.samples, [])
        total = balance.measured[0]
        needed.append(process.reduce(balance.residual[0] + total, p.step))
        given.append(process.reduce(total, p.step))
    return np.concatenate(needed), np.concatenate(given)


def _correlation(a: Array, b: Array) -> float:
    size = float(np.std(a) * np.std(b))
    return float(np.mean((a - a.mean()) * (b - b.mean())) / size) if size > 0.0 else 0.0

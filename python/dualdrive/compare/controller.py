"""The controller's own law on a record: what it would have asked for, seeing that motion.

The machine's bodies are made so heavy that nothing but a guide can move them, and guided along the
recorded angles. The loop, with its limits, ticks and lags as the core has them, then answers the
recorded command and motion with the torques that its law gives. A controller that is described
rightly answers with the torques on record, whatever else the machine lacks.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.identify.filtering import ANGLES, Piece
from dualdrive.replay import Record, ReplayError, ratio_to_table, records
from dualdrive.traces import Trace

Array = NDArray[np.float64]

_HEAVIER = 1e4  # times the machine's own inertia
_BAND = 0.1  # of the sampling rate: how fast the guide corrects
_RTOL = 1e-7
_STEPS = 5_000_000


def commanded_record(core: Any, trace: Trace, name: str) -> Record | None:
    """The record whose command the controller can be given; None where there is none to give."""
    if core.controller_options["kind"] == "none" or "theta_ref" not in trace:
        return None
    try:
        found = records(core, {name: trace})
    except ReplayError:
        return None
    whole = len(found) == 1 and found[0].left_out == 0
    return found[0] if whole and not found[0].moves_at_once else None


def asked_torques(core: Any, record: Record, piece: Piece) -> Array | None:
    """Motor torques that the law gives for the motion of a piece, shape (motors, n).

    Args:
        core: with a controller.
        record: its command, and how the loop stood before.
        piece: the whole record on an even grid, its angles smoothed.

    Returns:
        None where some body's motion is not recorded, or the simulation fails.

    """
    guided = core.copy()
    channels: dict[str, Array] = {}
    for body, angle in _bodies(core).items():
        if angle not in piece.samples:
            return None
        _guide(guided, body, angle, piece.step)
        for name in (angle, *ANGLES[angle]):
            channels[_column(name)] = piece.samples[name]
        if angle != "theta_m":  # its zero is its encoder's, and the law reads its speed alone
            begin = ratio_to_table(core, body) * piece.samples["theta_m"][0]
            channels[_column(angle)] = piece.samples[angle] - piece.samples[angle][0] + begin
    inputs = dict(record.inputs)
    for name, values in channels.items():
        inputs[name] = _core.sampled(piece.t, values, _core.Interpolation.cubic)
    names = [f"T_{motor.rpartition('_')[2]}" for motor in core.motors]
    at = np.clip(piece.t, record.t[0], record.t[-1])
    try:
        run = _core.simulate(
            guided,
            inputs,
            start=record.begin,
            end=float(at[-1]),
            times=np.unique(at).tolist(),
            rtol=_RTOL,
            max_steps=_STEPS,
            signals=names,
            initial={k: v for k, v in record.initial.items() if k in dict(guided.states())},
            energy=False,
        )
    except ValueError:
        return None
    if run.status != "success":
        return None
    rows = np.searchsorted(run.t, at)
    return np.stack([run.values[rows, run.names.index(name)] for name in names])


def _bodies(core: Any) -> dict[str, str]:
    """Bodies that move by themselves, and the angle that is recorded of each."""
    found = {"table": "theta_m"}
    for motor in core.motors:
        found[motor] = f"theta_{motor.rpartition('_')[2]}"
    stiff = all(core.kind(c) == "rigid" for c in core.connections)
    return {"table": "theta_m"} if stiff else found


def _guide(core: Any, body: str, angle: str, step: float) -> None:
    """Make a body heavy, and push it along its recorded angle."""
    own = max(core.get("table.J") / ratio_to_table(core, body) ** 2, core.get(f"{body}.J"))
    heavy = _HEAVIER * own
    core.set(f"{body}.J", heavy)
    speed, rate = ANGLES[angle]
    pull = 2 * np.pi * _BAND / step
    formula = f"m*{_column(rate)} + d*({_column(speed)} - {speed}) + k*({_column(angle)} - {angle})"
    numbers: Sequence[tuple[str, str, float]] = [
        ("m", "", heavy),
        ("d", "", 2.0 * heavy * pull),
        ("k", "", heavy * pull**2),
    ]
    core.add_expression(body, formula, list(numbers))


def _column(name: str) -> str:
    return f"guide_{name}"

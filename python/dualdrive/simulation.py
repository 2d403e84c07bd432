"""simulate(machine, motion) -> Run: the core's integrator with the machine's own defaults."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualdrive import _core
from dualdrive.machine import Machine, MachineError
from dualdrive.memory import excess, room
from dualdrive.motion import Motion, default_motion
from dualdrive.recorder import AsRecorded, delays, own_paths, reading_times
from dualdrive.run import Run

__all__ = ["Signal", "driven", "simulate", "usual_step"]

Array = NDArray[np.float64]

_MOST = 10**6  # samples of a run, unless more were asked for: half a gigabyte of a dual drive
_WORK = 8  # numbers a sample that the balance of energy and the modes take besides the signals

#: what an input may be: a signal, a motion, a constant, or (times, values)
Signal = _core.Waveform | Motion | float | tuple[ArrayLike, ArrayLike]


def simulate(
    machine: Machine,
    motion: Motion | None = None,
    *,
    end: float | None = None,
    load: Signal | None = None,
    inputs: Mapping[str, Signal] | None = None,
    signals: Sequence[str] | None = None,
    initial: Mapping[str, float] | None = None,
    sensitivities: Sequence[str] = (),
    gradient: Sequence[str] = (),
    start: float = 0.0,
    output_step: float | None = None,
    times: ArrayLike | None = None,
    engine: str = "auto",
    rtol: float | None = None,
    method: str = "auto",
    longest_step: float = 0.0,
    max_steps: int | None = None,
    energy: bool = True,
) -> Run:
    """Integrate the machine through a motion, every switch located.

    motion:         of the table; default: a move scaled to the machine (none without controller)
    end:            s; default: the motion's own end
    load:           torque on the table that opposes positive motion, N·m (N on a linear axis);
                    a plain 0 is none, to the same bits
    inputs:         further inputs by name: U_n or T_n of a machine without controller, columns
                    that a formula reads
    signals:        names to record; default: all
    initial:        state -> value; all others are 0
    sensitivities:  parameter paths, groups or initial.<state>: forward, d signal / d parameter
    gradient:       the same, backward: Run.gradient then gives d cost / d parameter of any cost of
                    the signals for about the price of one more run or two; exact engine, and the
                    exponential one for laws that are not affine
    times:          output times in s, increasing; else every output_step from start to end
    output_step:    s; unless given `usual_step`
    engine:         exact (between switches; every effect affine in its modes), exponential (other
                    effects that are not stiff), explicit, cvode, or auto, which takes exact
                    wherever it can, else the cheapest (docs/theory/engines.md)
    rtol, method:   of all but exact; a method (adams, bdf) asks for cvode

    A channel that an effect sits at (``quantisation@theta_m``) comes out as the recorder writes it.

    Returns a Run; a failed integration is a Run whose status says so, with all that was computed.
    Raises MachineError (a ValueError) for input that makes no sense, KeyboardInterrupt on Ctrl-C.
    """
    motion, given = driven(machine, motion, load, inputs)
    points = [] if times is None else np.asarray(times, float).tolist()
    if end is None:
        end = points[-1] if points else _end_of(motion)
    if output_step is None:
        output_step = usual_step(end - start)
    late = delays(machine.core)
    width = (1 + len(signals or machine.core.signals())) * (1 + len(sensitivities))
    width += _WORK if energy else 0
    _refuse_excess(machine, len(points), end - start, output_step, width)
    if signals:
        late = {name: delay for name, delay in late.items() if name in signals}
    own = own_paths(machine.core, sensitivities)
    if late and gradient:
        raise MachineError(
            f"{machine.name}: gradient: {', '.join(late)} is written by a recorder, which has no "
            "way back; ask for sensitivities, or take its effects out of the machine"
        )
    outputs = _outputs(points, start, end, output_step) if late or own else np.empty(0)
    if any(late.values()):
        points = reading_times(outputs, late, start).tolist()
    options: dict[str, Any] = {}
    if rtol is not None:
        options["rtol"] = rtol
    if max_steps is not None:
        options["max_steps"] = max_steps
    try:
        trajectory = _core.simulate(
            machine.core,
            given,
            end=end,
            start=start,
            output_step=output_step,
            times=points,
            engine=engine,
            method=method,
            longest_step=longest_step,
            signals=list(signals or []),
            sensitivities=[path for path in sensitivities if path not in own],
            gradient=list(gradient),
            initial=dict(initial or {}),
            energy=energy,
            **options,
        )
    except ValueError as error:
        raise MachineError(f"{machine.name}: {error}") from None
    seen = (
        AsRecorded(machine.core, trajectory, outputs, late, sensitivities)
        if late or own
        else trajectory
    )
    return Run.of(seen, machine.copy(), motion)


def usual_step(duration: float) -> float:
    """Time between the samples of a run of so many seconds, where nobody asked for another.

    1 ms, which shows what the drives do; in a run beyond a quarter of an hour the next of 1, 2, 5
    that keeps it to a million samples. The integration does not depend on it.
    """
    plain = 1e-3
    long = math.isfinite(duration) and duration > _MOST * plain
    return _round_up(duration / _MOST) if long else plain


def _refuse_excess(
    machine: Machine, points: int, duration: float, output_step: float, width: int
) -> None:
    """Raise MachineError where the samples of a run, `width` numbers each, would not fit."""
    if not points and not (math.isfinite(duration) and output_step > 0):
        return  # the core says what is wrong with them
    rows = points or duration / output_step
    size = np.dtype(np.float64).itemsize * width
    if too_much := excess(rows * size):
        step = _round_up(duration / (room() / size))
        way_out = f"--output-step {step:g}s (output_step = {step:g}) would do, or fewer signals"
        rule = f"{rows:.3g} samples of {width} numbers: {too_much}"
        raise MachineError(f"{machine.name}: {rule}; {way_out}")


def _round_up(value: float) -> float:
    """The next of 1, 2, 5, 10, ... times a power of ten."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(power * digit for digit in (1, 2, 5, 10) if power * digit >= value)


def _outputs(points: Sequence[float], start: float, end: float, step: float) -> Array:
    """The output times that were asked for, as the core lays them out."""
    if points:
        return np.array(points, float)
    rows = math.floor((end - start) / step * (1 + 1e-12)) + 1 if step > 0 else 0
    return start + step * np.arange(rows, dtype=float)


def driven(
    machine: Machine,
    motion: Motion | None,
    load: Signal | None,
    inputs: Mapping[str, Signal] | None,
) -> tuple[Motion | None, dict[str, _core.Waveform]]:
    """The motion that is made, and every input as the core takes it. See `simulate`."""
    given = {name: _waveform(value) for name, value in (inputs or {}).items()}
    controlled = machine.core.controller_options["kind"] != "none"
    if motion is None and controlled and "theta_ref" not in given:
        motion = default_motion(machine)
    if motion is not None:
        given["theta_ref"] = motion.waveform
    if load is not None and not _is_zero(load):
        given["T_load"] = _waveform(load)
    return motion, given


def _is_zero(load: Signal) -> bool:
    """Whether there is no load at all.

    As an input it would be one more column of the engines' matrices, whose other rounding shows in
    the last digits of every signal.
    """
    return isinstance(load, (int, float)) and load == 0


def _end_of(motion: Motion | None) -> float:
    if motion is None:
        raise ValueError("end: missing; without a motion nothing says when to stop, give end=")
    return motion.end


def _waveform(value: Signal) -> _core.Waveform:
    if isinstance(value, _core.Waveform):
        return value
    if isinstance(value, Motion):
        return value.waveform
    if isinstance(value, tuple):
        times, values = value
        return _core.sampled(times, values, _core.Interpolation.linear)
    return _core.constant(float(value))

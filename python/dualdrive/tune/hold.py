"""A tension with which the table stands still after steps and reversals, or what forbids one.

Two ways out of hunting, in this order: more tension, up to the rated torque; then less position
gain, at the tension found and at the rated torque. Where neither helps the procedure says which
trial fails, at which tension and gain, so that anyone can repeat it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dualdrive.linear.contacts import closed
from dualdrive.linear.operating_point import operating_point
from dualdrive.linear.stability import worst_pole
from dualdrive.machine import Machine
from dualdrive.motion import Motion
from dualdrive.tune.edge import GAIN
from dualdrive.tune.standstill import LOADS, Restless, Trial, restless, trials
from dualdrive.units import human

__all__ = ["Held", "hold"]

TENSION = "controller.T_ten"
_REACH = "controller.Omega_E"
_FINER = 1.25  # from one tension to the next
_RESERVE = 1.1  # on a tension that had to be raised
_LOWER, _TIMES = 0.8, 10  # position gain, and how often


@dataclass(frozen=True)
class Held:
    """What was found.

    machine: the changed copy, or the one that was given where nothing holds
    done:    what was done, one line each
    failure: the trial that fails in spite of it; None where the table stands still
    reason:  what forbids it, in words; empty where it stands still
    """

    machine: Machine
    done: tuple[str, ...]
    failure: Restless | None = None
    reason: str = ""


def hold(machine: Machine, motion: Motion) -> Held:
    """Raise the tension, then lower the position gain, until the table stands still."""
    tests = trials(machine, motion)
    first = _fails(machine, motion, tests)
    count = len(tests)
    still = f"stands still after {count} steps and reversals, at its load and 20 % either way"
    if first is None:
        return Held(machine, (still,))
    most = machine.get("motor_1.T_rated")
    known = [first.trial, *(test for test in tests if test is not first.trial)]  # it fails first
    for gain in machine.get(GAIN) * _LOWER ** np.arange(_TIMES + 1):
        for tension in _tensions(machine.get(TENSION), most, fine=gain == machine.get(GAIN)):
            trial = _with(machine, float(gain), tension)
            if _fails(trial, motion, known) is None:
                return _found(machine, trial, motion, known, first, still)
    last = _with(machine, machine.get(GAIN), most)
    failure = _fails(last, motion, known) or first
    return Held(machine, (), failure, _forbids(machine, last, failure))


def _fails(machine: Machine, motion: Motion, tests: Sequence[Trial]) -> Restless | None:
    """The first trial that fails; one without a run where a vibration grows while it turns."""
    for load in LOADS:
        other = machine.copy()
        other.core.set("table.J", load * machine.get("table.J"))
        pole = worst_pole(other, closed(other), operating_point(other, motion))
        if pole.real >= 0.0:
            growing = next(test for test in tests if test.load == load)
            hertz = abs(pole.imag) / (2 * np.pi)
            return Restless(growing, np.inf, hertz, machine.unit_of("e", "rad"))
    return restless(machine, tests)


def _tensions(now: float, most: float, *, fine: bool) -> list[float]:
    """Tensions to try, rising: all with the gain as it is, the first and last with a lower one."""
    if not fine:
        return [*dict.fromkeys((now, most))]
    ladder = [now]
    while ladder[-1] * _FINER < most and ladder[-1] > 0.0:
        ladder.append(ladder[-1] * _FINER)
    return [*(ladder or [most]), most]


def _with(machine: Machine, gain: float, tension: float) -> Machine:
    """A copy with this gain and tension; the equaliser's limit leaves room for the tension."""
    other = machine.copy()
    core = other.core
    before = core.get(TENSION)
    core.set(GAIN, gain)
    core.set(TENSION, tension)
    if before > 0.0 and np.isfinite(core.get(_REACH)) and tension > before:
        core.set(_REACH, core.get(_REACH) * tension / before)
    return other


def _found(
    machine: Machine,
    trial: Machine,
    motion: Motion,
    tests: Sequence[Trial],
    first: Restless,
    still: str,
) -> Held:
    """With a reserve on a raised tension, where that holds too."""
    done = [first.text]
    tension, gain = trial.get(TENSION), trial.get(GAIN)
    if tension > machine.get(TENSION):
        more = min(_RESERVE * tension, machine.get("motor_1.T_rated"))
        wider = _with(machine, gain, more)
        if _fails(wider, motion, tests) is None:
            trial, tension = wider, more
        done.append(f"tension raised to {human(tension, 'N*m')}")
    if gain < machine.get(GAIN):
        done.append(f"no tension holds it: position gain lowered to {human(gain, '1/s')}")
    return Held(trial, (*done, still))


def _forbids(machine: Machine, last: Machine, failure: Restless) -> str:
    """What stands against more tension or less gain, as far as it can be told."""
    tension, gain = last.get(TENSION), machine.get(GAIN)
    slowest = _LOWER**_TIMES * gain
    limits = []
    for n in (1, 2):
        if last.get(f"motor_{n}.T_max") < 1.2 * tension:
            limits.append(f"motor_{n}.T_max {human(last.get(f'motor_{n}.T_max'), 'N*m')}")
    why = f"; {', '.join(limits)} leaves no torque beside such a tension" if limits else ""
    return (
        f"{failure.text}, at every tension up to the rated torque, {human(tension, 'N*m')}, and "
        f"every position gain from {human(gain, '1/s')} down to {human(slowest, '1/s')}{why}"
    )

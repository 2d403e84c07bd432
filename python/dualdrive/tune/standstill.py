"""Whether a table stands still after steps and reversals, at its load and near it.

A gentle move ends at rest where friction holds the table; a small step or a reversal may leave the
same machine hunting from flank to flank for ever. So a machine counts as tuned only where it comes
to rest after steps of 0.1 to 1 mrad and after reversals at three speeds, with the inertia it was
tuned for and with a fifth more and less. All of it is simulated, with every gap and all friction.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from dualdrive.machine import Machine
from dualdrive.motion import Motion, cycle, default_motion, step
from dualdrive.run import Run
from dualdrive.simulation import simulate
from dualdrive.tune.assess import begin_of, play
from dualdrive.units import human

__all__ = ["LOADS", "Restless", "Trial", "restless", "trials"]

#: times the table's inertia
LOADS: Final = (1.0, 0.8, 1.2)
#: rad (m): of the steps
STEPS: Final = (1e-4, 3e-4, 1e-3)
#: of the test move's speed: of the reversals
SPEEDS: Final = (0.05, 0.3, 1.0)

_STEP_IN: Final = {"rad": "mrad", "m": "mm"}
_STILL = 0.02  # of the play: less is no hunting from flank to flank
_LEAST = 1e-9  # rad, where there is no play
_LONGER = 4.0  # times: a motion that dies out is given that much more rest before it is judged
_DIVERGED = "not_finite"  # the one status of a failed run that speaks of the loop
_RESTS, _LAGS = 2.0, 20.0  # times the usual time to settle, times the slowest integral


@dataclass(frozen=True)
class Trial:
    """A motion at a load: times the table's inertia."""

    text: str
    motion: Motion
    load: float

    def on(self, machine: Machine, *, engine: str = "auto") -> Run:
        """The trial simulated; where that engine can't settle a friction, by the explicit one."""
        loaded = _loaded(machine, self.load)
        run = simulate(loaded, self.motion, energy=False, engine=engine)
        if run.status == "chattering":  # the engine's end, not the loop's
            run = simulate(loaded, self.motion, energy=False, engine="explicit")
        return run


@dataclass(frozen=True)
class Restless:
    """A trial after which the table does not stand still.

    size:    peak to peak of the following error at rest, rad or m; inf where the run fails
    hertz:   of it; 0 where nothing turns back
    stopped: what ended the run, where that tells nothing of the loop
    """

    trial: Trial
    size: float
    hertz: float
    unit: str
    stopped: str = ""

    @property
    def text(self) -> str:
        """One line in words."""
        load = {1.0: "", 0.8: " with 20 % less inertia", 1.2: " with 20 % more inertia"}
        where = f"after {self.trial.text}{load.get(self.trial.load, '')}"
        if self.stopped:
            return f"{where} the simulation ends early: {self.stopped}"
        if not math.isfinite(self.size):
            return f"{where} the loop is unstable"
        rate = f" at {self.hertz:.2g} Hz" if self.hertz else ""
        return f"{where} the table hunts, {human(self.size, self.unit)} peak to peak{rate}"

    def figures(self) -> dict[str, Any]:
        """What repeats it: plain numbers for JSON, SI."""
        return {
            "motion": self.trial.motion.text,
            "inertia": self.trial.load,
            "peak_to_peak": self.size if math.isfinite(self.size) else None,
            "frequency_hz": self.hertz,
        }


def restless(machine: Machine, tests: Sequence[Trial], *, engine: str = "auto") -> Restless | None:
    """The first trial after which the table does not stand still; None where it always does."""
    limit = max(_STILL * play(machine), _LEAST)
    for trial in tests:
        run = trial.on(machine, engine=engine)
        size, hertz = _left(run, trial)
        if limit < size < math.inf:  # hunting stays, settling does not
            later = _longer(trial)
            run = later.on(machine, engine=engine)
            size, hertz = _left(run, later)
        if size > limit:
            stopped = "" if run.ok or run.status == _DIVERGED else run.message
            return Restless(trial, size, hertz, machine.unit_of("e", "rad"), stopped)
    return None


def trials(
    machine: Machine,
    motion: Motion,
    *,
    loads: Sequence[float] = LOADS,
    steps: Sequence[float] = STEPS,
    speeds: Sequence[float] = SPEEDS,
) -> list[Trial]:
    """Steps and reversals at each load; their pace is that of the machine and of its test move.

    steps:   rad (m);  speeds: of the test move's;  loads: times the table's inertia
    """
    lags = [machine.get(f"controller.{name}") for name in ("T_E", "T_N", "tau_t")]
    settle = max(_RESTS * default_motion(machine).arguments["settle"], _LAGS * max(lags))
    begin = max(begin_of(motion), default_motion(machine).arguments["start"])
    unit = machine.unit_of("e", "rad")
    found = [
        (f"a step of {human(size, unit, prefer=_STEP_IN[unit])}", step(size, begin, settle))
        for size in steps
    ]
    found += list(_reversals(machine, motion, speeds, begin, settle))
    return [Trial(text, one, load) for load in loads for text, one in found]


def _reversals(
    machine: Machine, motion: Motion, speeds: Sequence[float], begin: float, settle: float
) -> Iterator[tuple[str, Motion]]:
    """There and back without a rest between, far enough to reach the speed."""
    usual = dict(default_motion(machine).arguments)
    usual |= {k: v for k, v in motion.arguments.items() if k in ("v", "a", "j")}
    a, j = usual["a"], usual["j"]
    for share in speeds:
        v = share * usual["v"]
        rise = v / a + (a / j if math.isfinite(j) else 0.0)
        way = {"targets": [2.0 * v * rise, 0.0], "v": v, "a": a, "j": j, "dwell": 0.0}
        there = cycle(**way, start=begin).waveform.end()
        words = human(v, f"{machine.unit_of('e', 'rad')}/s")
        yield f"a reversal at {words}", cycle(**way, start=begin, end=there + settle)


def _loaded(machine: Machine, factor: float) -> Machine:
    if factor == 1.0:
        return machine
    other = machine.copy()
    other.core.set("table.J", factor * machine.get("table.J"))
    return other


def _left(run: Run, trial: Trial) -> tuple[float, float]:
    """Peak to peak of the following error in the second half of the rest, and its frequency."""
    if not run.ok:
        return math.inf, 0.0
    rest = trial.motion.waveform.end()
    rest = rest if math.isfinite(rest) else trial.motion.arguments["at"]
    late = run.t >= (rest + run.t[-1]) / 2.0
    e, t = run["e"][late], run.t[late]
    swing = e - e.mean()
    rising = np.flatnonzero((swing[:-1] < 0.0) & (swing[1:] >= 0.0))
    hertz = (rising.size - 1) / (t[rising[-1]] - t[rising[0]]) if rising.size > 1 else 0.0
    return float(np.ptp(e)), float(hertz)


def _longer(trial: Trial) -> Trial:
    """The same trial with more rest after it."""
    motion = trial.motion
    end = motion.waveform.end()
    end = end if math.isfinite(end) else motion.arguments["at"]
    more = end + _LONGER * (motion.end - end)
    again: dict[str, Any] = {**motion.arguments, "end": more}
    longer = step(**again) if motion.kind == "step" else cycle(**again)
    return Trial(trial.text, longer, trial.load)

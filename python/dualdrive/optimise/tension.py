"""The least tension that keeps every flank closed over a duty cycle, at all corners."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dualdrive.machine import Machine
from dualdrive.motion import Motion
from dualdrive.optimise.duty import duty_cycle
from dualdrive.optimise.errors import OptimiseError, refuse_all_but_two_drives
from dualdrive.optimise.objective import TENSION, Design, Progress, evaluate
from dualdrive.optimise.worst_case import Corner, corners
from dualdrive.units import human

__all__ = ["LeastTension", "least_tension"]

_GRID = 21
_FINE = 1e-3  # of the highest tension that is tried


@dataclass(frozen=True, eq=False)
class LeastTension:
    """What was found.

    tension:  N*m, the difference of motor torques; None where no tension within reach is enough
    reason:   one line: what limits it, or why there is none
    designs:  everything that was tried, by rising tension
    cases:    at these corners
    """

    tension: float | None
    reason: str
    designs: tuple[Design, ...]
    cases: tuple[Corner, ...]
    motion: Motion

    @property
    def best(self) -> Design | None:
        """The design at that tension."""
        found = [d for d in self.designs if d.values[TENSION] == self.tension]
        return found[0] if found else None


def least_tension(
    machine: Machine,
    motion: Motion | None = None,
    *,
    cases: Sequence[Corner] | None = None,
    most: float | None = None,
    progress: Progress | None = None,
) -> LeastTension:
    """Search the least tension at which no flank opens from the first command on.

    motion:  duty cycle; default: `duty_cycle` of the machine. The tension builds up before its
             first command
    cases:   corners to hold at; default: `corners` of the machine
    most:    highest tension to try, N*m; default: the rated torque, MD37264 = 100 %

    A grid first, since a flank may open again where too much tension meets a torque limit; then
    halving below the first value from which all higher ones hold as well, or the first that holds.
    Raises OptimiseError for a machine without two drives and where the loop is unstable.
    """
    refuse_all_but_two_drives(machine)
    motion = duty_cycle(machine) if motion is None else motion
    cases = list(corners(machine) if cases is None else cases)
    most = machine.get("motor_1.T_rated") if most is None else most
    if not (np.isfinite(most) and most > 0):
        raise OptimiseError(
            f"{machine.name}: motor_1.T_rated = {most}: tension has no upper end to try; give most"
        )

    def tried(tensions: Sequence[float]) -> list[Design]:
        return evaluate(machine, motion, [{TENSION: t} for t in tensions], cases, progress)

    designs = tried(np.linspace(0.0, most, _GRID).tolist())
    refuse_unstable(machine, designs)
    holds = [design.apart for design in designs]
    if not any(holds):
        return LeastTension(None, _why_none(designs, most), tuple(designs), tuple(cases), motion)
    first = holds.index(True)
    low, high = designs[first - 1].values[TENSION], designs[first].values[TENSION]
    while high - low > _FINE * most:
        (middle,) = tried([(low + high) / 2])
        designs.append(middle)
        low, high = (low, middle.values[TENSION]) if middle.apart else (
            middle.values[TENSION], high
        )  # fmt: skip
    designs.sort(key=lambda design: design.values[TENSION])
    best = next(d for d in designs if d.values[TENSION] == high)
    reason = f"a flank opens below {human(high, 'N*m')} at {best.worst}"
    if not all(d.apart for d in designs if d.values[TENSION] > high):
        reason += "; one opens again at higher tension, where a limit is met"
    return LeastTension(high, reason, tuple(designs), tuple(cases), motion)


def refuse_unstable(machine: Machine, designs: Sequence[Design]) -> None:
    """No number is given where every loop is unstable. Raises OptimiseError."""
    if any(design.known for design in designs):
        return
    worst = max(designs, key=lambda design: design.growth)
    if worst.growth < 0.0:
        raise OptimiseError(f"{machine.name}: no run came to its end: {worst.note}")
    what = f"with all flanks closed a vibration grows by exp({worst.growth:.3g} t/s)"
    raise OptimiseError(
        f"{machine.name}: the loop is unstable at {worst.worst}: {what}; lower controller.K_v, or "
        "let dualdrive tune set it"
    )


def _why_none(designs: Sequence[Design], most: float) -> str:
    last = designs[-1]
    return (
        f"a flank opens at every tension up to {human(most, 'N*m')}, first at {last.worst}; move "
        "with less acceleration or jerk"
    )

"""python -m tests.adversary.metamorphic [--machines N] [--seed N]

Random machines with everything a machine may have, each run twice in ways between which theory
knows the difference: no expected number is needed. A run that must be the same is compared to the
last bit; one that rounding may change, by what rounding does to it: where inputs that are
changed by 1e-15 part a run further from itself, it is too sensitive to tell anything, and not counted.
"""

from __future__ import annotations

import argparse
import pickle
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "py"))

from core_random import RandomMachine
from dualdrive import _core

Array = NDArray[np.float64]

END = 0.4  # s, a whole number of output steps, of which half is one, too
STEP = 1e-3
NEAR = 1e-6  # of a signal's peak, and so many times what a change of the inputs by 1e-15 does
MOVED, MANY = 1e-15, 1e3
USEFUL = 1e-2  # a difference that may be larger tells nothing
HEAVIER = 4.0  # a power of two, so that no product is rounded
STEPS = 200_000  # of a solver; a stiffer machine is left out


def run(
    case: RandomMachine, machine: _core.Machine | None = None, **other: object
) -> _core.Trajectory:
    """The machine's own run, or what differs from it."""
    told = {"end": END, "output_step": STEP, "initial": case.initial, "max_steps": STEPS, **other}
    inputs = told.pop("inputs", case.inputs)
    return _core.simulate(machine or case.machine, inputs, energy=False, **told)  # type: ignore[arg-type]


# --- the same to the last bit -------------------------------------------------------------------


def again(case: RandomMachine, known: _core.Trajectory) -> float:
    """A machine that was packed, sent and unpacked."""
    other = run(case, pickle.loads(pickle.dumps(case.machine)))
    return _bits(known.values, other.values)


def fewer(case: RandomMachine, known: _core.Trajectory) -> float:
    """One signal alone."""
    name = known.names[-1]
    return _bits(known.values[:, -1:], run(case, signals=[name]).values)


# --- the same but for rounding ------------------------------------------------------------------


def no_load(case: RandomMachine, known: _core.Trajectory) -> float:
    """A load of nothing, which an engine carries along; `dualdrive.simulate` leaves it out."""
    without = {name: wave for name, wave in case.inputs.items() if name != "T_load"}
    bare = run(case, inputs=without)
    nothing = {**without, "T_load": _core.constant(0.0)}
    return _apart(bare, run(case, inputs=nothing, signals=bare.names).values)


def longer(case: RandomMachine, known: _core.Trajectory) -> float:
    """What comes later changes nothing before."""
    other = run(case, end=1.5 * END)
    return _apart(known, other.values[: len(known.values)])


def finer(case: RandomMachine, known: _core.Trajectory) -> float:
    """Looked at four times as often."""
    return _apart(known, run(case, output_step=STEP / 4).values[::4])


def heavier(case: RandomMachine, known: _core.Trajectory) -> float:
    """Every torque, inertia and stiffness four times as large: the same motion and currents."""
    machine = case.machine.copy()
    for number in machine.parameters():
        if power := _masses(number.unit):
            machine.set(number.path, machine.get(number.path) * HEAVIER**power)
    inputs = {**case.inputs, "T_load": case.inputs["T_load"] * HEAVIER}
    return _apart(known, run(case, machine, inputs=inputs).values)


def in_two(case: RandomMachine, known: _core.Trajectory) -> float:
    """Ended half-way and begun there."""
    half = run(case, end=END / 2)
    start = dict(zip(half.state_names, half.final_state.tolist(), strict=True))
    other = run(case, start=END / 2, initial=start)
    return _apart(known, other.values, first=len(known.values) - len(other.values))


RELATIONS: Final[dict[str, Callable[[RandomMachine, _core.Trajectory], float]]] = {
    "packed and unpacked": again,
    "one signal alone": fewer,
    "a load of nothing": no_load,
    "a longer run": longer,
    "a finer output": finer,
    "four times as heavy": heavier,
    "run in two parts": in_two,
}
EXACT = (again, fewer)


def main() -> int:
    """Check every relation on every machine; 1 where one is broken."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.adversary.metamorphic", description=__doc__
    )
    parser.add_argument("--machines", type=int, default=150)
    parser.add_argument("--seed", type=int, default=1, help="of the first machine")
    given = parser.parse_args()
    checks, broken = dict.fromkeys(RELATIONS, 0), dict.fromkeys(RELATIONS, 0)
    for seed in range(given.seed, given.seed + given.machines):
        for name, ok in checked(seed):
            checks[name] += 1
            broken[name] += not ok
            if not ok:
                print(f"    {name}: {', '.join(RandomMachine(seed).notes)}", flush=True)
    print(f"{'relation':<20} {'checks':>6} {'broken':>6}")
    for name, count in (*checks.items(), ("all", sum(checks.values()))):
        print(f"{name:<20} {count:>6} {broken.get(name, sum(broken.values())):>6}")
    return int(any(broken.values()))


def checked(seed: int) -> Iterator[tuple[str, bool]]:
    """Which relations apply to a machine, and whether they hold."""
    case = RandomMachine(seed)
    known = run(case)
    if known.status != "success":
        return
    trembles = _apart(known, run(case, inputs=_moved(case)).values)
    for name, off in RELATIONS.items():
        allowed = 0.0 if off in EXACT else max(NEAR, MANY * trembles)
        if allowed > USEFUL or (off is in_two and _remembers(case)):
            continue
        yield name, off(case, known) <= allowed


# --- how far apart ------------------------------------------------------------------------------


def _moved(case: RandomMachine) -> dict[str, _core.Waveform]:
    size = {"theta_ref": case.scale.move[0], "T_load": case.scale.load}
    return {n: wave + _core.sine(MOVED * size[n], 3.0) for n, wave in case.inputs.items()}


def _remembers(case: RandomMachine) -> bool:
    """Whether it holds more than its states: samples, and what is on its way through a delay."""
    waits = ("_sample", "_latency", "delta_t")
    return any(
        number.path.endswith(waits) and case.machine.get(number.path) > 0.0
        for number in case.machine.parameters()
    ) or any("delay" in e["effect"] or e["effect"] == "dead_time" for e in case.machine.effects)


def _bits(one: Array, other: Array) -> float:
    return 0.0 if one.tobytes() == other.tobytes() else np.inf


def _apart(known: _core.Trajectory, other: Array, first: int = 0) -> float:
    """The largest difference of any angle or current, of its own peak."""
    compared = [
        k
        for k, (name, unit) in enumerate(zip(known.names, known.units, strict=True))
        if unit in ("rad", "A") and not name.startswith("in.")
    ]
    own, found = known.values[:, compared], other[:, compared]
    peak = np.max(np.abs(own), axis=0) + 1e-12
    return float(np.max(np.abs(own[first:] - found) / peak))


def _masses(unit: str) -> int:
    """How often a unit holds that of mass: 1 of torque, inertia and stiffness, -1 of compliance."""
    above, _, below = unit.partition("/")
    return sum(
        sign * len(re.findall(r"\b(?:N|kg|J)\b", part)) for sign, part in ((1, above), (-1, below))
    )


if __name__ == "__main__":
    raise SystemExit(main())

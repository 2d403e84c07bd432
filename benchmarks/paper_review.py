"""What a review of the paper's page saw, measured again: the dwell, the encoder, and hunting.

    python benchmarks/paper_review.py

Presets as they are, eight targets, two cycles, position loop every 4 ms, read over the last 0.2 s
of the dwell where the table moves by less than 1 arc second; no error budget, no quantisation.
Then the empty table and the 100 t with the tension that one gentle move asks for, as presets, and
as `tune` leaves them, after steps and reversals. docs/paper-review.md shows what it prints.
"""

from __future__ import annotations

import math

import numpy as np

from dualdrive.indexing import IndexingError, cycle_for, measure
from dualdrive.indexing.printed import LOADS, loaded
from dualdrive.machine import Machine
from dualdrive.tune import tune
from dualdrive.tune.assess import usual_motion
from dualdrive.tune.standstill import restless, trials

PAIR = ("heavy-table-double-pinion", "heavy-table-dual-servo")
TARGETS = np.arange(8) * math.pi / 4


def read(train: str, load: str, sensor: str, dwell: float) -> str:
    """A, R and B in arc seconds, or that the table moves while it is read."""
    machine = loaded(train, load)
    core = machine.core
    core.set_controller(**{**core.controller_options, "position_sensor": sensor})
    test = cycle_for(machine, TARGETS, repeats=2, dwell=dwell, window=0.2, v=0.05, a=0.01, j=0.05)
    try:
        found = measure(machine, test).figures()
    except IndexingError:
        return "moves"
    return "/".join(f"{math.degrees(float(found[n] or 0.0)) * 3600:.2f}" for n in "ARB")


def contrasts() -> None:
    """A/R/B, traditional and two motors, by encoder, load and dwell."""
    print("encoder  dwell  load    traditional A/R/B   two motors A/R/B, arcsec")
    for sensor in ("table", "motor"):
        for dwell in (1.0, 1.5, 3.0, 5.0):
            for load in LOADS:
                seen = (read(train, load, sensor, dwell) for train in PAIR)
                print(f"{sensor:8} {dwell:3g} s  {load:6}", *(f"{s:>19}" for s in seen), flush=True)


def after(machine: Machine) -> str:
    """What is left after steps and reversals, at three loads."""
    found = restless(machine, trials(machine, usual_motion(machine)))
    return "stands still" if found is None else found.text


def hunting() -> None:
    """A gentle move's tension, the presets, and what `tune` leaves."""
    for load in ("empty", "100t"):
        preset = Machine.load(LOADS[load])
        done = tune(preset)
        gentle = done.machine.copy()
        gentle.set("controller.T_ten", done.steps[6].details["least_tension"] * 1.1)
        print(f"{load}, preset, {preset.get('controller.T_ten'):.3g} N m: {after(preset)}")
        for name, machine in (("a gentle move's tension", gentle), ("tuned", done.machine)):
            print(f"{load}, {name}, {machine.get('controller.T_ten'):.3g} N m: {after(machine)}")


if __name__ == "__main__":
    contrasts()
    hunting()

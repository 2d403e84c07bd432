"""Whether what `tune` leaves stands still: presets and random machines, judged by other trials.

    python benchmarks/tuning.py --machines 100
    python benchmarks/tuning.py --machines 60 --power 3    # far beyond what is built

Each machine is a preset with every number of its plant drawn anew (log-uniform), its tension taken
away; `tune` is given a gentle move. What it calls tuned is then pushed in ways it was not tuned by:
other steps, other speeds, other loads, by the CVODES engine. What it refuses for hunting is
simulated as its reason says. Prints a row per machine that fails, and the counts.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
from collections import Counter
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dualdrive.machine import Machine
from dualdrive.tune import TuneError, Tuning, tune
from dualdrive.tune.standstill import restless, trials

PRESETS = (
    "heavy-table-empty", "heavy-table-100t", "heavy-table-250t", "heavy-table-550t",
    "heavy-table-dual-servo", "bench",
)  # fmt: skip
#: path -> factor by which it may lie off the preset, either way
SPREAD: Mapping[str, float] = {
    "table.J": 2.0, "table.b": 2.0, "motors.J": 1.5, "pinions.J": 1.5, "pinions.b": 2.0,
    "meshes.stiffness": 2.0, "meshes.gap": 2.0, "gearboxes.stiffness": 2.0, "gearboxes.gap": 2.0,
    "controller.K_v": 2.0, "controller.k_p": 2.0, "controller.omega_ci": 1.5, "motors.T_max": 1.3,
    "mesh_damping@meshes.coefficient": 3.0, "coulomb@table.torque": 3.0,
    "coulomb@pinions.torque": 3.0,
}  # fmt: skip
#: the trials that tuned machines are judged by
OTHER = {"loads": (1.0, 0.85, 1.15), "steps": (2e-4, 7e-4, 1e-3), "speeds": (0.1, 0.5, 1.0)}


def machine(number: int, power: float = 1.0) -> Machine:
    """A random machine: the same for the same number; power: of the factors of `SPREAD`."""
    random = np.random.default_rng(number)
    found = Machine.load(PRESETS[number % len(PRESETS)])
    core = found.core
    for path, most in SPREAD.items():
        factor = most ** (power * random.uniform(-1.0, 1.0))
        try:
            if not core.unread(path):
                found.set(path, factor * core.get(path))
        except ValueError:
            continue  # no such part in this preset
    found.set("controller.T_ten", 0.0)
    found.name = f"{found.name} #{number}"
    return found


def judged(found: Machine) -> dict[str, Any]:
    """Tune a machine and judge what is left."""
    try:
        done = tune(found)
    except TuneError as error:
        return {"machine": found.name, "status": "error", "verdict": "error", "reason": str(error)}
    return {"machine": found.name, "status": done.status, "reason": done.reason, **_verdict(done)}


def _verdict(done: Tuning) -> dict[str, Any]:
    if done.status == "tuned":
        left = restless(done.machine, trials(done.machine, done.motion, **OTHER), engine="cvode")
        tension = done.machine.get("controller.T_ten")
        return {"verdict": "hunts" if left else "stands still", "left": left and left.text,
                "tension": tension}  # fmt: skip
    step = next((s for s in done.steps if s.status == "refused"), None)
    fails = step.details.get("restless") if step else None
    if fails is None:
        return {"verdict": f"refused at step {step.number if step else 8}"}
    (trial,) = [
        t for t in trials(done.machine, done.motion)
        if t.motion.text == fails["motion"] and t.load == fails["inertia"]
    ]  # fmt: skip
    seen = restless(done.machine, [trial], engine="cvode")
    return {"verdict": "refused, confirmed" if seen else "refused, not confirmed"}


def one(number: int, power: float = 1.0) -> dict[str, Any]:
    """A preset as it is, for the first numbers; a random machine after that."""
    if number < len(PRESETS):
        return judged(Machine.load(PRESETS[number]))
    return judged(machine(number - len(PRESETS), power))


def main() -> None:
    """Print rows and counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--machines", type=int, default=100)
    parser.add_argument("--power", type=float, default=1.0, help="of the factors drawn")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = []
    with multiprocessing.Pool(options.jobs) as pool:
        for row in pool.imap(
            partial(one, power=options.power), range(options.machines + len(PRESETS))
        ):
            rows.append(row)
            if row["verdict"] != "stands still":
                print(row["machine"], row["verdict"], row.get("left") or row["reason"], flush=True)
    presets, drawn = rows[: len(PRESETS)], rows[len(PRESETS) :]
    for name, part in (("presets", presets), ("random machines", drawn)):
        print(f"{name}: {len(part)}", dict(Counter(row["verdict"] for row in part)))
    if options.json:
        options.json.write_text(json.dumps(rows, indent=2))


if __name__ == "__main__":
    main()

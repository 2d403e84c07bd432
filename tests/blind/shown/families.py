"""Three families of two-motor tables, each a spread of machines; numbers by machine-file paths.

Beside those paths a machine has `mesh_damping`, `dry_table`, `dry_pinions`: the effects its sheet
states.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

Numbers = dict[str, float]
PARTS = ("motors", "gearboxes", "pinions", "meshes", "table", "controller")
FAMILIES: dict[str, dict[str, Any]] = tomllib.loads(
    Path(__file__).with_name("families.toml").read_text()
)

#: numbers of a data sheet that carry a tolerance, and its usual size (one sigma)
UNCERTAIN = {
    "table.J": 0.1,
    "motors.J": 0.1,
    "pinions.J": 0.1,
    "table.b": 0.5,
    "motors.b": 0.5,
    "pinions.b": 0.5,
    "meshes.stiffness": 0.2,
    "meshes.gap": 0.2,
    "mesh_damping": 0.5,
    "dry_table": 0.5,
    "dry_pinions": 0.5,
}
_SPREAD = {
    **dict.fromkeys(("table.J", "motors.J", "pinions.J"), 1.35),
    **dict.fromkeys(("table.b", "motors.b", "pinions.b"), 1.35),
    **dict.fromkeys(("meshes.stiffness", "meshes.gap", "mesh_damping"), 1.3),
    "controller.k_p": 1.2,
    "controller.K_v": 1.25,
    "controller.T_ten": 1.5,
}
_EFFECTS = (
    ("mesh_damping", "mesh_damping", "meshes", "coefficient"),
    ("dry_table", "coulomb", "table", "torque"),
    ("dry_pinions", "coulomb", "pinions", "torque"),
)


def usual(family: str) -> Numbers:
    """The middle of a family."""
    own = FAMILIES[family]
    numbers = {f"{part}.{key}": float(v) for part in PARTS for key, v in own[part].items()}
    return numbers | {"mesh_damping": float(own["damping"])}


def draw(family: str, rng: np.random.Generator) -> Numbers:
    """A machine of the family: sizes spread by a third either way, loops tuned to match."""
    middle = usual(family)
    numbers = {p: v * _SPREAD.get(p, 1.0) ** rng.uniform(-1, 1) for p, v in middle.items()}
    numbers["controller.k_p"] *= drive_inertia(numbers) / drive_inertia(middle)
    if rng.random() < 0.5:
        for part, torque in FAMILIES[family]["dry"].items():
            numbers["dry_" + part] = torque * 2 ** rng.uniform(-1, 1)
    if rng.random() < 0.2:  # a sampled drive, as real ones are
        numbers["controller.position_sample"] = float(rng.choice([1e-3, 2e-3]))
        numbers["controller.speed_sample"] = float(rng.choice([5e-4, 1e-3]))
    return {path: float(f"{value:.4g}") for path, value in numbers.items()}


def drift(numbers: Numbers, rng: np.random.Generator) -> Numbers:
    """The real machine: each uncertain number 5 to 10 % off, up or down."""
    off = {p: 1 + rng.choice([-1, 1]) * rng.uniform(0.05, 0.1) for p in UNCERTAIN}
    return {p: v * float(off.get(p, 1.0)) for p, v in numbers.items()}


def drive_inertia(numbers: Mapping[str, float]) -> float:
    """Motor and pinion in the pinion's frame."""
    return numbers["gearboxes.ratio"] ** 2 * numbers["motors.J"] + numbers["pinions.J"]


_WORDS = {
    "gearboxes.ratio": "i",
    "meshes.ratio": "i_m",
    "table.J": "J_m",
    "table.b": "b_m",
    "motors.J": "J_d",
    "pinions.J": "J_c",
    "motors.b": "b_d",
    "pinions.b": "b_c",
    "meshes.stiffness": "K_t",
    "meshes.gap": "gap",
    "mesh_damping": "c_t",
    "dry_table": "t_dry",
    "dry_pinions": "p_dry",
    **{f"motors.{key}": key for key in ("K_d", "C_e", "R", "L", "T_max", "T_rated", "U_max")},
}


def engine_numbers(machine: Mapping[str, float]) -> Numbers:
    """The same machine in the words of ``cpp/parameters.hpp``."""
    i, k_p = machine["gearboxes.ratio"], machine["controller.k_p"]
    numbers = {word: machine[path] for path, word in _WORDS.items() if path in machine}
    numbers |= {
        path.removeprefix("controller."): value
        for path, value in machine.items()
        if path.startswith("controller.") and path != "controller.g_E"
    }
    numbers["Omega_max"] = machine["motors.omega_max"] / i
    numbers["K_E"] = machine["controller.g_E"] * i / (2 * k_p)
    return numbers


def text(numbers: Mapping[str, float], name: str) -> str:
    """The machine file handed out."""
    kinds = {"motors": "armature", "gearboxes": "rigid", "meshes": "gap"}
    kinds["controller"] = "master_slave"
    lines = ["schema = 1", f'name = "{name}"', 'axis = "rotary"', 'drive_train = "dual_servo"']
    for part in PARTS:
        own = {p: v for p, v in numbers.items() if p.startswith(part + ".")}
        lines += ["", f"[{part}]"]
        lines += [f'kind = "{kinds[part]}"'] if part in kinds else []
        lines += [f"{path.split('.')[1]} = {value!r}" for path, value in own.items()]
    for key, effect, place, parameter in _EFFECTS:
        if key in numbers:
            lines += ["", "[[effects]]", f'effect = "{effect}"', f'place = "{place}"']
            lines += [f"{parameter} = {numbers[key]!r}"]
    return "\n".join(lines) + "\n"

"""Three families of two-motor tables, each a spread of machines; numbers by machine-file paths.

Beside those paths a machine has `mesh_damping`, `dry_table`, `dry_pinions`: the effects its sheet
states.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from tests.blind.generator.machines import UNCERTAIN, Numbers, drive_inertia

PARTS = ("motors", "gearboxes", "pinions", "meshes", "table", "controller")
FAMILIES: dict[str, dict[str, Any]] = tomllib.loads(
    Path(__file__).with_name("families.toml").read_text()
)

NUMBERS = [path for path in UNCERTAIN if path != "gearboxes.stiffness"]
_SPREAD = {
    **dict.fromkeys(("table.J", "motors.J", "pinions.J"), 1.35),
    **dict.fromkeys(("table.b", "motors.b", "pinions.b"), 1.35),
    **dict.fromkeys(("meshes.stiffness", "meshes.gap", "mesh_damping"), 1.3),
    "controller.k_p": 1.2,
    "controller.K_v": 1.25,
    "controller.T_ten": 1.5,
}


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
    off = {p: 1 + rng.choice([-1, 1]) * rng.uniform(0.05, 0.1) for p in NUMBERS}
    return {p: v * float(off.get(p, 1.0)) for p, v in numbers.items()}

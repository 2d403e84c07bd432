"""What no library has: causes whose right answer is "none of the above"."""

from __future__ import annotations

import numpy as np
from tests.blind.generator.effects import Hidden, Rng, Setting, UnfitError, phase

OUTSIDE: dict[str, float] = {
    "bouc_wen": 0.3,
    "maxwell_slip": 0.3,
    "softening_mesh": 2.0,
    "foundation": 0.5,
    "second_mass": 0.6,
    "motor_hum": 0.1,
    "chirp": 0.1,
    "motor_shove": 0.3,
    "cubic_damper": 0.8,
    "magnetic_spot": 0.3,
    "mesh_hysteresis": 0.3,
    "gain_drift": 0.3,
    "crosstalk": 0.3,
}


def draw(name: str, s: Setting, seed: int, share: float = 1.0) -> Hidden:
    """One of `OUTSIDE`, as `effects.draw` draws those of the library."""
    rng = np.random.default_rng(seed)
    a = share * OUTSIDE[name]
    numbers, place, equation = _LAWS[name](s, a, rng)
    return Hidden(name, place, equation, numbers, {"amplitude": a})


Law = tuple[dict[str, float], str, str]


def _natural(s: Setting) -> float:
    """Locked-rotor angular frequency of the table on its meshes, rad/s."""
    m = s.machine
    stiffness = m.get("drives", 2) * m["meshes.stiffness"]
    return float(m["meshes.ratio"] * np.sqrt(stiffness / m["table.J"]))


def _bouc_wen(s: Setting, a: float, rng: Rng) -> Law:
    """Hysteresis at the table that bends over a visible share of the travel."""
    length = s.travel * 10 ** rng.uniform(-2, -0.5)
    torque, beta = a * s.table_torque, float(rng.uniform(0.3, 0.8))
    return {"bouc": torque, "bouc_length": length, "bouc_beta": beta}, "table", "table"


def _maxwell_slip(s: Setting, a: float, rng: Rng) -> Law:
    """Four elements that slip one after the other."""
    length = s.travel * 10 ** rng.uniform(-1.5, -0.3)
    return {"maxwell": a * s.table_torque, "maxwell_length": length}, "table", "table"


def _softening_mesh(s: Setting, a: float, rng: Rng) -> Law:
    """A spring that gives way the more it is pushed."""
    return {"softening": a, "softening_scale": s.rated_deflection}, "meshes", "mesh"


def _foundation(s: Setting, a: float, rng: Rng) -> Law:
    """Motors stand on a block that gives: `a` is the table's inertia over the block's."""
    inertia = s.machine["table.J"] / a
    w = _natural(s) * float(rng.uniform(0.3, 0.8))
    damping = 2 * float(rng.uniform(0.02, 0.1)) * inertia * w
    return {"base_J": inertia, "base_k": inertia * w * w, "base_c": damping}, "table", "table"


def _second_mass(s: Setting, a: float, rng: Rng) -> Law:
    """A workpiece on soft blocks: `a` is its share of the table's inertia."""
    inertia = min(a, 0.7) * s.machine["table.J"]
    w = _natural(s) * float(rng.uniform(0.4, 1.2))
    damping = 2 * float(rng.uniform(0.02, 0.08)) * inertia * w
    return {"second_J": inertia, "second_k": inertia * w * w, "second_c": damping}, "table", "table"


def _motor_hum(s: Setting, a: float, rng: Rng) -> Law:
    numbers = {
        "disturbed": 1.0,
        "hum": a * s.motor_torque,
        "hum_frequency": float(rng.uniform(3, 15)),
    }
    return numbers | {"hum_phase": phase(rng)}, "motor_1", "drive"


def _chirp(s: Setting, a: float, rng: Rng) -> Law:
    start, slope = float(rng.uniform(2, 6)), float(rng.uniform(2, 5))
    numbers = {"hum": a * s.table_torque, "hum_frequency": start, "hum_slope": slope}
    return numbers | {"hum_phase": phase(rng)}, "table", "table"


def _motor_shove(s: Setting, a: float, rng: Rng) -> Law:
    """A brake that drags from the middle of the record on."""
    numbers = {"disturbed": 1.0, "shove": a * s.motor_torque, "shove_rise": 0.05}
    return numbers | {"shove_at": float(s.end * rng.uniform(0.3, 0.6))}, "motor_1", "drive"


def _cubic_damper(s: Setting, a: float, rng: Rng) -> Law:
    return {"cubic": a * s.table_torque / s.speed**3}, "table", "table"


def _magnetic_spot(s: Setting, a: float, rng: Rng) -> Law:
    spot = s.travel * float(rng.uniform(0.25, 0.75))
    width = s.travel * float(rng.uniform(0.03, 0.12))
    numbers = {"spot": a * s.table_torque, "spot_at": spot, "spot_width": width}
    return numbers, "table", "table"


def _mesh_hysteresis(s: Setting, a: float, rng: Rng) -> Law:
    length = float(rng.uniform(0.1, 0.5)) * s.machine["meshes.gap"]
    return {"hysteresis": a * s.pinion_torque, "hysteresis_length": length}, "meshes", "mesh"


def _gain_drift(s: Setting, a: float, rng: Rng) -> Law:
    """The recorded current of motor 1 grows in time by the share `a`; the loop does not see it."""
    return {"@gain": a}, "I_1", "sensors"


def _crosstalk(s: Setting, a: float, rng: Rng) -> Law:
    """The recorded current of motor 1 contains a share of motor 2's."""
    if s.drives == 1:
        raise UnfitError("nothing to pick up")
    return {"@cross": a}, "I_1", "sensors"


_LAWS = {name: globals()["_" + name] for name in OUTSIDE}

"""Hidden effects of meshes and gearboxes."""

from __future__ import annotations

import numpy as np
from tests.blind.generator.effects import Hidden, Rng, Setting, UnfitError, at, effect, phase, pick


def _rigid(s: Setting) -> None:
    """What makes a gearbox give is not hidden in one whose sheet says that it does."""
    if "gearboxes.stiffness" in s.machine:
        raise UnfitError("the gearbox gives already")


@effect(0.4)
def mesh_damping(s: Setting, a: float, rng: Rng) -> Hidden:
    """`a` is a damping ratio of the drive on its mesh."""
    m = s.machine
    inertia = m["gearboxes.ratio"] ** 2 * m["motors.J"] + m["pinions.J"]
    c = 2 * a * float(np.sqrt(m["meshes.stiffness"] * inertia))
    return Hidden(
        "mesh_damping", "meshes", "mesh", {"+c_t": c}, {"coefficient": c}, ("mesh_damping",)
    )


@effect(1.0)
def eccentricity(s: Setting, a: float, rng: Rng) -> Hidden:
    """`a` in units of half gap and rated deflection together."""
    place = pick(s, rng, "ring", "pinions", "pinion_1")
    amplitude, angle = a * (s.machine["meshes.gap"] + s.rated_deflection), phase(rng)
    if place == "ring":
        spacing = float(rng.uniform(0.5, np.pi))
        numbers = {"ring": amplitude, "ring_phase": angle, "ring_spacing": spacing}
        parameters = {"amplitude": amplitude, "phase": angle, "spacing": spacing}
        return Hidden("eccentricity", place, "mesh", numbers, parameters)
    key = "pinion" + at(place)
    return Hidden(
        "eccentricity",
        place,
        "mesh",
        {key: amplitude, f"pinion_phase{at(place)}": angle},
        {"amplitude": amplitude, "phase": angle},
    )


@effect(0.1)
def transmission_error(s: Setting, a: float, rng: Rng) -> Hidden:
    size = a * (s.machine["meshes.gap"] + s.rated_deflection)
    amplitude, teeth, angle = size, float(rng.integers(17, 26)), phase(rng)
    return Hidden(
        "transmission_error",
        "pinions",
        "mesh",
        {"tooth": amplitude, "tooth_order": teeth, "tooth_phase": angle},
        {"amplitude": amplitude, "teeth": teeth, "phase": angle},
    )


@effect(0.4)
def time_varying_mesh_stiffness(s: Setting, a: float, rng: Rng) -> Hidden:
    teeth, angle = float(rng.integers(17, 26)), phase(rng)
    return Hidden(
        "time_varying_mesh_stiffness",
        "pinions",
        "mesh",
        {"breathing": a, "breathing_order": teeth, "breathing_phase": angle},
        {"amplitude": a, "teeth": teeth, "phase": angle},
    )


@effect(2.0)
def hertzian_stiffness(s: Setting, a: float, rng: Rng) -> Hidden:
    overlap = s.rated_deflection
    return Hidden(
        "hertzian_stiffness",
        "meshes",
        "mesh",
        {"hertz": a, "hertz_scale": overlap},
        {"growth": a, "overlap": overlap},
    )


@effect(1.5)
def wear(s: Setting, a: float, rng: Rng) -> Hidden:
    depth = a * (s.machine["meshes.gap"] + s.rated_deflection)
    centre = float(s.travel * rng.uniform(0.2, 0.9))
    width = float(min(1.0, s.travel * rng.uniform(0.1, 0.4)))
    return Hidden(
        "wear",
        "table",
        "mesh",
        {"wear": depth, "wear_at": centre, "wear_width": width},
        {"depth": depth, "centre": centre, "width": width},
    )


@effect(1.0)
def gearbox_backlash(s: Setting, a: float, rng: Rng) -> Hidden:
    """`a` in units of the mesh's half gap; the gearbox is stiffer than the mesh."""
    _rigid(s)
    gap = a * (s.machine["meshes.gap"] + s.rated_deflection)
    stiffness = float(rng.uniform(1, 4)) * s.machine["meshes.stiffness"]
    numbers = {"chain": 1.0, "shaft_gap": gap, "shaft_k": stiffness}
    parameters = {"gap": gap, "stiffness": stiffness}
    return Hidden("gearbox_backlash", "gearboxes", "drive|mesh", numbers, parameters)


@effect(1.5)
def shaft_compliance(s: Setting, a: float, rng: Rng) -> Hidden:
    """`a`: how much softer the shaft is than the mesh."""
    _rigid(s)
    stiffness = s.machine["meshes.stiffness"] / a
    numbers = {"chain": 1.0, "shaft_k": stiffness}
    return Hidden("shaft_compliance", "gearboxes", "drive|mesh", numbers, {"stiffness": stiffness})

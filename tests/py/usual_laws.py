"""Laws that are not affine, each where it sits on a machine and at a size that is usual there."""

from __future__ import annotations

BOTH = ("motor_1", "motor_2")
PINIONS = ("pinion_1", "pinion_2")
MESHES = ("mesh_1", "mesh_2")

#: effect -> its places, its numbers, SI: of the bench
LAWS: dict[str, tuple[tuple[str, ...], dict[str, float]]] = {
    "stribeck": (("table",), {"torque": 0.1, "static_ratio": 1.3, "speed": 0.02}),
    "lugre": (
        ("table",),
        {"torque": 0.1, "static_ratio": 1.3, "speed": 0.02, "stiffness": 1e3, "damping": 1.0},
    ),
    "angle_dependent_friction": (("table",), {"torque": 0.05, "order": 7.0}),
    "load_dependent_mesh_loss": (PINIONS, {"fraction": 0.02}),
    "eccentricity": (("table",), {"amplitude": 4e-4, "spacing": 1.0}),
    "transmission_error": (MESHES, {"amplitude": 1e-4, "teeth": 20.0}),
    "pitch_error": (("table",), {"amplitude": 4e-4, "order": 3.0}),
    "time_varying_mesh_stiffness": (MESHES, {"amplitude": 0.1, "teeth": 20.0}),
    "hertzian_stiffness": (MESHES, {"growth": 0.3, "overlap": 4e-3}),
    "wear": (PINIONS, {"depth": 2e-3, "centre": 0.0, "width": 0.05}),
    "cogging": (BOTH, {"amplitude": 0.01, "order": 6.0}),
    "torque_ripple": (BOTH, {"amplitude": 0.02, "order": 6.0}),
    "unbalance": (("table",), {"amplitude": 0.1}),
    "cutting_torque": (("table",), {"mean": 0.3, "amplitude": 0.1, "frequency": 10.0}),
    "hydrostatic_drag": (("table",), {"quadratic": 0.02, "viscous": 0.02}),
    "position_dependent_inertia": (("table",), {"amplitude": 0.1, "order": 1.0}),
    "encoder_eccentricity": (("table",), {"amplitude": 1e-5}),
    "torque_constant_saturation": (BOTH, {"loss": 0.1}),
    "dead_time": (BOTH, {"voltage": 1.0, "current": 0.5}),
}

#: the same of a heavy table
HEAVY: dict[str, tuple[tuple[str, ...], dict[str, float]]] = LAWS | {
    "stribeck": (("table",), {"torque": 2e3, "static_ratio": 1.3, "speed": 2e-3}),
    "lugre": (
        ("table",),
        {"torque": 2e3, "static_ratio": 1.3, "speed": 2e-3, "stiffness": 2e8, "damping": 1e5},
    ),
    "angle_dependent_friction": (("table",), {"torque": 1e3, "order": 7.0}),
    "eccentricity": (("table",), {"amplitude": 3e-4, "spacing": 1.0}),
    "transmission_error": (MESHES, {"amplitude": 3e-5, "teeth": 20.0}),
    "pitch_error": (("table",), {"amplitude": 1e-4, "order": 3.0}),
    "hertzian_stiffness": (MESHES, {"growth": 0.3, "overlap": 1e-3}),
    "wear": (PINIONS, {"depth": 5e-4, "centre": 0.0, "width": 0.05}),
    "cogging": (BOTH, {"amplitude": 1.0, "order": 6.0}),
    "unbalance": (("table",), {"amplitude": 2e3}),
    "cutting_torque": (("table",), {"mean": 5e4, "amplitude": 1e4, "frequency": 10.0}),
    "hydrostatic_drag": (("table",), {"quadratic": 3e6, "viscous": 1e5}),
    "dead_time": (BOTH, {"voltage": 4.0, "current": 5.0}),
}

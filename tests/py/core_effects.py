"""Where a random machine puts an effect, and numbers that fit the machine's size."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dualdrive import _core

if TYPE_CHECKING:
    from core_random import RandomMachine

Placed = tuple[str, dict[str, float]]
MESH = (
    "transmission_error",
    "pitch_error",
    "time_varying_mesh_stiffness",
    "hertzian_stiffness",
    "wear",
)


def placed(kind: str, m: RandomMachine, body: str, level: float, still: float) -> Placed | None:
    """Return place and numbers of an effect, None where this machine has no place for it.

    body, level, still:  a body, the dry friction usual there in N m, a low speed of it in rad/s
    """
    if kind in MESH:
        return _at_a_mesh(kind, m)
    table = m.scale.table["b"]
    pinion = f"pinion_{m.random.integers(1, m.drives + 1)}"
    match kind:
        case "angle_dependent_friction":
            return body, {"torque": level / 2, "order": 7.0, "phase": 1.0}
        case "load_dependent_mesh_loss":
            return pinion, {"fraction": m.near(0.02)}
        case "unbalance":
            return body, {"amplitude": level, "phase": 1.0}
        case "position_dependent_inertia":
            return body, {"amplitude": 0.5, "order": 3.0, "phase": 1.0}
        case "hydrostatic_drag":
            fast = m.scale.move[1]
            return "table", {"viscous": m.near(table), "quadratic": m.near(table / fast)}
        case "cutting_torque":
            window = {"start": 0.1, "duration": 0.1, "rise": 0.01, "frequency": m.near(30)}
            return "table", {"mean": m.scale.load / 4, "amplitude": m.scale.load / 8, **window}
        case "torque_constant_saturation" | "thermal_drift" | "dead_time" | "tension_mismatch":
            return _at_a_motor(kind, m)
        case "current_limit" | "voltage_limit":
            limit = {"current_limit": "T_max", "voltage_limit": "U_max"}[kind]
            if _there(kind, m) or (m.direct and kind == "voltage_limit"):
                return None
            return "motors", {limit: m.scale.motor[limit] / 2}
        case "transport_delay":
            return None if _there(kind, m) else ("controller", {"delta_c": m.near(1e-3)})
        case "gearbox_backlash" | "shaft_compliance":
            return _in_the_train(kind, m)
        case "encoder_eccentricity":
            return "table", {"amplitude": 1e-5, "phase": 1.0}
        case "radial_shift" | "table_tilt":
            meshes = [m.machine.kind(f"mesh_{n}") for n in range(1, m.drives + 1)]
            return None if set(meshes) == {"rigid"} else usual(kind)
        case "quantisation":
            return "theta_m", {"step": 1e-6}
        case _:
            return usual(kind)


def usual(kind: str) -> Placed:
    """Return where an effect usually sits and its usual numbers: enough for a new effect."""
    effect = _core.effect_type(kind)
    place = effect.places.split(",")[0]
    member = {"meshes": "mesh_1", "pinions": "pinion_1", "motors": "motor_1"}.get(place, place)
    return member, {number.path: number.typical for number in effect.parameters}


def _at_a_mesh(kind: str, m: RandomMachine) -> Placed | None:
    n = m.random.integers(1, m.drives + 1)
    if m.machine.kind(f"mesh_{n}") != "gap":
        return None
    gap = m.scale.mesh["gap"]
    numbers: dict[str, dict[str, float]] = {
        "transmission_error": {"amplitude": gap / 20, "teeth": 20.0, "phase": 1.0},
        "pitch_error": {"amplitude": gap / 10, "order": 3.0, "phase": 1.0},
        "time_varying_mesh_stiffness": {"amplitude": 0.2, "teeth": 20.0},
        "hertzian_stiffness": {"growth": m.near(0.5), "overlap": m.near(gap)},
        "wear": {"depth": m.near(gap / 2), "centre": 0.0, "width": 0.05},
    }
    return f"pinion_{n}" if kind == "wear" else f"mesh_{n}", numbers[kind]


def _there(kind: str, m: RandomMachine) -> bool:
    return any(effect["effect"] == kind for effect in m.machine.effects)


def _at_a_motor(kind: str, m: RandomMachine) -> Placed | None:
    n = m.random.integers(1, m.drives + 1)
    if m.direct and kind in ("thermal_drift", "dead_time"):
        return None
    numbers: dict[str, dict[str, float]] = {
        "torque_constant_saturation": {"loss": 0.1},
        "thermal_drift": {"rise": m.near(30)},
        "dead_time": {"voltage": m.scale.motor["U_max"] / 100, "current": 0.5},
        "tension_mismatch": {"error": 0.05},
    }
    return f"motor_{n}", numbers[kind]


def _in_the_train(kind: str, m: RandomMachine) -> Placed | None:
    n = m.random.integers(1, m.drives + 1)
    gearbox = f"gearbox_{n}"
    preloaded = m.machine.kind(gearbox) == "compliant"  # as every such joint of these machines is
    if _there(kind, m) or (preloaded and kind == "gearbox_backlash"):
        return None
    stiffness = {"stiffness": m.near(5 * m.scale.mesh["stiffness"])}
    gap = {"gap": m.near(m.scale.mesh["gap"] / 5)} if kind == "gearbox_backlash" else {}
    return gearbox, stiffness | gap

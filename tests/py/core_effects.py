"""Where a random machine puts an effect, and numbers that fit the machine's size."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dualdrive import _core

if TYPE_CHECKING:
    from core_random import RandomMachine

Placed = tuple[str, dict[str, float]]
MESH = ("transmission_error", "time_varying_mesh_stiffness", "hertzian_stiffness", "wear")


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
        "time_varying_mesh_stiffness": {"amplitude": 0.2, "teeth": 20.0},
        "hertzian_stiffness": {"growth": m.near(0.5), "overlap": m.near(gap)},
        "wear": {"depth": m.near(gap / 2), "centre": 0.0, "width": 0.05},
    }
    return f"pinion_{n}" if kind == "wear" else f"mesh_{n}", numbers[kind]

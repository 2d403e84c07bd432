"""Hidden friction at table, pinions and motors."""

from __future__ import annotations

from tests.blind.generator.effects import (
    Hidden,
    Rng,
    Setting,
    at,
    effect,
    of_body,
    phase,
    pick,
    sized,
    without_dry,
)


@effect(0.8)
def viscous(s: Setting, a: float, rng: Rng) -> Hidden:
    """Beyond any tolerance of the data sheet's: several times it, or the sheet has none."""
    place = pick(s, rng, "table", "pinions", "motors")
    _, torque, speed = sized(s, place)
    word = {"t": "b_m", "p": "b_c", "m": "b_d"}[place[0]]
    path = {"t": "table.b", "p": "pinions.b", "m": "motors.b"}[place[0]]
    value = a * torque / speed
    return Hidden(
        "viscous", place, of_body(place), {"+" + word: value}, {"coefficient": value}, (path,)
    )


@effect(0.3)
def coulomb(s: Setting, a: float, rng: Rng) -> Hidden:
    place = pick(s, rng, "table", "table", "pinions", "motors", "motor_1", "pinion_2")
    prefix, torque, _ = sized(s, place)
    lean = float(rng.uniform(-0.5, 0.5)) if rng.random() < 0.4 else 0.0
    key = f"{prefix}dry{at(place)}"
    numbers = {key: a * torque, f"{prefix}asymmetry{at(place)}": lean}
    return Hidden(
        "coulomb",
        place,
        of_body(place),
        numbers,
        {"torque": a * torque, "asymmetry": lean},
        without_dry(place),
    )


@effect(0.3)
def stribeck(s: Setting, a: float, rng: Rng) -> Hidden:
    place = pick(s, rng, "table", "pinions", "motors")
    prefix, torque, fastest = sized(s, place)
    ratio, speed = float(rng.uniform(1.15, 1.6)), float(fastest * 10 ** rng.uniform(-2, -0.5))
    key = f"{prefix}dry"
    return Hidden(
        "stribeck",
        place,
        of_body(place),
        {key: a * torque, f"{prefix}ratio": ratio, f"{prefix}speed": speed},
        {"torque": a * torque, "static_ratio": ratio, "speed": speed},
        without_dry(place),
    )


@effect(0.3)
def lugre(s: Setting, a: float, rng: Rng) -> Hidden:
    place = pick(s, rng, "table", "pinions")
    prefix, torque, fastest = sized(s, place)
    # presliding over a visible share of the travel: the bristle bends that far
    bend = (
        s.travel
        * (1 if place == "table" else s.machine["meshes.ratio"])
        * 10 ** rng.uniform(-3.5, -1.5)
    )
    key = f"{prefix}lugre"
    values = {
        "torque": a * torque,
        "static_ratio": float(rng.uniform(1.0, 1.5)),
        "speed": float(fastest * 10 ** rng.uniform(-2, -1)),
        "stiffness": float(a * torque / bend),
        "damping": float(0.02 * a * torque / fastest),
    }
    words = {
        "static_ratio": "_ratio",
        "speed": "_speed",
        "stiffness": "_stiffness",
        "damping": "_damping",
    }
    numbers = {key: values["torque"]} | {key + words[k]: values[k] for k in words}
    return Hidden("lugre", place, of_body(place), numbers, values, without_dry(place))


@effect(0.2)
def angle_dependent_friction(s: Setting, a: float, rng: Rng) -> Hidden:
    order, angle = float(rng.integers(1, 4)), phase(rng)
    torque = a * s.table_torque
    return Hidden(
        "angle_dependent_friction",
        "table",
        "table",
        {"t_angle_dry": torque, "t_angle_order": order, "t_angle_phase": angle},
        {"torque": torque, "order": order, "phase": angle},
    )


@effect(0.06)
def load_dependent_mesh_loss(s: Setting, a: float, rng: Rng) -> Hidden:
    place = pick(s, rng, "pinions", "pinions", "pinion_1")
    key = "loss" + at(place)
    return Hidden("load_dependent_mesh_loss", place, "drive", {key: a}, {"fraction": a})


@effect(0.6)
def hydrostatic_drag(s: Setting, a: float, rng: Rng) -> Hidden:
    quadratic = a * s.table_torque / s.speed**2
    viscous_share = float(rng.uniform(0, 0.5)) * quadratic * s.speed
    return Hidden(
        "hydrostatic_drag",
        "table",
        "table",
        {"drag": quadratic, "+b_m": viscous_share},
        {"quadratic": quadratic, "viscous": viscous_share},
    )

"""Hidden effects of sensors and control, and of the load."""

from __future__ import annotations

from tests.blind.generator.effects import Hidden, Rng, Setting, UnfitError, at, effect, phase, pick


@effect(1.2e-2, least=0.02)
def sensor_delay(s: Setting, a: float, rng: Rng) -> Hidden:
    """In the loop at table or motors, or in the recorder, for one of its channels."""
    place = pick(s, rng, "table", "motors", "motor_1", "theta_1", "theta_m", "I_1")
    label = {"time": a}
    if place == "table":
        return Hidden("sensor_delay", place, "sensors", {"table_delay": a}, label)
    if place.startswith("motor"):
        a, key = a / 4, "motor_delay" + at(place)  # the speed loop is the faster one
        return Hidden("sensor_delay", place, "sensors", {key: a}, {"time": a})
    return Hidden("sensor_delay", place, "sensors", {}, label, recorder=(place, a))


@effect(0.3)
def unbalance(s: Setting, a: float, rng: Rng) -> Hidden:
    amplitude, angle = a * s.table_torque, phase(rng)
    return Hidden(
        "unbalance",
        "table",
        "table",
        {"unbalance": amplitude, "unbalance_phase": angle},
        {"amplitude": amplitude, "phase": angle},
    )


@effect(0.3)
def cutting_torque(s: Setting, a: float, rng: Rng) -> Hidden:
    start, duration = (float(s.end * rng.uniform(0.1, high)) for high in (0.4, 0.5))
    frequency, ripple = float(rng.uniform(4, 25)), float(rng.uniform(0.1, 0.6))
    values = {
        "mean": a * s.table_torque,
        "amplitude": a * ripple * s.table_torque,
        "frequency": frequency,
        "start": start,
        "duration": duration,
    }
    numbers = {
        "cut": values["mean"],
        "cut_ripple": values["amplitude"],
        "cut_frequency": frequency,
        "cut_from": start,
        "cut_to": start + duration,
    }
    return Hidden("cutting_torque", "table", "table", numbers, values)


@effect(0.4)
def position_dependent_inertia(s: Setting, a: float, rng: Rng) -> Hidden:
    order, angle = float(rng.integers(1, 3)), phase(rng)
    return Hidden(
        "position_dependent_inertia",
        "table",
        "table",
        {"inertia": a, "inertia_order": order, "inertia_phase": angle},
        {"amplitude": a, "order": order, "phase": angle},
    )


@effect(1.2e-2, least=0.01)
def transport_delay(s: Setting, a: float, rng: Rng) -> Hidden:
    """Commands late for both drives, or for the slave alone."""
    if rng.random() < 0.5 or s.drives == 1:
        return Hidden(
            "transport_delay", "controller", "controller", {"command_delay": a}, {"delta_c": a}
        )
    return Hidden("transport_delay", "controller", "controller", {"delta_t": a}, {"delta_t": a})


@effect(1.0)
def encoder_eccentricity(s: Setting, a: float, rng: Rng) -> Hidden:
    """`a` in units of 0.3 mrad at the table, of 20 mrad at a motor."""
    place, angle = pick(s, rng, "table", "motors", "motor_1"), phase(rng)
    amplitude = a * (3e-4 if place == "table" else 0.02)
    key = "table_ecc" if place == "table" else "motor_ecc"
    numbers = {key + at(place): amplitude, f"{key}_phase{at(place)}": angle}
    parameters = {"amplitude": amplitude, "phase": angle}
    return Hidden("encoder_eccentricity", place, "sensors", numbers, parameters)


@effect(0.5)
def tension_mismatch(s: Setting, a: float, rng: Rng) -> Hidden:
    """The equaliser takes the slave's torque for more or less than it is."""
    if s.drives == 1:
        raise UnfitError("nothing to be equal to")
    error, slave = a if rng.random() < 0.5 else -a, int(rng.integers(2, s.drives + 1))
    place = f"motor_{slave}"
    numbers = {f"misread_{slave}": error}
    return Hidden("tension_mismatch", place, "controller|sensors", numbers, {"error": error})

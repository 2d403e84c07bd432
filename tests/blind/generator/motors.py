"""Hidden effects of motors and their electronics."""

from __future__ import annotations

from tests.blind.generator.effects import Hidden, Rng, Setting, at, effect, phase, pick


def _order(s: Setting, rng: Rng) -> float:
    """Harmonics of common motors, of those that the record samples well."""
    seen = [n for n in (1, 2, 4, 6, 8, 12, 24, 36) if n * s.motor_speed * s.sample < 1.5]
    return float(rng.choice(seen or [1]))


@effect(0.1)
def cogging(s: Setting, a: float, rng: Rng) -> Hidden:
    place = pick(s, rng, "motors", "motors", "motor_1")
    amplitude, order, angle, end = a * s.motor_torque, _order(s, rng), phase(rng), at(place)
    return Hidden(
        "cogging",
        place,
        "drive",
        {f"cog{end}": amplitude, f"cog_order{end}": order, f"cog_phase{end}": angle},
        {"amplitude": amplitude, "order": order, "phase": angle},
    )


@effect(0.15)
def torque_ripple(s: Setting, a: float, rng: Rng) -> Hidden:
    place = pick(s, rng, "motors", "motors", "motor_2")
    order, angle, end = _order(s, rng), phase(rng), at(place)
    numbers = {f"ripple{end}": a, f"ripple_order{end}": order, f"ripple_phase{end}": angle}
    return Hidden(
        "torque_ripple", place, "drive", numbers, {"amplitude": a, "order": order, "phase": angle}
    )


@effect(0.4)
def torque_constant_saturation(s: Setting, a: float, rng: Rng) -> Hidden:
    return Hidden("torque_constant_saturation", "motors", "drive", {"saturation": a}, {"loss": a})


@effect(0.5)
def current_limit(s: Setting, a: float, rng: Rng) -> Hidden:
    """`a`: share of the largest torque of the record that the drive does not give."""
    limit = (1 - min(a, 0.7)) * s.peak_torque
    return Hidden("current_limit", "motors", "controller|drive", {"T_max": limit}, {"T_max": limit})


@effect(0.5)
def voltage_limit(s: Setting, a: float, rng: Rng) -> Hidden:
    """`a`: share of the largest voltage of the records that the converter does not give."""
    m = s.machine
    needed = m["motors.C_e"] * s.motor_speed + m["motors.R"] * s.peak_torque / m["motors.K_d"]
    limit = (1 - min(a, 0.6)) * needed
    return Hidden("voltage_limit", "motors", "controller|drive", {"U_max": limit}, {"U_max": limit})


@effect(0.08)
def dead_time(s: Setting, a: float, rng: Rng) -> Hidden:
    """`a` in units of the voltage that rated speed induces."""
    voltage = a * s.machine["motors.C_e"] * s.machine["motors.omega_max"]
    zone = 0.01 * s.machine["motors.T_max"] / s.machine["motors.K_d"] * float(rng.uniform(0.3, 1))
    numbers = {"dead": voltage, "dead_current": zone}
    return Hidden("dead_time", "motors", "drive", numbers, {"voltage": voltage, "current": zone})


@effect(100.0)
def thermal_drift(s: Setting, a: float, rng: Rng) -> Hidden:
    """A motor `a` kelvin warmer than its sheet; the drive still believes the sheet."""
    place = pick(s, rng, "motors", "motors", "motor_1")
    numbers = {f"warm_K{at(place)}": 0.001 * a, f"warm_R{at(place)}": 0.00393 * a}
    return Hidden("thermal_drift", place, "drive", numbers, {"rise": a})

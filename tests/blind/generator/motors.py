"""Hidden effects of motors and their electronics."""

from __future__ import annotations

from tests.blind.generator.effects import Hidden, Rng, Setting, at, effect, phase, pick


def _order(s: Setting, rng: Rng) -> float:
    """Harmonics of common motors, of those that the slow record samples well."""
    seen = [n for n in (1, 2, 4, 6, 8, 12, 24) if n * s.motor_speed < 2 * 3.14159 * 120]
    return float(rng.choice(seen or [1]))


@effect(0.1)
def cogging(s: Setting, a: float, rng: Rng) -> Hidden:
    place = pick(rng, "motors", "motors", "motor_1")
    amplitude, order, angle, end = a * s.motor_torque, _order(s, rng), phase(rng), at(place)
    return Hidden(
        *("cogging", place, "drive"),
        *({f"cog{end}": amplitude, f"cog_order{end}": order, f"cog_phase{end}": angle},),
        {"amplitude": amplitude, "order": order, "phase": angle},
    )


@effect(0.15)
def torque_ripple(s: Setting, a: float, rng: Rng) -> Hidden:
    place = pick(rng, "motors", "motors", "motor_2")
    order, angle, end = _order(s, rng), phase(rng), at(place)
    numbers = {f"ripple{end}": a, f"ripple_order{end}": order, f"ripple_phase{end}": angle}
    return Hidden(
        *("torque_ripple", place, "drive", numbers),
        {"amplitude": a, "order": order, "phase": angle},
    )

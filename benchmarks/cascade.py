"""Two drives with cascades on one ring, with one law, compiled by Numba for other people's solvers.

The bench and the heavy tables with rigid gearboxes, in the coordinates that dualdrive integrates
(twists of the meshes), below their limits of speed, torque and voltage. Numbers are read off the
core's machine; what stands here is a second writing of docs/theory/plant.md, controller.md and of
the laws in docs/effects.md. A law that is absent costs nothing: its size is a constant zero to the
compiler.
"""

from __future__ import annotations

from math import cos, exp, pi, sin, sqrt
from typing import Any

from dualdrive import _core
from equations import Problem

# omega_c1, omega_c2, x_1, x_2, I_1, I_2, theta_m, omega_m, tension, equaliser, two speed integrals,
# two current integrals, bristle
STATES = 15
#: of each mesh 0 in the gap, ±1 a flank carries, ±2 it parts; of pinions and table the direction in
#: which they slide, 0 stuck
MODES = 5
TABLE = 4
LAWS = (
    "stribeck", "lugre", "angle_dependent_friction", "eccentricity", "transmission_error",
    "pitch_error", "time_varying_mesh_stiffness", "hertzian_stiffness", "cogging", "torque_ripple",
    "unbalance", "hydrostatic_drag", "torque_constant_saturation",
)  # fmt: skip
ROUNDING = 1e-2  # of Hertz's root where the flank is met, over its reference overlap


def numbers_of(machine: _core.Machine) -> dict[str, float]:
    """Every number of an effect as `effect.name`, 0 of what is absent.

    Places of one effect agree.
    """
    found = {f"{law}.{p.path}": 0.0 for law in (*LAWS, "coulomb", "mesh_damping")
             for p in _core.effect_type(law).parameters}  # fmt: skip
    for one in machine.effects:
        at = "_at_pinions" if one["effect"] == "coulomb" and "pinion" in one["place"] else ""
        for name in one["parameters"]:
            found[f"{one['effect']}{at}.{name}"] = machine.get(f"{one['label']}.{name}")
    return found


def problem(machine: _core.Machine, amplitude: float, frequency: float) -> Problem:
    """The machine's equations under the command of a sine; amplitude in rad, frequency in Hz."""
    from numba import njit

    get, law = machine.get, numbers_of(machine)
    turn = 2 * pi * frequency
    i, i_m, K_d = get("gearboxes.ratio"), get("meshes.ratio"), get("motors.K_d")
    J, J_m = i**2 * get("motors.J") + get("pinions.J"), get("table.J")
    b, b_m = i**2 * get("motors.b") + get("pinions.b"), get("table.b")
    K_e, R, L = i * get("motors.C_e"), get("motors.R"), get("motors.L")
    K_t, gap, damping = get("meshes.stiffness"), get("meshes.gap"), law["mesh_damping.coefficient"]
    K_v, f_v, w = (get(f"controller.{name}") for name in ("K_v", "f_v", "w"))
    k_p, T_N, T_E = (get(f"controller.{name}") for name in ("k_p", "T_N", "T_E"))
    T_ten, tau_t, omega_ci = (get(f"controller.{name}") for name in ("T_ten", "tau_t", "omega_ci"))
    K_E = get("controller.g_E") * i / (2 * k_p)
    T_rated = get("motors.T_rated")
    F_c, F_pinion = law["coulomb.torque"], law.get("coulomb_at_pinions.torque", 0.0)

    names = ("torque", "static_ratio", "speed")
    F_s, ratio_s, speed_s = (law[f"stribeck.{name}"] for name in names)
    F_l, ratio_l, speed_l = (law[f"lugre.{name}"] for name in names)
    s0, s1 = law["lugre.stiffness"], law["lugre.damping"]
    F_a, order_a, phase_a = (
        law[f"angle_dependent_friction.{name}"] for name in ("torque", "order", "phase")
    )
    ring = "pitch_error" if law["pitch_error.amplitude"] else "eccentricity"
    e_ring, order_ring = law[f"{ring}.amplitude"], law.get(f"{ring}.order", 1.0)
    phase_ring, spacing = law[f"{ring}.phase"], law[f"{ring}.spacing"]
    e_tooth, teeth, phase_tooth = (
        law[f"transmission_error.{name}"] for name in ("amplitude", "teeth", "phase")
    )
    swing, teeth_K, phase_K = (
        law[f"time_varying_mesh_stiffness.{name}"] for name in ("amplitude", "teeth", "phase")
    )
    growth, overlap = (law[f"hertzian_stiffness.{name}"] for name in ("growth", "overlap"))
    cog, order_cog, phase_cog = (law[f"cogging.{name}"] for name in ("amplitude", "order", "phase"))
    ripple, order_r, phase_r = (
        law[f"torque_ripple.{name}"] for name in ("amplitude", "order", "phase")
    )
    heavy, phase_u = law["unbalance.amplitude"], law["unbalance.phase"]
    drag, slow = law["hydrostatic_drag.quadratic"], law["hydrostatic_drag.viscous"]
    loss = law["torque_constant_saturation.loss"]
    dry_pinion, dry_table = F_pinion > 0, F_c + F_s + F_a > 0

    @njit
    def mesh(n, y, mode):  # type: ignore[no-untyped-def]
        """Return how far beyond its flank, the contact's torque, those on pinion and table."""
        theta_c = y[2 + n] + i_m * y[6]
        x, by_pinion, by_table, K, K_slope = y[2 + n], 1.0, -i_m, K_t, 0.0
        if e_ring != 0:
            angle = order_ring * (y[6] + n * spacing) + phase_ring
            x += e_ring * cos(angle)
            by_table -= e_ring * order_ring * sin(angle)
        if e_tooth != 0:
            x += e_tooth * cos(teeth * theta_c + phase_tooth)
            by_pinion -= e_tooth * teeth * sin(teeth * theta_c + phase_tooth)
        if swing != 0:
            K *= 1 + swing * cos(teeth_K * theta_c + phase_K)
            K_slope = -K_t * swing * teeth_K * sin(teeth_K * theta_c + phase_K)
        if mode == 0:
            return x, 0.0, 0.0, 0.0
        side = 1.0 if mode > 0 else -1.0
        beyond = x - side * gap
        torque = K * beyond + damping * (by_pinion * y[n] + by_table * y[7])
        if growth != 0:
            u = beyond / overlap
            torque += K_t * growth * overlap * u * sqrt(sqrt(u * u + ROUNDING * ROUNDING))
        if mode == 2 or mode == -2:
            return side * beyond, side * torque, 0.0, 0.0
        on_pinion = -torque * by_pinion - 0.5 * K_slope * beyond * beyond
        return side * beyond, side * torque, on_pinion, -torque * by_table

    @njit
    def motor(theta, torque):  # type: ignore[no-untyped-def]  # on the shaft, of K_d I
        added = 0.0
        if ripple != 0:
            added += ripple * torque * sin(order_r * theta + phase_r)
        if cog != 0:
            added += cog * sin(order_cog * theta + phase_cog)
        if loss != 0:
            x = torque / T_rated
            added += torque * (1 / sqrt(1 + 2 * loss * x * x) - 1)
        return torque + added

    @njit
    def limit(theta, omega):  # type: ignore[no-untyped-def]  # of the table's dry friction
        most = F_c
        if F_s != 0:
            most += F_s * (1 + (ratio_s - 1) * exp(-((omega / speed_s) ** 2)))
        if F_a != 0:
            most += F_a * (1 + cos(order_a * theta + phase_a))
        return most

    @njit
    def bristle_rate(omega, bristle):  # type: ignore[no-untyped-def]
        if F_l == 0:
            return 0.0
        level = F_l * (1 + (ratio_l - 1) * exp(-((omega / speed_l) ** 2)))
        return omega - s0 * abs(omega) * bristle / level

    @njit
    def net(y, modes):  # type: ignore[no-untyped-def]  # torques but for dry friction
        _, _, pinion_1, table_1 = mesh(0, y, modes[0])
        _, _, pinion_2, table_2 = mesh(1, y, modes[1])
        theta_1, theta_2 = i * (y[2] + i_m * y[6]), i * (y[3] + i_m * y[6])
        on_1 = i * motor(theta_1, K_d * y[4]) - b * y[0] + pinion_1
        on_2 = i * motor(theta_2, K_d * y[5]) - b * y[1] + pinion_2
        on_table = table_1 + table_2 - b_m * y[7]
        if heavy != 0:
            on_table += heavy * cos(y[6] + phase_u)
        if drag != 0:
            on_table -= (slow + drag * abs(y[7])) * y[7]
        if F_l != 0:
            on_table -= s0 * y[14] + s1 * bristle_rate(y[7], y[14])
        return on_1, on_2, on_table

    @njit
    def rates(t, y, modes, out):  # type: ignore[no-untyped-def]
        on_1, on_2, on_table = net(y, modes)
        out[0] = (on_1 - modes[2] * F_pinion) / J if not dry_pinion or modes[2] != 0 else 0.0
        out[1] = (on_2 - modes[3] * F_pinion) / J if not dry_pinion or modes[3] != 0 else 0.0
        out[2], out[3] = y[0] - i_m * y[7], y[1] - i_m * y[7]
        out[6] = y[7]
        if not dry_table:
            out[7] = on_table / J_m
        else:
            sliding = modes[TABLE] != 0
            out[7] = (on_table - modes[TABLE] * limit(y[6], y[7])) / J_m if sliding else 0.0
        command, speed = amplitude * sin(turn * t), amplitude * turn * cos(turn * t)
        set_point = i_m * (K_v * (command - y[6]) + f_v * speed)
        unequal = 2 * K_d * (w * y[4] - (1 - w) * y[5]) - y[8]
        equalising = K_E * (unequal + y[9])
        out[8] = (T_ten - y[8]) / tau_t
        out[9] = unequal / T_E
        for n in range(2):
            slip = set_point + (2 * n - 1) * equalising - y[n]
            lack = k_p / i * (slip + y[10 + n]) / K_d - y[4 + n]
            voltage = omega_ci * (L * lack + R * y[12 + n]) + K_e * y[n]
            out[4 + n] = (voltage - R * y[4 + n] - K_e * y[n]) / L
            out[10 + n] = slip / T_N
            out[12 + n] = lack
        out[14] = bristle_rate(y[7], y[14])

    @njit
    def margins(t, y, modes, out):  # type: ignore[no-untyped-def]
        for n in range(2):
            beyond, torque, _, _ = mesh(n, y, modes[n])
            if modes[n] == 0:
                out[2 * n], out[2 * n + 1] = gap - beyond, gap + beyond
            elif abs(modes[n]) == 1:
                out[2 * n], out[2 * n + 1] = torque, 1.0  # a flank never pulls
            else:
                out[2 * n], out[2 * n + 1] = beyond, -torque
        out[4:] = 1.0
        if not dry_pinion and not dry_table:
            return
        nets = net(y, modes)
        for k in range(3):
            most = limit(y[6], y[7]) if k == 2 else F_pinion
            at, speed = 4 + 2 * k, y[7] if k == 2 else y[k]
            if (k < 2 and not dry_pinion) or (k == 2 and not dry_table):
                continue
            if modes[2 + k] != 0:
                out[at] = modes[2 + k] * speed
            else:
                out[at], out[at + 1] = most - nets[k], most + nets[k]

    @njit
    def change(guard, t, y, modes):  # type: ignore[no-untyped-def]
        n, k = guard // 2, (guard - 4) // 2
        if guard >= 4 and modes[2 + k] == 0:
            modes[2 + k] = 1 if guard % 2 == 0 else -1
        elif guard >= 4:
            y[7 if k == 2 else k] = 0.0
            modes[2 + k] = 0
        elif modes[n] == 0:
            side = 1 if guard % 2 == 0 else -1
            modes[n] = side
            _, torque, _, _ = mesh(n, y, modes[n])
            modes[n] = side if torque > 0 else 2 * side
        elif abs(modes[n]) == 1:
            beyond, _, _, _ = mesh(n, y, modes[n])
            modes[n] = 2 * modes[n] if beyond > 0 else 0
        else:
            modes[n] = 0 if guard % 2 == 0 else modes[n] // 2
        for k in range(3):  # what is stuck may not be held any longer: a damped contact jumps
            if modes[2 + k] == 0 and (dry_table if k == 2 else dry_pinion):
                torque = net(y, modes)[k]
                most = limit(y[6], 0.0) if k == 2 else F_pinion
                if abs(torque) > most:
                    modes[2 + k] = 1 if torque > 0 else -1

    return Problem(STATES, MODES, 10, rates, margins, change)


def shown(y: Any) -> Any:
    """Shape (times, 15) to the columns of effects.STATES."""
    return y[:, :8]

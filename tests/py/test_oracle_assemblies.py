"""What everything leans on, one small test each: two bodies per drive, a rigid mesh, a ticked loop,
a delayed signal, a recorded input, a user's formula. Each against a closed form or a plain solver.
"""

from __future__ import annotations

from math import ceil, factorial, floor, inf, pi, sqrt

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from core_machines import Array, core_machine, run, set_all
from dualdrive import _core
from reference_model import heavy_table

pytestmark = pytest.mark.usefixtures("both_engines")

# -------------------------------------------------------------------------- two bodies per drive


def two_body_drive(kind: str) -> _core.Machine:
    """Return motor – gearbox with its own compliance (and play) – pinion – mesh – table."""
    machine = _core.Machine()
    for body, J, b in (("motor_1", 0.05, 0.01), ("pinion_1", 60, 20), ("table", 1e5, 50)):
        machine.add_body(body)
        set_all(machine, body, {"J": J, "b": b})
    machine.connect("gearbox_1", "motor_1", "pinion_1", kind, "driven")
    machine.connect("mesh_1", "pinion_1", "table", "gap", "driver")
    machine.add_motor("motor_1")
    set_all(machine, "motor_1", {"K_d": 1.2, "C_e": 1.2, "R": 0.2, "L": 4e-3})
    set_all(machine, "gearbox_1", {"ratio": 50, "stiffness": 3e6})
    if kind == "gap":
        machine.set("gearbox_1.gap", 4e-4)
    set_all(machine, "mesh_1", {"ratio": 10, "stiffness": 1e7, "gap": 1e-3})
    return machine


@pytest.mark.long
@pytest.mark.parametrize("kind", ["compliant", "gap"])
def test_two_bodies_per_drive(kind: str) -> None:
    """Shaft compliance, or play ahead in the chain, against the equations in a plain solver."""

    def dead_zone(x: float, gap: float) -> float:
        return x - min(gap, max(-gap, x))

    def rates(t: float, z: Array) -> list[float]:
        w, wc, wm, th, thc, thm, current = z
        voltage = 40 * np.sin(2 * pi * t)
        play = 4e-4 if kind == "gap" else 0.0
        shaft = 3e6 * dead_zone(th / 50 - thc, play)
        mesh = 1e7 * dead_zone(thc - 10 * thm, 1e-3)
        return [
            (1.2 * current - 0.01 * w - shaft / 50) / 0.05,
            (shaft - 20 * wc - mesh) / 60,
            (10 * mesh - 50 * wm) / 1e5,
            w, wc, wm,
            (voltage - 0.2 * current - 1.2 * w) / 4e-3,
        ]  # fmt: skip

    seen = run(two_body_drive(kind), {"U_1": _core.sine(40.0, 1.0)}, 1.5)
    plain = solve_ivp(rates, (0, 1.5), np.zeros(7), "DOP853", seen.t, rtol=1e-11, atol=1e-13,
                      max_step=2e-4)  # fmt: skip
    names = ("omega_1", "omega_c1", "omega_m", "theta_1", "theta_c1", "theta_m", "I_1")
    for name, expected in zip(names, plain.y, strict=True):
        np.testing.assert_allclose(seen[name], expected, atol=1e-5 * np.abs(expected).max())
    elements = {event[1] for event in seen.raw.events}
    assert elements == ({"mesh_1", "gearbox_1"} if kind == "gap" else {"mesh_1"})


# ---------------------------------------------------------------------------------- a rigid mesh


def test_rigid_mesh_makes_one_inertia() -> None:
    """J = J_m + i_m² J_c + (i i_m)² J_d in the table's frame; ω = T/b (1 − exp(−b t/J))."""
    machine = _core.Machine()
    bodies = {"motor_1": (0.05, 0.01), "pinion_1": (60.0, 200.0), "table": (1e5, 5e3)}
    i, i_m = 50.0, 10.0
    for body, (J, b) in bodies.items():
        machine.add_body(body)
        set_all(machine, body, {"J": J, "b": b})
    machine.connect("gearbox_1", "motor_1", "pinion_1", "rigid", "driven")
    machine.connect("mesh_1", "pinion_1", "table", "rigid", "driver")
    machine.add_motor("motor_1", kind="direct")
    set_all(machine, "gearbox_1", {"ratio": i})
    set_all(machine, "mesh_1", {"ratio": i_m})
    seen = run(machine, {"T_1": _core.constant(20.0)}, 5.0, rtol=1e-12)
    ratios = {"motor_1": i * i_m, "pinion_1": i_m, "table": 1.0}
    J, b = (sum(ratios[k] ** 2 * value[n] for k, value in bodies.items()) for n in (0, 1))
    speed = 20 * i * i_m / b * (1 - np.exp(-b / J * seen.t))
    np.testing.assert_allclose(seen["omega_m"], speed, rtol=1e-9, atol=1e-14)
    np.testing.assert_allclose(seen["omega_1"], i * i_m * speed, rtol=1e-9, atol=1e-11)
    assert len(machine.states()) == 2  # one speed, one angle


# --------------------------------------------------------------------------------- a ticked loop


def servo_axis(**controller: float) -> _core.Machine:
    """Return a table turned by a torque motor without any transmission."""
    machine = _core.Machine()
    machine.add_body("table")
    machine.add_body("motor_1")
    machine.connect("gearbox_1", "motor_1", "table", "rigid", "driven")
    machine.add_motor("motor_1", kind="direct")
    machine.set("table.J", 2.0)
    machine.set("motor_1.J", 0.0)
    machine.set_controller(speed_samples=int(controller.pop("speed_samples", 0)))
    set_all(machine, "controller", {"f_v": 0.0, "g_E": 0.0, "T_N": 0.0} | controller)
    return machine


@pytest.mark.parametrize("latency", [0.0, 6e-4])
@pytest.mark.parametrize("samples", [0, 1, 3])
def test_ticked_loops_against_a_plain_discrete_simulation(samples: int, latency: float) -> None:
    """Position every 3 ms, speed every 1 ms, PI with a limit; between ticks θ̈ = T/J exactly."""
    J, K_v, k_p, T_N, T_max, end = 2.0, 25.0, 300.0, 0.04, 9.0, 0.4
    machine = servo_axis(
        speed_samples=samples, K_v=K_v, k_p=k_p, T_N=T_N, f_v=1.0, position_sample=3e-3,
        speed_sample=1e-3, speed_latency=latency,
    )  # fmt: skip
    machine.set("motor_1.T_max", T_max)
    seen = run(machine, {"theta_ref": _core.sine(0.05, 3.0)}, end, rtol=1e-12)

    angle = speed = wanted = integral = torque = 0.0
    encoder = [0.0] * max(samples, 1)
    expected = []
    for k in range(round(end / 1e-3) + 1):
        t = k * 1e-3
        if k % 3 == 0:
            command = 0.05 * np.sin(6 * pi * t), 0.05 * 6 * pi * np.cos(6 * pi * t)
            wanted = K_v * (command[0] - angle) + command[1]
        measured = (angle - encoder[samples - 1]) / (samples * 1e-3) if samples else speed
        encoder = [angle, *encoder[:-1]]
        raw = k_p * (wanted - measured + integral)
        if not (abs(raw) > T_max and raw * (wanted - measured) > 0):
            integral += 1e-3 * (wanted - measured) / T_N
        result = min(T_max, max(-T_max, raw))
        if not latency:
            torque = result
        expected.append((angle, speed, torque))
        for span, new in ((latency, torque), (1e-3 - latency, result)):
            torque = new
            angle += speed * span + torque / J * span**2 / 2
            speed += torque / J * span
    for name, values in zip(("theta_m", "omega_m", "T_1"), np.transpose(expected), strict=True):
        np.testing.assert_allclose(seen[name], values, rtol=0, atol=1e-8 * np.abs(values).max())
    assert np.abs(seen["T_1"]).max() == T_max


# ------------------------------------------------------------------------------ a delayed signal


def by_steps(a: float, delay: float, t: Array) -> Array:
    """Return x of ẋ = −a x(t − τ), x = 1 until t = 0: a polynomial more with every delay."""
    x = np.ones_like(t)
    for k in range(1, ceil(t.max() / delay) + 2):
        late = np.maximum(0.0, t - (k - 1) * delay)
        x += (-a) ** k * late**k / factorial(k)
    return x


def test_a_sensor_delay_in_the_loop_is_a_delay_equation() -> None:
    """J ω̇ = −k_p ω(t − τ) against the method of steps, and dω/dτ, which breaks every τ."""
    delay, J, k_p = 0.05, 2.0, 50.0
    machine = servo_axis(K_v=0.0, k_p=k_p)
    label = machine.add_effect("sensor_delay", "motor_1")
    machine.set(f"{label}.time", delay)
    parameters = [f"{label}.time", "controller.k_p"]
    seen = run(
        machine, {"theta_ref": _core.constant(0.0)}, 0.6, initial={"omega_m": 1.0}, rtol=1e-11,
        sensitivities=parameters, times=np.linspace(0.001, 0.6, 600),
    )  # fmt: skip
    a, t = k_p / J, seen.t
    np.testing.assert_allclose(seen["omega_m"], by_steps(a, delay, t), rtol=0, atol=1e-9)
    by_delay, by_gain = np.zeros_like(t), np.zeros_like(t)
    for k in range(1, floor(0.6 / delay) + 2):
        late = np.maximum(0.0, t - (k - 1) * delay)
        by_gain += (-1) ** k * k * a ** (k - 1) * late**k / factorial(k) / J
        by_delay -= (-a) ** k * (k - 1) * late ** (k - 1) / factorial(k - 1) * (late > 0)
    away = np.abs(t / delay - np.round(t / delay)) > 1e-3
    np.testing.assert_allclose(seen.slope("omega_m", parameters[1]), by_gain, rtol=0, atol=1e-8)
    np.testing.assert_allclose(
        seen.slope("omega_m", parameters[0])[away], by_delay[away], rtol=0, atol=1e-6
    )


def lagging_slave(lag: float) -> _core.Machine:
    """Return the heavy table without play, friction or limits, its slave lagging by δt."""
    table = heavy_table(dry_friction=False).both(gap=0.0, c=0.0, T_max=inf, U_max=inf)
    machine = core_machine(table.control(Omega_max=inf, Omega_E=inf))
    machine.set("controller.delta_t", lag)
    return machine


def plain_rates(command: tuple[float, float], late: float | None, z: Array) -> tuple[Array, float]:
    """Return ż of that table and Ω_1; the slave is given `late` (None: Ω_1 itself)."""
    w, x, current, (theta, speed, tension, equaliser) = z[0:2], z[2:4], z[4:6], z[6:10]
    speed_loop, current_loop = z[10:12], z[12:14]
    i, i_m, R, L, K_d, k_p, bandwidth = 150, 20, 0.15, 3e-3, 1.155, 2e5, 800
    omega_1 = i_m * (5 * (command[0] - theta) + command[1])
    unequal = K_d * (current[0] - current[1]) - tension
    y = 0.5 * i / (2 * k_p) * (unequal + equaliser)
    slip = np.array([omega_1 - y, (omega_1 if late is None else late) + y]) - w
    lack = k_p / i * (slip + speed_loop) / K_d - current
    voltage = bandwidth * (L * lack + R * current_loop) + i * K_d * w
    mesh = 2e7 * x
    rate = [
        *((i * K_d * current - 650 * w - mesh) / 1072.5), *(w - i_m * speed),
        *((voltage - R * current - i * K_d * w) / L), speed,
        (i_m * mesh.sum() - 1e5 * speed) / 3e6, (60 - tension) / 0.1, unequal / 0.1,
        *(slip / 0.1), *lack,
    ]  # fmt: skip
    return np.array(rate), float(omega_1)


def by_fixed_steps(lag: float, end: float, per_lag: int) -> Array:
    """Return the states on a grid that divides the lag: RK4, Ω_1 of the past from half steps."""
    h, amplitude, turn = lag / per_lag, 0.01, 2 * pi
    past: list[float] = []  # Ω_1 at every half step, from the right of the start on
    z, states = np.zeros(14), []

    def command(t: float) -> tuple[float, float]:
        return amplitude * np.sin(turn * t), amplitude * turn * np.cos(turn * t)

    for k in range(round(end / h)):
        t, first = k * h, 2 * (k - per_lag)
        late = [past[first + m] if first >= 0 else 0.0 for m in (0, 1, 2)]
        k1, omega = plain_rates(command(t), late[0], z)
        k2, _ = plain_rates(command(t + h / 2), late[1], z + h / 2 * k1)
        k3, _ = plain_rates(command(t + h / 2), late[1], z + h / 2 * k2)
        k4, _ = plain_rates(command(t + h), late[2], z + h * k3)
        new = z + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        arriving, _ = plain_rates(command(t + h), late[2], new)
        middle = (z + new) / 2 + h / 8 * (k1 - arriving)
        past += [omega, plain_rates(command(t + h / 2), late[1], middle)[1]]
        states.append(z)
        z = new
    return np.array([*states, z])


@pytest.mark.parametrize("lag", [0.01, 0.05])
def test_slave_lag_is_a_delay_equation(lag: float) -> None:
    """Ω_2(t) = Ω_1(t − δt); the command's speed jumps at the start, so Ω_2 jumps at δt."""
    end = 0.4
    seen = run(
        lagging_slave(lag), {"theta_ref": _core.sine(0.01, 1.0)}, end, output_step=lag / 10,
        rtol=1e-12,
    )  # fmt: skip
    names = ("omega_c1", "omega_c2", "mesh_1.twist", "mesh_2.twist", "I_1", "I_2", "theta_m")
    core = np.column_stack([seen[name] for name in names])
    errors = []
    for per_lag in (round(lag / 2e-4), round(lag / 1e-4)):
        plain = by_fixed_steps(lag, end, per_lag)[:: per_lag // 10, :7]
        errors.append(float((np.abs(core - plain).max(axis=0) / np.abs(plain).max(axis=0)).max()))
    assert errors[1] < 1e-6
    assert errors[0] / errors[1] == pytest.approx(16, rel=0.2)  # the plain solver's order, 4
    unlagged = run(lagging_slave(0.0), {"theta_ref": _core.sine(0.01, 1.0)}, end)
    assert np.abs(unlagged["I_2"][-1] - core[-1, 5]) > 1  # amperes: the lag matters


# ------------------------------------------------------------------------------ a recorded input


def torque_driven(T: _core.Waveform, end: float, **options: object) -> Array:
    machine = _core.Machine()
    machine.add_body("table")
    machine.add_motor("motor_1", "table", "direct")
    machine.set("table.J", 2.0)
    return run(machine, {"T_1": T}, end, **options)["omega_m"]  # type: ignore[arg-type]


def test_a_recorded_input_held_between_samples() -> None:
    """ω is the running sum of torque times time over J, exact for a held recording."""
    random = np.random.default_rng(1)
    t = np.cumsum(random.uniform(0.5e-3, 2e-3, 400))
    torque = random.normal(size=400) * 50
    held = _core.sampled(t, torque, _core.Interpolation.hold)
    omega = torque_driven(held, float(t[-1]), times=t)
    before = torque[0] * t[0]  # the first value is held before the recording too
    expected = (before + np.concatenate([[0], np.cumsum(torque[:-1] * np.diff(t))])) / 2.0
    np.testing.assert_allclose(omega, expected, rtol=0, atol=1e-11)


def test_a_recorded_input_through_a_spline() -> None:
    t = np.linspace(0, 1, 1001)
    splined = _core.sampled(t, 50 * np.sin(2 * pi * 3 * t), _core.Interpolation.cubic)
    omega = torque_driven(splined, 1.0)
    expected = 50 / (2 * pi * 3 * 2.0) * (1 - np.cos(2 * pi * 3 * t))
    np.testing.assert_allclose(omega, expected, rtol=0, atol=1e-9)


# ------------------------------------------------------------------------------ a user's formula


def oscillator(formula: str, **numbers: float) -> _core.Machine:
    machine = _core.Machine()
    machine.add_body("table")
    machine.set("table.J", 2.0)
    machine.add_expression("table", formula, [(name, "", v) for name, v in numbers.items()])
    return machine


def period_of(machine: _core.Machine, speed: float) -> float:
    """Return the mean time between upward zero crossings of the angle, started at zero."""
    seen = run(machine, end=10.0, initial={"omega_m": speed}, rtol=1e-12)
    angle, omega = seen["theta_m"], seen["omega_m"]
    up = np.flatnonzero((angle[:-1] < 0) & (angle[1:] >= 0))
    crossings = seen.t[up + 1] - angle[up + 1] / omega[up + 1]
    return float(crossings[-1] / len(up))


def test_a_cubic_spring_as_a_formula() -> None:
    """θ̈ = −α θ³ has the period 4 √2 / (A √α) ∫ du/√(1 − u⁴) with ω_0² = α A⁴/2."""
    alpha, amplitude = 3.0, 1.3
    quarter = quad(lambda u: 2 / np.sqrt((2 - u * u) * (1 + (1 - u * u) ** 2)), 0, 1)[0]
    period = 4 * sqrt(2) / (amplitude * sqrt(alpha)) * quarter
    speed = amplitude**2 * sqrt(alpha / 2)
    machine = oscillator("-k * angle^3", k=2.0 * alpha)
    assert period_of(machine, speed) == pytest.approx(period, rel=1e-7)


@pytest.mark.parametrize(
    "formula",
    ["if(angle > a, -k * (angle - a), if(angle < -a, -k * (angle + a), 0))",
     "-k * (max(angle - a, 0) + min(angle + a, 0))",
     "-k * (abs(angle) - a + abs(abs(angle) - a)) / 2 * sign(angle)"],
)  # fmt: skip
def test_a_dead_zone_as_a_formula_switches_like_a_mesh(formula: str) -> None:
    """The free bounce once more, from if, min and max, abs and sign: 2π √(J/k) + 4 a/v."""
    a, k, v = 0.01, 800.0, 0.3
    machine = oscillator(formula, a=a, k=k)
    expected = 2 * pi * sqrt(2.0 / k) + 4 * a / v
    assert period_of(machine, v) == pytest.approx(expected, rel=1e-8)

"""Sensitivities against central differences at two step sizes, and against closed forms."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import pytest

from core_machines import Array, Run, core_inputs, core_machine, run, set_all
from dualdrive import _core
from reference_model import Motion, bench, heavy_table, move, sine, step

SIGNALS = ("theta_m", "omega_m", "omega_c1", "omega_c2", "I_1", "I_2", "mesh_1.twist", "e")
STEPS = (1e-4, 1e-5)  # of a parameter
ALLOWED = 1e-4
SOLVER = 1e-9  # of a signal's peak: what the two runs of a difference may be wrong by
KINK = 2e-3  # s: a difference across a switch that moves past an output time means nothing


@dataclass
class Case:
    machine: _core.Machine
    motion: Motion
    end: float
    parameters: tuple[str, ...]
    initial: Mapping[str, float] = field(default_factory=dict)

    def run(self, times: Array, path: str = "", change: float = 0.0, **options: object) -> Run:
        machine, initial = self.machine.copy(), dict(self.initial)
        if path.startswith("initial."):
            initial[path[8:]] += change
        elif path:
            machine.set(path, machine.get(path) + change)
        return run(machine, core_inputs(self.motion), self.end, initial=initial, times=times,
                   signals=SIGNALS, **options)  # type: ignore[arg-type]  # fmt: skip

    def size(self, path: str) -> float:
        if path.startswith("initial."):
            return abs(self.initial[path[8:]])
        return abs(self.machine.get(path))

    def away_from_switches(self) -> Array:
        switches = [event[0] for event in self.run(np.array([self.end])).raw.events]
        times = np.linspace(self.end / 37, self.end, 37)
        return np.array([t for t in times if all(abs(t - at) > KINK for at in switches)])


MECHANICS = ("meshes.gap", "mesh_1.stiffness", "table.J", "motor_1.J", "pinions.b", "meshes.ratio",
             "gearboxes.ratio")  # fmt: skip
CONTROL = ("controller.K_v", "controller.f_v", "controller.k_p", "controller.T_N",
           "controller.omega_ci")  # fmt: skip
TENSION = ("controller.g_E", "controller.T_E", "controller.T_ten", "controller.tau_t",
           "controller.w")  # fmt: skip
QUICK = move(0.02, 0.03, 0.05, 0.3, start=0.2)
THROWN = {"omega_c1": 0.05, "omega_c2": 0.04, "mesh_1.twist": 1e-4, "theta_m": 1e-4}


def plain() -> Case:
    machine = core_machine(heavy_table(100, dry_friction=False).both(c=0.0))
    start = {"omega_c1": 0.01, "mesh_1.twist": 1e-4, "theta_m": 1e-4}
    names = (*MECHANICS, *CONTROL, *TENSION, "table.b", *(f"initial.{name}" for name in start))
    return Case(machine, QUICK, 1.5, names, start)


def mesh_damping() -> Case:
    """Closing a damped contact is a jump in torque: the sensitivities jump with it."""
    machine = core_machine(heavy_table(100, dry_friction=False).control(T_ten=10.0))
    names = (*MECHANICS, "mesh_damping@mesh_1.coefficient", "controller.K_v", "controller.T_ten",
             *(f"initial.{name}" for name in THROWN))  # fmt: skip
    return Case(machine, QUICK, 1.2, names, THROWN)


def dry_friction() -> Case:
    """A damped contact that breaks a stuck body loose: two switches at one time."""
    machine = core_machine(heavy_table(100).control(T_ten=10.0))
    machine.set("coulomb@table.asymmetry", 0.1)
    names = ("meshes.gap", "table.J", "coulomb@table.torque", "coulomb@pinion_1.torque",
             "coulomb@table.asymmetry", "controller.K_v", "controller.k_p", "controller.T_ten",
             "initial.omega_c1", "initial.mesh_1.twist", "initial.theta_m")  # fmt: skip
    return Case(machine, QUICK, 1.2, names, THROWN)


def sampled_loops() -> Case:
    machine = core_machine(heavy_table(100, dry_friction=False))
    clocks = {"position": 4e-3, "tension": 4e-3, "speed": 2e-3, "current": 5e-4}
    set_all(machine, "controller", {f"{loop}_sample": time for loop, time in clocks.items()})
    machine.set("controller.speed_latency", 1e-3)
    names = ("meshes.gap", "table.J", "meshes.ratio", *CONTROL, "controller.T_ten",
             "initial.omega_c1", "initial.theta_m")  # fmt: skip
    return Case(machine, QUICK, 0.6, names, THROWN)


def differenced_encoder() -> Case:
    machine = core_machine(heavy_table(100, dry_friction=False))
    machine.set_controller(speed_samples=2)
    set_all(machine, "controller", {"position_sample": 4e-3, "speed_sample": 2e-3})
    names = ("meshes.gap", "gearboxes.ratio", "controller.k_p", "initial.omega_c1",
             "initial.theta_m", "initial.mesh_1.twist")  # fmt: skip
    return Case(machine, QUICK, 0.6, names, THROWN)


def slave_lag() -> Case:
    """A step of the command comes back after δt, which moves with δt."""
    machine = core_machine(heavy_table(100, dry_friction=False).both(c=0.0))
    machine.set("controller.delta_t", 0.02)
    motion = step(1e-3, at=0.1) + move(0.02, 0.03, 0.05, 0.3, start=0.5, origin=1e-3)
    names = ("controller.delta_t", "controller.K_v", "controller.k_p", "controller.T_ten",
             "meshes.gap", "table.J", "initial.omega_c1", "initial.theta_m")  # fmt: skip
    return Case(machine, motion, 1.2, names, THROWN)


def saturations() -> Case:
    """Every limit is met, and ridden; δt returns a jump that saturates other blocks at once."""
    table = bench().both(T_max=0.25, U_max=14.0).control(Omega_max=6.0, Omega_E=0.05, K_i=20.0)
    machine = core_machine(table)
    machine.set("controller.delta_t", 2e-3)
    motion = step(0.4, at=0.2) + move(-0.3, 2, 20, 400, start=0.9, origin=0.4)
    names = ("motors.T_max", "motors.U_max", "motors.omega_max", "controller.Omega_E",
             "controller.K_i", "controller.K_v", "controller.k_p", "controller.delta_t",
             "meshes.gap", "table.J", "motors.L", "motors.R", "motors.K_d")  # fmt: skip
    return Case(machine, motion, 1.1, names)


def bench_default() -> Case:
    names = (*MECHANICS, *CONTROL, *TENSION, "initial.omega_c1")
    return Case(core_machine(bench()), sine(0.1, 1.0), 1.5, names, {"omega_c1": 0.05})


def heavy_default() -> Case:
    names = ("meshes.gap", "mesh_1.stiffness", "table.J", "mesh_damping@mesh_1.coefficient",
             "coulomb@table.torque", "coulomb@pinion_2.torque", "controller.K_v",
             "controller.T_ten", "controller.g_E")  # fmt: skip
    machine = core_machine(heavy_table(250))
    return Case(machine, move(0.02, 0.03, 0.05, 0.3, start=1.0), 3.0, names)


@pytest.mark.long
@pytest.mark.parametrize(
    "case",
    [plain, mesh_damping, dry_friction, sampled_loops, differenced_encoder, slave_lag, saturations,
     bench_default, heavy_default],
)  # fmt: skip
def test_sensitivities_are_the_slopes_of_the_runs(case: Callable[[], Case]) -> None:
    this = case()
    times = this.away_from_switches()
    assert len(times) > 12
    nominal = this.run(times, rtol=1e-11, sensitivities=this.parameters)
    for path in this.parameters:
        wrong, seen = errors(this, nominal, times, path)
        assert wrong < ALLOWED, (path, wrong)
        assert seen > 1e-3, f"{path} does nothing here"


def errors(case: Case, nominal: Run, times: Array, path: str) -> tuple[float, float]:
    """Return the worst relative error, the better step size counting, and the largest effect.

    Effects are those of the whole parameter, over the peak of the signal.
    """
    size, worst, largest = case.size(path), dict.fromkeys(SIGNALS, np.inf), 0.0
    for h in STEPS:
        up, down = (case.run(times, path, sign * h * size, rtol=1e-12) for sign in (1, -1))
        for name in SIGNALS:
            slope = nominal.slope(name, path) * size
            difference = (up[name] - down[name]) / (2 * h)
            peak = np.abs(nominal[name]).max()
            error = np.abs(slope - difference).max() - SOLVER * peak / h
            effect = max(np.abs(slope).max(), np.abs(difference).max())
            worst[name] = min(worst[name], max(error, 0.0) / max(effect, 1e-6 * peak))
            largest = max(largest, effect / peak)
    return max(worst.values()), largest


# --------------------------------------------------------------------------------- closed forms


def free_bounce() -> tuple[_core.Machine, float, float, float, dict[str, float]]:
    """One flight, one contact, one flight back: x = Δ − v (t − Δ/v − π/ω), ω = √(K/J).

    Returns machine, v, a time of the flight back, x then, and the slopes of x by parameter.
    """
    machine = _core.Machine()
    machine.add_body("pinion_1")
    machine.add_body("table", locked=True)
    machine.connect("mesh_1", "pinion_1", "table", "gap", "driver")
    K, J, gap, v = 1e6, 1.0, 1e-3, 0.1
    for name, value in {"pinion_1.J": J, "mesh_1.stiffness": K, "mesh_1.gap": gap}.items():
        machine.set(name, value)
    held, end = np.pi * np.sqrt(J / K), 0.02
    slopes = {"mesh_1.gap": 2.0, "mesh_1.stiffness": -v * held / (2 * K),
              "pinion_1.J": v * held / (2 * J), "initial.omega_c1": held - end}  # fmt: skip
    return machine, v, end, gap - v * (end - gap / v - held), slopes


def test_slopes_of_a_free_bounce() -> None:
    machine, v, end, x, slopes = free_bounce()
    seen = run(machine, end=end, initial={"omega_c1": v}, times=[end], rtol=1e-12,
               sensitivities=list(slopes))  # fmt: skip
    assert seen["mesh_1.twist"][0] == pytest.approx(x, rel=1e-9)
    for name, expected in slopes.items():
        assert seen.slope("mesh_1.twist", name)[0] == pytest.approx(expected, rel=1e-7), name


def test_slopes_of_a_body_that_stops_and_breaks_loose() -> None:
    """Stopped by dry friction F after J ω/F, moved on by a ramp r t from F/r: all known."""
    machine = _core.Machine()
    machine.add_body("table")
    machine.set("table.J", 2.0)
    machine.set(f"{machine.add_effect('coulomb', 'table')}.torque", 10.0)
    J, F, w, rate, since = 2.0, 10.0, 1.0, -20.0, 1.0  # a load of −20 N m/s pushes forwards
    names = ("table.J", "coulomb@table.torque", "initial.omega_m")
    seen = run(
        machine, {"T_load": _core.ramp(rate, since)}, 3.0, initial={"omega_m": w}, times=[0.5, 3.0],
        rtol=1e-12, sensitivities=names,
    )  # fmt: skip
    slip = 3.0 - since - F / -rate
    angle = J * w**2 / (2 * F) - rate * slip**3 / (6 * J)
    assert seen["theta_m"][1] == pytest.approx(angle, rel=1e-9)
    expected = {
        "table.J": w**2 / (2 * F) + rate * slip**3 / (6 * J**2),
        "coulomb@table.torque": -J * w**2 / (2 * F**2) - slip**2 / (2 * J),
        "initial.omega_m": J * w / F,
    }
    for name, slope in expected.items():
        assert seen.slope("theta_m", name)[1] == pytest.approx(slope, rel=1e-7), name
        assert seen.slope("omega_m", name)[0] == 0.0  # at rest


def test_grazing_is_counted() -> None:
    """A flank that is just not reached: the sensitivity has a kink there, and says so."""
    machine = _core.Machine()
    for body, locked in (("pinion_1", False), ("table", True), ("frame", True)):
        machine.add_body(body, locked=locked)
    machine.connect("mesh_1", "pinion_1", "table", "gap", "driver")
    machine.connect("spring_1", "pinion_1", "frame", "compliant", "driver")
    machine.set("mesh_1.stiffness", 1e4)
    machine.set("spring_1.stiffness", 1e4)
    counts = []
    for beyond in (1e-3, 1e-9):
        machine.set("mesh_1.gap", 1e-3 * (1 - beyond))
        seen = run(machine, end=0.2, initial={"omega_c1": 0.1}, sensitivities=["mesh_1.gap"])
        counts.append(seen.raw.statistics["grazing"])
    assert counts[0] == 0
    assert counts[1] > 0


def test_a_sample_time_has_no_slope() -> None:
    machine = core_machine(bench())
    with pytest.raises(ValueError, match=r"speed_sample: a sample time has no derivative"):
        _core.simulate(machine, core_inputs(sine(0.1, 1.0)), end=0.1,
                       sensitivities=["controller.speed_sample"])  # fmt: skip

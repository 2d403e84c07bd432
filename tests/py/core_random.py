"""Random machines with everything a machine may have, for laws that hold whatever their numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from core_effects import placed
from core_machines import set_all
from dualdrive import _core


@dataclass(frozen=True)
class Scale:
    """A kind of machine: what its numbers are about."""

    i: float
    i_m: float
    motor: dict[str, float]
    motor_body: dict[str, float]
    pinion: dict[str, float]
    table: dict[str, float]
    mesh: dict[str, float]
    damping: float
    controller: dict[str, float]
    friction: dict[str, float]  # dry friction of table, pinion, motor, N m
    move: tuple[float, float, float, float]
    load: float


HEAVY = Scale(
    150, 20,
    {"K_d": 1.155, "C_e": 1.155, "R": 0.15, "L": 3e-3, "U_max": 400, "T_max": 200, "T_rated": 100,
     "omega_max": 157},
    {"J": 0.045, "b": 0.02}, {"J": 60, "b": 200}, {"J": 6e6, "b": 1e5},
    {"stiffness": 2e7, "gap": 1.1e-3}, 2e4,
    {"K_v": 5, "K_i": 1, "K_d": 0.3, "k_p": 2e5, "T_N": 0.1, "g_E": 0.5, "T_E": 0.1,
     "Omega_E": 0.1, "T_ten": 60, "tau_t": 0.1, "omega_ci": 800, "T_off": 150},
    {"table": 2e3, "pinion": 300, "motor": 2}, (0.02, 0.03, 0.05, 0.3), 1e5,
)  # fmt: skip
BENCH = Scale(
    10, 4,
    {"K_d": 0.289, "C_e": 0.289, "R": 2, "L": 6e-3, "U_max": 60, "T_max": 3.8, "T_rated": 1.27,
     "omega_max": 314},
    {"J": 2.8e-5, "b": 5e-5}, {"J": 2e-4, "b": 2e-3}, {"J": 0.2, "b": 0.02},
    {"stiffness": 200, "gap": 4.4e-3}, 0.05,
    {"K_v": 20, "K_i": 10, "K_d": 0.1, "k_p": 0.5, "T_N": 0.05, "g_E": 0.5, "T_E": 0.1,
     "Omega_E": 3, "T_ten": 0.12, "tau_t": 0.05, "omega_ci": 1500, "T_off": 1.0},
    {"table": 0.1, "pinion": 0.02, "motor": 2e-3}, (0.3, 1.5, 5, 50), 1.0,
)  # fmt: skip
OPTIONAL = ("K_i", "K_d", "T_N", "g_E", "T_E", "tau_t")  # of the controller: may be off


class RandomMachine:
    """One machine with its inputs, start and a description of what it has."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)
        self.scale = HEAVY if self.random.random() < 0.5 else BENCH
        self.drives = int(self.random.integers(1, 4))
        self.machine = _core.Machine()
        self.notes = [f"seed {seed}", f"{self.drives} drives"]
        self.assemble()
        self.number()
        self.control()
        for _ in range(int(self.random.integers(0, 6))):
            self.add_effect()
        self.inputs = {"theta_ref": self.command(), "T_load": self.load()}
        self.initial = self.start()

    def chance(self, probability: float, note: str = "") -> bool:
        happens = bool(self.random.random() < probability)
        if happens and note:
            self.notes.append(note)
        return happens

    def near(self, value: float) -> float:
        return float(value * np.exp(self.random.uniform(-0.7, 0.7)))

    def pick(self, *choices: str) -> str:
        choice = str(self.random.choice(choices))
        self.notes.append(choice)
        return choice

    def assemble(self) -> None:
        machine, numbers = self.machine, range(1, self.drives + 1)
        self.direct = self.chance(0.15, "direct")
        for n in numbers:
            machine.add_body(f"motor_{n}")
            machine.add_body(f"pinion_{n}")
        machine.add_body("table")
        for n in numbers:
            gearbox = self.pick("rigid", "rigid", "compliant", "gap")
            mesh = self.pick("gap", "gap", "gap", "compliant", "rigid" if n == 1 else "gap")
            machine.connect(f"gearbox_{n}", f"motor_{n}", f"pinion_{n}", gearbox, "driven")
            machine.connect(f"mesh_{n}", f"pinion_{n}", "table", mesh, "driver")
        for n in numbers:
            machine.add_motor(f"motor_{n}", kind="direct" if self.direct else "armature")

    def number(self) -> None:
        machine, scale = self.machine, self.scale
        stiffer = self.near(5)
        for n in range(1, self.drives + 1):
            motor = {name: self.near(value) for name, value in scale.motor.items()}
            motor["C_e"] = motor["K_d"]
            set_all(machine, f"motor_{n}", motor)
            for limit in ("T_max", "U_max"):
                if self.chance(0.5, f"tight {limit}"):
                    machine.set(f"motor_{n}.{limit}", motor[limit] / 6)
            for part, values in ((f"motor_{n}", scale.motor_body), (f"pinion_{n}", scale.pinion)):
                set_all(machine, part, {name: self.near(value) for name, value in values.items()})
            machine.set(f"gearbox_{n}.ratio", scale.i)
            machine.set(f"mesh_{n}.ratio", scale.i_m)
            self.join(f"gearbox_{n}", stiffer * scale.mesh["stiffness"], scale.mesh["gap"] / 5)
            self.join(f"mesh_{n}", scale.mesh["stiffness"], scale.mesh["gap"])
        set_all(machine, "table", {name: self.near(v) for name, v in scale.table.items()})

    def join(self, connection: str, stiffness: float, gap: float) -> None:
        kind = self.machine.kind(connection)
        if kind == "rigid":
            return
        self.machine.set(f"{connection}.stiffness", self.near(stiffness))
        if kind == "compliant":
            self.machine.set(f"{connection}.preload", self.near(stiffness * gap / 4))
        elif self.chance(0.1, "no gap"):
            self.machine.set(f"{connection}.gap", 0.0)
        else:
            self.machine.set(f"{connection}.gap", self.near(gap))

    def control(self) -> None:
        machine, scale = self.machine, self.scale
        machine.set_controller(
            equaliser=self.pick("both", "slave", "master"),
            tension=self.pick("constant", "off" if self.direct else "falling", "off"),
            current="voltage" if self.chance(0.1, "voltage") else "cascade",
        )
        law = {name: self.near(value) for name, value in scale.controller.items()}
        for name in OPTIONAL:
            if self.chance(0.4):
                law[name] = 0.0
        if self.direct:
            law["g_E"] = 0.0
        set_all(machine, "controller", law)
        machine.set("controller.w", float(self.random.uniform(0.3, 0.7)))
        if self.chance(0.2, "slave lag"):
            machine.set("controller.delta_t", float(self.random.uniform(1e-3, 1e-2)))
        for loop, time in (
            ("position", 2e-3),
            ("tension", 2e-3),
            ("speed", 5e-4),
            ("current", 1e-4),
        ):
            if self.chance(0.15, f"sampled {loop}"):
                machine.set(f"controller.{loop}_sample", time)
                if self.chance(0.5, "latency"):
                    machine.set(f"controller.{loop}_latency", 0.6 * time)

    def add_effect(self) -> None:
        places = [f"pinion_{self.random.integers(1, self.drives + 1)}", "table"]
        motor = f"motor_{self.random.integers(1, self.drives + 1)}"
        types = [kind.name for kind in _core.effect_types()] + ["expression"]
        kind = self.pick(*types)
        body = str(self.random.choice([*places, motor]))
        level = self.near(self.scale.friction[body.split("_")[0]])
        still = self.near(2e-3) * {"table": 1, "pinion": 20, "motor": 2000}[body.split("_")[0]]
        values: dict[str, float]
        match kind:
            case "viscous":
                place, values = body, {"coefficient": level / (10 * still)}
            case "coulomb":
                values = {"torque": level, "asymmetry": float(self.random.uniform(-0.5, 0.5))}
                place = body
            case "stribeck":
                place, values = body, {"torque": level, "static_ratio": 1.4, "speed": still}
            case "lugre":
                stiffness = 200 * level / still
                place, values = body, {"torque": level, "speed": still, "stiffness": stiffness,
                                       "damping": 0.1 * level / still}  # fmt: skip
            case "mesh_damping":
                mesh = f"mesh_{self.random.integers(1, self.drives + 1)}"
                if self.machine.kind(mesh) == "rigid":
                    return
                place, values = mesh, {"coefficient": self.near(self.scale.damping)}
            case "eccentricity":
                place = places[0]
                if self.machine.kind(place.replace("pinion", "mesh")) == "rigid":
                    return
                values = {"amplitude": self.near(self.scale.mesh["gap"] / 3), "phase": 1.0}
            case "cogging":
                place, values = motor, {"amplitude": self.scale.friction["motor"], "order": 12.0}
            case "torque_ripple":
                place, values = motor, {"amplitude": 0.05, "order": 6.0}
            case "sensor_delay":
                place, values = self.pick("table", motor), {"time": self.near(1e-3)}
            case "sensor_offset":
                place, values = "table", {"value": 1e-5}
            case "expression":
                self.add_expression(body, level, still)
                return
            case _:
                found = placed(kind, self, body, level, still)
                if found is None:
                    return
                place, values = found
        if kind == "sensor_delay" and any(e["effect"] == kind for e in self.machine.effects):
            return
        set_all(self.machine, self.machine.add_effect(kind, place), values)

    def add_expression(self, body: str, level: float, still: float) -> None:
        formula = self.pick("-c * speed * abs(speed)", "-a * tanh(speed / v)",
                            "-a * min(1, max(-1, speed / v))", "-a * sin(angle)")  # fmt: skip
        self.machine.add_expression(
            body, formula,
            [(name, unit, value) for name, unit, value in
             (("a", "N*m", level), ("c", "N*m*s^2", level / still**2 / 100), ("v", "rad/s", still))
             if name in formula.replace("tanh", "").replace("abs", "").replace("max", "")],
        )  # fmt: skip

    def command(self) -> _core.Waveform:
        distance, v, a, j = self.scale.move
        match self.pick("move", "sine", "step"):
            case "move":
                return _core.jerk_limited_move(distance, v, a, j, start=0.05)
            case "sine":
                return _core.sine(distance / 4, self.near(1.0))
            case _:
                return _core.step(distance / 40, 0.1)

    def load(self) -> _core.Waveform:
        match self.pick("unloaded", "sine load", "step load", "ramp load"):
            case "sine load":
                return _core.sine(self.scale.load, self.near(2.0))
            case "step load":
                return _core.step(self.scale.load, 0.3)
            case "ramp load":
                return _core.ramp(self.scale.load, 0.2)
            case _:
                return _core.constant(0.0)

    def start(self) -> dict[str, float]:
        if not self.chance(0.3, "moving start"):
            return {}
        states = [
            name for name, unit in self.machine.states() if unit == "rad/s" and "omega" in name
        ]
        speed = self.scale.move[1] / 10
        return {name: float(self.random.normal() * speed) for name in states if name != "omega_m"}

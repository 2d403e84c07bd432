"""Random machines whose laws are affine between switches, with motions and loads of every kind.

Whatever such machines may have is drawn: trains, contacts, dry friction, limits, sampled loops,
tension schedules, formulas.
"""

from __future__ import annotations

import numpy as np

from core_machines import set_all
from core_random import RandomMachine
from dualdrive import _core

EFFECTS = ("viscous", "coulomb", "coulomb", "mesh_damping", "mesh_damping", "sensor_offset")
FORMULAS = {  # of a body; a in N m, c in N m s/rad. A law that jumps with the speed would chatter
    "-c * speed": "c",
    "-a * sign(in.shove)": "a",
    "-c * min(speed, 0) + a * in.shove": "ac",
    "if(speed > 0, -c, -c / 3) * speed + a / 2": "ac",
    "min(a, max(-a, -c * speed))": "ac",
    "-c * max(0, abs(speed) - a / c) * sign(speed)": "ac",
}
RUN = 4.0  # s, usual length of a run


class AffineMachine(RandomMachine):
    """One machine with its inputs, start, length and grid."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self.seed = seed
        if any("in.shove" in str(effect) for effect in self.machine.effects):
            self.inputs["shove"] = self.shove()
        self.end = RUN * float(self.random.uniform(0.5, 1.5))
        self.output_step = float(self.random.choice([1e-3, 1e-3, 1e-3, 2e-3, 1e-2, 2.5e-4, 7.3e-4]))
        self.finer = int(self.random.choice([3, 3, 5]))  # a grid so much finer shares no step

    # ------------------------------------------------------------------------------------ parts

    def assemble(self) -> None:
        self.train = self.pick("dual", "dual", "dual", "double pinion")
        if self.train == "dual":
            return super().assemble()
        self.drives, self.direct = 1, self.chance(0.15, "direct")
        machine = self.machine
        for body in ("motor_1", "pinion_1", "pinion_2", "table"):
            machine.add_body(body)
        machine.connect("gearbox_1", "motor_1", "pinion_1", self.pick("rigid", "gap"), "driven")
        machine.connect("split_shaft", "pinion_1", "pinion_2", self.pick("compliant", "gap"))
        for n in (1, 2):
            machine.connect(f"mesh_{n}", f"pinion_{n}", "table", "gap", "driver")
        return machine.add_motor("motor_1", kind="direct" if self.direct else "armature")

    def number(self) -> None:
        super().number()
        if self.train == "dual":
            return
        machine, scale = self.machine, self.scale
        set_all(machine, "pinion_2", {k: self.near(v) for k, v in scale.pinion.items()})
        machine.set("split_shaft.ratio", 1.0)
        machine.set("mesh_2.ratio", scale.i_m)
        self.join("split_shaft", 3 * scale.mesh["stiffness"], scale.mesh["gap"] / 5)
        self.join("mesh_2", scale.mesh["stiffness"], scale.mesh["gap"])

    def control(self) -> None:
        machine = self.machine
        super().control()
        machine.set("controller.delta_t", 0.0)
        clocked = [
            loop for loop in ("tension", "speed") if machine.get(f"controller.{loop}_sample")
        ]
        if "speed" in clocked and self.chance(0.3, "encoder"):
            machine.set_controller(**machine.controller_options | {"speed_samples": 3})
        if self.direct and "speed" in clocked and self.chance(0.5, "falling, direct"):
            machine.set_controller(**machine.controller_options | {"tension": "falling"})
        if self.chance(0.3, "tight Omega_E"):
            machine.set("controller.Omega_E", self.scale.controller["Omega_E"] / 30)
        if self.chance(0.3, "tight omega_max"):
            machine.set("motors.omega_max", self.scale.motor["omega_max"] / 20)
        if self.chance(0.3, "restless"):  # a loop that hunts through its play
            machine.set("controller.K_v", 6 * self.scale.controller["K_v"])
            machine.set("controller.K_i", 20 * self.scale.controller["K_i"])

    def add_effect(self) -> None:
        if self.chance(0.15):
            return self.add_formula()
        kind = self.pick(*EFFECTS)
        pinions = 2 if self.train == "double pinion" else self.drives
        body = self.pick(
            "table", f"motor_{self.number_of(self.drives)}", f"pinion_{self.number_of(pinions)}"
        )
        level, still = self.level(body)
        match kind:
            case "viscous":
                place, values = body, {"coefficient": level / (10 * still)}
            case "coulomb":
                place, values = body, {"torque": level, "asymmetry": self.random.uniform(-0.9, 0.9)}
            case "mesh_damping":
                place = f"mesh_{self.number_of(pinions)}"
                if self.machine.kind(place) == "rigid":
                    return None
                weight = 10 ** self.random.uniform(-2, 1.5)
                values = {"coefficient": weight * self.near(self.scale.damping)}
            case _:
                encoder = self.machine.controller_options["speed_samples"] > 0
                place, values = "table" if encoder or "pinion" in body else body, {"value": 1e-5}
        if any(e["effect"] == kind and place in e["members"] for e in self.machine.effects):
            return None
        return set_all(self.machine, self.machine.add_effect(kind, place), values)

    def add_formula(self) -> None:
        body = self.pick("table", "motor_1", "pinion_1")
        level, still = self.level(body)
        formula = self.pick(*FORMULAS)
        numbers = {"a": ("N*m", level), "c": ("N*m*s/rad", level / (10 * still))}
        self.machine.add_expression(body, formula, [(n, *numbers[n]) for n in FORMULAS[formula]])

    def number_of(self, count: int) -> int:
        return int(self.random.integers(1, count + 1))

    def level(self, body: str) -> tuple[float, float]:
        """Return a usual torque of friction at a body and a low speed of it."""
        kind = body.split("_")[0]
        level = self.near(self.scale.friction[kind])
        return level, self.near(2e-3) * {"table": 1, "pinion": 20, "motor": 2000}[kind]

    # ----------------------------------------------------------------------------------- inputs

    def command(self) -> _core.Waveform:
        distance, v, a, j = self.scale.move
        near, some = self.near, self.random
        match self.pick(
            "move", "cycle", "sine", "multisine", "step", "hold", "linear", "cubic", "ramp"
        ):
            case "move":
                return _core.jerk_limited_move(distance, v, a, j, start=0.05)
            case "cycle":
                targets = some.uniform(-distance / 3, distance / 3, 4)
                return _core.cycle_of_moves(targets, v, a, some.choice([j, np.inf]), 0.1, repeats=3)
            case "sine":
                return _core.sine(distance / 4, near(2.5), phase=some.uniform(0, 6))
            case "multisine":
                return _core.odd_multisine(distance / 20, near(1.0), 6, seed=self.number_of(999))
            case "step":
                steps = [
                    _core.step(some.normal() * distance / 40, t) for t in some.uniform(0, RUN, 8)
                ]
                return _core.sum(steps)
            case "ramp":
                return _core.ramp(v / 3, 0.1, near(1.0)) + _core.sine(
                    distance / 30, near(3.0), start=0.2
                )
            case way:
                return self.recorded(distance / 5, _core.Interpolation[way])

    def recorded(self, size: float, way: _core.Interpolation) -> _core.Waveform:
        t = np.arange(0.0, RUN, float(self.random.choice([4e-3, 1e-2, 0.05])))
        if self.chance(0.3, "uneven samples"):
            t[1:-1] += self.random.uniform(-0.4, 0.4, t.size - 2) * (t[1] - t[0])
        x = size * np.sin(2 * np.pi * self.near(0.8) * t)
        if way is _core.Interpolation.hold:
            x = np.round(x / size * 50) / 50 * size
        return _core.sampled(t, x, way)

    def load(self) -> _core.Waveform:
        near, load = self.near, self.scale.load
        match self.pick(
            "unloaded", "sine load", "step load", "ramp load", "shaken", "sampled load"
        ):
            case "sine load":
                return _core.sine(load, near(2.0))
            case "step load":
                heights = self.random.normal(size=6) * load
                times = self.random.uniform(0, RUN, heights.size)
                return _core.sum(list(map(_core.step, heights, times)))
            case "ramp load":
                return _core.ramp(load, 0.2, near(1.0))
            case "shaken":
                return _core.odd_multisine(
                    load / 2, near(5.0), 8, seed=self.number_of(999), start=0.1
                )
            case "sampled load":
                return self.recorded(load, _core.Interpolation.linear)
            case _:
                return _core.constant(0.0)

    def shove(self) -> _core.Waveform:
        return self.recorded(1.0, _core.Interpolation.hold) + _core.sine(0.5, self.near(4.0))

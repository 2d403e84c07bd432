"""The reference model's equations: one affine system ż = A z and its guards for each mode."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference_machine import Drive, Machine

Array = NDArray[np.float64]
Modes = dict[str, str]  # what each switching element does just now
FLANK = {"front": 1, "back": -1}  # every other state of a mesh transmits nothing

PLANT = ("omega_c1", "omega_c2", "x_1", "x_2", "I_1", "I_2", "theta_m", "omega_m")
CONTROL = (
    "following", "error_lag", "tension", "equaliser",
    "speed_1", "speed_2", "current_1", "current_2",
)  # fmt: skip
COMMAND = ("theta_ref", "omega_ref", "alpha_ref", "jerk_ref", "T_load", "load_rate")


class Guard(NamedTuple):
    """An affine quantity that is positive while `element` stays as it is, and what comes next."""

    row: Array
    element: str
    successors: tuple[str, ...]  # the first one whose own guards hold
    vanishing: int | None = None  # state that is exactly zero at the crossing


class Assembly:
    """The machine's equations in one mode, written as rows over the states."""

    def __init__(self, machine: Machine, frequencies: tuple[float, ...], modes: Modes) -> None:
        waves = [f"{part}_{k}" for k in range(len(frequencies)) for part in ("sine", "cosine")]
        self.names = (*PLANT, *CONTROL, *COMMAND, *waves, "one")
        self.state = dict(zip(self.names, np.eye(len(self.names)), strict=True))
        self.rate = dict.fromkeys(self.names, self.zero)  # a row is replaced, never changed
        self.outputs: dict[str, Array] = {}
        self.guards: list[Guard] = []
        self.machine, self.modes = machine, modes
        self._sliding: list[tuple[str, str, float, Array, Array, float]] = []
        self.command(frequencies)
        self.control()
        self.plant()
        for slide in self._sliding:
            self._slide(*slide)

    @property
    def zero(self) -> Array:
        return np.zeros(len(self.names))

    @property
    def A(self) -> Array:
        return np.array([self.rate[name] for name in self.names])

    def command(self, frequencies: tuple[float, ...]) -> None:
        """Polynomial pieces and sines as states of a generator."""
        s, rate = self.state, self.rate
        rate["theta_ref"], rate["omega_ref"] = s["omega_ref"], s["alpha_ref"]
        rate["alpha_ref"], rate["T_load"] = s["jerk_ref"], s["load_rate"]
        theta, omega = s["theta_ref"], s["omega_ref"]
        for k, frequency in enumerate(frequencies):
            turn = 2 * pi * frequency
            rate[f"sine_{k}"], rate[f"cosine_{k}"] = turn * s[f"cosine_{k}"], -turn * s[f"sine_{k}"]
            theta, omega = theta + s[f"sine_{k}"], omega + turn * s[f"cosine_{k}"]
        self.outputs |= {"command": theta, "command_speed": omega}

    def plant(self) -> None:
        """Eq. 1-8 with the mesh torques of Eq. 15-17 and dry friction."""
        s, rate, machine = self.state, self.rate, self.machine
        driving = -machine.b_m * s["omega_m"] - s["T_load"]
        for n, drive in enumerate(machine.drives, start=1):
            omega, current = s[f"omega_c{n}"], s[f"I_{n}"]
            voltage = self.outputs.setdefault(f"U_{n}", self.zero)
            torque = self.mesh(n, drive)
            rate[f"x_{n}"] = omega - machine.i_m * s["omega_m"]
            rate[f"I_{n}"] = (voltage - drive.R * current - drive.K_e * omega) / drive.L
            net = drive.K_m * current - drive.b * omega - torque
            rate[f"omega_c{n}"] = self.dry(
                f"pinion_{n}", f"omega_c{n}", net, drive.friction, drive.J
            )
            driving = driving + machine.i_m * torque
            self.outputs[f"mesh_torque_{n}"] = torque
            self.outputs[f"theta_c{n}"] = s[f"x_{n}"] + machine.i_m * s["theta_m"]
        rate["theta_m"] = s["omega_m"]
        rate["omega_m"] = self.dry("table", "omega_m", driving, machine.friction, machine.J_m)

    def mesh(self, n: int, drive: Drive) -> Array:
        """T = K dz(x) + cẋ; a flank never pulls, so it is free where K dz and cẋ cancel."""
        element, mode = f"mesh_{n}", self.modes.get(f"mesh_{n}")
        x, gap = self.state[f"x_{n}"], drive.gap * self.state["one"]
        closing = self.state[f"omega_c{n}"] - self.machine.i_m * self.state["omega_m"]
        if mode is None:
            return drive.K_t * x + drive.c * closing
        if mode == "gap":
            self.guards += [
                Guard(gap - x, element, ("front", "front free") if drive.c else ("front",)),
                Guard(x + gap, element, ("back", "back free") if drive.c else ("back",)),
            ]
            return self.zero
        flank = mode.removesuffix(" free")
        side = FLANK[flank]
        torque = drive.K_t * (x - side * gap) + drive.c * closing
        if not drive.c:
            self.guards.append(Guard(side * x - gap, element, ("gap",)))
        elif mode == flank:
            self.guards.append(Guard(side * torque, element, (flank + " free", "gap")))
        else:
            self.guards.append(Guard(-side * torque, element, (flank,)))
            self.guards.append(Guard(side * x - gap, element, ("gap",)))
        return torque if mode == flank else self.zero

    def dry(
        self, element: str, speed: str, net: Array, friction: tuple[float, float], inertia: float
    ) -> Array:
        """Return the acceleration under a net torque and Coulomb friction that truly sticks."""
        if element not in self.modes:
            return net / inertia
        forward, backward = (level * self.state["one"] for level in friction)
        index = self.names.index(speed)
        if self.modes[element] == "stuck":
            self.guards += [
                Guard(forward - net, element, ("forward",)),
                Guard(backward + net, element, ("backward",)),
            ]
            return self.zero
        if self.modes[element] == "forward":
            successors = ("stuck", "backward")
            self.guards.append(Guard(self.state[speed], element, successors, index))
            return (net - forward) / inertia
        self.guards.append(Guard(-self.state[speed], element, ("stuck", "forward"), index))
        return (net + backward) / inertia

    def control(self) -> None:
        """Master/slave law: position loop, tension and equaliser, speed loops, current loops."""
        law = self.machine.controller
        if law is None:
            return
        s, rate, one = self.state, self.rate, self.state["one"]
        error = self.outputs["command"] - s["theta_m"]
        error_rate = (error - s["error_lag"]) / law.tau_d
        rate["error_lag"] = error_rate
        wanted = law.K_v * error + law.K_i * s["following"] + law.K_d * error_rate
        wanted = self.machine.i_m * (wanted + law.f_v * self.outputs["command_speed"])
        gain = self.machine.i_m * law.K_i
        wanted = self.limit("following", wanted, law.Omega_max, error, gain)

        tension = law.T_ten * one
        if law.tau_t:
            rate["tension"] = (tension - s["tension"]) / law.tau_t
            tension = s["tension"]
        motor = [drive.K_d * s[f"I_{n}"] for n, drive in enumerate(self.machine.drives, start=1)]
        unequal = 2 * (law.w * motor[0] - (1 - law.w) * motor[1]) - tension
        y = law.K_E * (unequal + s["equaliser"])
        y = self.limit("equaliser", y, law.Omega_E, unequal / law.T_E, law.K_E)

        for n, (drive, share) in enumerate(zip(self.machine.drives, law.equalises, strict=True), 1):
            slip = wanted + share * y - s[f"omega_c{n}"]
            gain, top = law.k_p / drive.i, drive.T_max
            if law.omega_ci is None:
                gain, top = law.k_p, drive.U_max
            effort = gain * (slip + s[f"speed_{n}"])
            effort = self.limit(f"speed_{n}", effort, top, slip / law.T_N, gain)
            self.outputs[f"U_{n}"] = effort
            if law.omega_ci is not None:
                self.current_loop(n, drive, law.omega_ci, effort)
        self.outputs |= {"error": error, "speed_set": wanted, "equalising": y}

    def current_loop(self, n: int, drive: Drive, bandwidth: float, torque: Array) -> None:
        lack = torque / drive.K_d - self.state[f"I_{n}"]
        voltage = bandwidth * (drive.L * lack + drive.R * self.state[f"current_{n}"])
        voltage = voltage + drive.K_e * self.state[f"omega_c{n}"]
        gain = bandwidth * drive.R
        voltage = self.limit(f"current_{n}", voltage, drive.U_max, lack, gain)
        self.outputs |= {f"U_{n}": voltage, f"T_set_{n}": torque}

    def limit(self, element: str, value: Array, top: float, rate: Array, gain: float) -> Array:
        """Return value = … + gain·(integral of that name) limited to ±top.

        The integral grows with `rate` unless the value is beyond the limit and would go further.
        Where the integral drives the value out while all else drives it back, it advances just so
        far that the value stays at the limit ("slides").
        """
        self.rate[element] = rate
        if element not in self.modes:
            return value
        one, mode = self.state["one"], self.modes[element]
        slides = gain > 0 and bool(np.any(rate))
        if mode == "free":
            up, down = (
                (f"{end} held", f"{end} slides", f"{end} returns") if slides else (f"{end} held",)
                for end in ("high", "low")
            )
            self.guards += [
                Guard(top * one - value, element, up),
                Guard(value + top * one, element, down),
            ]
            return value
        end, state = mode.split()
        side = 1.0 if end == "high" else -1.0
        beyond = Guard(side * value - top * one, element, ("free", f"{end} slides")[: 1 + slides])
        if state == "held":
            self.rate[element] = self.zero
            turning = Guard(side * rate, element, (f"{end} returns",))
            self.guards += [beyond, turning] if slides else [beyond]
        elif state == "returns":
            self.guards += [beyond, Guard(-side * rate, element, (f"{end} held",))]
        else:
            self.rate[element] = self.zero
            self._sliding.append((element, end, side, value, rate, gain))
        return side * top * one

    def _slide(
        self, element: str, end: str, side: float, value: Array, rate: Array, gain: float
    ) -> None:
        needed = -(value @ self.A) / gain
        self.rate[element] = needed
        self.guards += [
            Guard(side * needed, element, (f"{end} held", f"{end} returns")),
            Guard(side * (rate - needed), element, ("free",)),
        ]


def first_modes(machine: Machine, start: Mapping[str, float]) -> Modes:
    """Return the elements that switch, and a first guess of what they do; `settle` mends it."""
    modes: Modes = {f"mesh_{n}": "gap" for n, drive in enumerate(machine.drives, 1) if drive.gap}
    frictions = {"table": (machine.friction, "omega_m")}
    frictions |= {
        f"pinion_{n}": (drive.friction, f"omega_c{n}") for n, drive in enumerate(machine.drives, 1)
    }
    for element, (friction, speed) in frictions.items():
        moving = start.get(speed, 0.0)
        if any(friction):
            modes[element] = "stuck" if moving == 0 else "forward" if moving > 0 else "backward"
    law = machine.controller
    if law is not None:
        limits = {"following": law.Omega_max, "equaliser": law.Omega_E}
        for n, drive in enumerate(machine.drives, 1):
            limits[f"speed_{n}"] = drive.U_max if law.omega_ci is None else drive.T_max
            limits[f"current_{n}"] = inf if law.omega_ci is None else drive.U_max
        modes |= {element: "free" for element, top in limits.items() if top < inf}
    return modes

"""The whole machine once more in one plain file: the oracle the product is tested against.

Plant, master/slave controller and commanded motion together are affine as long as no flank opens or
closes, nothing starts to stick or slip and no limit is reached: ż = A(mode) z, the last state being
the constant 1. Each mode is solved exactly with the matrix exponential; the end of a mode is a root
of a guard, searched on that exact solution. Nothing is integrated numerically.

Quantities are SI. Angles, speeds and torques of a pinion are pinion-side, T_motor is motor-side.
The pinion angles are carried as twists x_n = θ_cn − i_m θ_m of their meshes, so that rounding of an
absolute angle never reaches a contact torque.

Equation numbers are those of the source paper, with its misprints corrected (docs/theory).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from math import ceil, inf, pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, matrix_balance
from scipy.optimize import brentq

Array = NDArray[np.float64]
Modes = dict[str, str]  # what each switching element does just now
FLANK = {"front": 1, "back": -1}  # every other state of a mesh transmits nothing


# ---------------------------------------------------------------------------------- the machine


@dataclass(frozen=True)
class Drive:
    """One motor, its rigid reducer, its pinion and the pinion's mesh with the ring."""

    i: float  # motor speed / pinion speed
    J_d: float  # motor inertia, kg m²
    J_c: float  # pinion inertia, kg m²
    b_d: float  # viscous friction of the motor, N m s/rad
    b_c: float  # viscous friction of the pinion, N m s/rad
    K_d: float  # motor torque per current, N m/A
    C_e: float  # back EMF per motor speed, V s/rad
    R: float
    L: float
    K_t: float  # stiffness of the mesh at the pinion, N m/rad
    gap: float  # HALF gap at the pinion, rad; 0 = no backlash, one spring that pushes and pulls
    c: float = 0.0  # damping of the mesh at the pinion, N m s/rad
    friction: tuple[float, float] = (0.0, 0.0)  # dry friction of the pinion forward, backward, N m
    T_max: float = inf  # limit of the motor torque asked for, N m
    U_max: float = inf

    @property
    def J(self) -> float:
        return self.i**2 * self.J_d + self.J_c

    @property
    def b(self) -> float:
        return self.i**2 * self.b_d + self.b_c

    @property
    def K_m(self) -> float:
        return self.i * self.K_d

    @property
    def K_e(self) -> float:
        return self.i * self.C_e


@dataclass(frozen=True)
class Controller:
    """Position loop, torque equaliser with tension, two speed loops; speeds are pinion speeds."""

    K_v: float  # position loop, 1/s
    k_p: float  # pinion torque (or motor voltage, see omega_ci) per pinion speed
    T_N: float = inf  # integral time of the speed loops, s
    K_i: float = 0.0
    K_d: float = 0.0
    tau_d: float = 0.02
    f_v: float = 1.0  # weight of the speed feed-forward
    Omega_max: float = inf
    K_E: float = 0.0  # equaliser: pinion speed per motor torque
    T_E: float = inf
    Omega_E: float = inf
    T_ten: float = 0.0  # tension, the difference of the two motor torques, N m
    tau_t: float = 0.0  # its filter; 0 = none
    w: float = 0.5  # weight of the master's torque
    equalises: tuple[float, float] = (-1.0, 1.0)  # share of y each speed loop gets
    omega_ci: float | None = None  # current loop, rad/s; None: the speed loops set the voltage


@dataclass(frozen=True)
class Machine:
    """Two drives on one ring; without a controller the motor voltages are zero."""

    drives: tuple[Drive, Drive]
    i_m: float
    J_m: float
    b_m: float
    controller: Controller | None = None
    friction: tuple[float, float] = (0.0, 0.0)  # dry friction of the table forward, backward, N m

    def both(self, **changes: object) -> Machine:
        """Return the machine with the same change made to both drives."""
        first, second = (replace(drive, **changes) for drive in self.drives)  # type: ignore[arg-type]
        return replace(self, drives=(first, second))

    def control(self, **changes: object) -> Machine:
        """Return the machine with its controller changed."""
        assert self.controller is not None
        return replace(self, controller=replace(self.controller, **changes))  # type: ignore[arg-type]


def heavy_table(load: int = 0, *, dry_friction: bool = True) -> Machine:
    """Return the heavy rotary table carrying 0, 100, 250 or 550 t."""
    drive = Drive(
        i=150, J_d=0.045, J_c=60, b_d=0.02, b_c=200, K_d=1.155, C_e=1.155, R=0.15, L=3e-3,
        K_t=2e7, gap=1.1e-3, c=2e4, T_max=200, U_max=400,
    )  # fmt: skip
    k_p = 2e5
    controller = Controller(
        K_v=5, k_p=k_p, T_N=0.1, Omega_max=157 / drive.i, K_E=0.5 * drive.i / (2 * k_p), T_E=0.1,
        Omega_E=0.1, T_ten=60, tau_t=0.1, omega_ci=800,
    )  # fmt: skip
    workpiece = {0: 0.0, 100: 1.95e6, 250: 6.60e6, 550: 13.8e6}[load]
    machine = Machine((drive, drive), 20, 3.0e6 + workpiece, 1e5, controller)
    if not dry_friction:
        return machine
    return replace(machine.both(friction=(300.0, 300.0)), friction=(2e3, 2e3))


def bench() -> Machine:
    """Return the small laboratory machine."""
    drive = Drive(
        i=10, J_d=2.8e-5, J_c=2e-4, b_d=5e-5, b_c=2e-3, K_d=0.289, C_e=0.289, R=2, L=6e-3,
        K_t=200, gap=4.4e-3, c=0.05, T_max=3.8, U_max=280,
    )  # fmt: skip
    controller = Controller(
        K_v=20, k_p=0.5, T_N=0.05, Omega_max=31.4, K_E=5.0, T_E=0.1, Omega_E=3, T_ten=0.12,
        tau_t=0.05, omega_ci=1500,
    )  # fmt: skip
    return Machine((drive, drive), 4, 0.2, 0.02, controller)


def speed_study(variant: str = "H") -> Machine:
    """Return the loop of the speed study: PI speed loops on the voltage, equaliser on the slave."""
    K_t, b, gap, tension = {
        "S": (1e6, 50.0, 5e-4, 800.0),
        "M": (1e7, 200.0, 2e-4, 300.0),
        "H": (1e8, 1000.0, 5e-4, 800.0),
        "X": (1e8, 400.0, 5e-4, 800.0),
    }[variant]
    drive = Drive(i=1, J_d=0, J_c=20, b_d=0, b_c=b, K_d=30, C_e=30, R=0.3, L=5e-3, K_t=K_t, gap=gap)
    controller = Controller(
        K_v=4, k_p=200, T_N=0.2, K_E=2e-5, T_E=0.1, T_ten=tension, equalises=(0, 1)
    )
    return Machine((drive, drive), 10, 2e5, 2e3, controller)


# ------------------------------------------------------------------------ what it is told to do


@dataclass(frozen=True)
class Motion:
    """Commanded motion and load: generator states set anew at given times, plus sines from t = 0.

    Between its breakpoints θ_ref is a cubic and T_load (> 0 opposes positive motion) a line.
    """

    breakpoints: tuple[tuple[float, Mapping[str, float]], ...] = ()
    sines: tuple[tuple[float, float, float], ...] = ()  # amplitude rad, frequency Hz, phase rad

    def __add__(self, later: Motion) -> Motion:
        points = sorted(self.breakpoints + later.breakpoints, key=lambda point: point[0])
        return Motion(tuple(points), self.sines + later.sines)


def step(size: float, at: float = 0.0) -> Motion:
    return Motion(((at, {"theta_ref": size}),))


def sine(amplitude: float, frequency: float, phase: float = 0.0) -> Motion:
    return Motion(sines=((amplitude, frequency, phase),))


def load_ramp(rate: float, start: float = 0.0) -> Motion:
    return Motion(((start, {"load_rate": rate}),))


def move(
    distance: float, v: float, a: float, j: float, start: float, origin: float = 0.0
) -> Motion:
    """Return the shortest rest-to-rest move with speed, acceleration and jerk within v, a and j.

    The speed rises under jerk +j, 0, −j, holds, and falls likewise.
    """
    direction, distance = (1.0 if distance > 0 else -1.0), abs(distance)

    def ramp(
        top: float,
    ) -> tuple[float, float]:  # durations of constant jerk, constant acceleration
        return (a / j, top / a - a / j) if top >= a * a / j else (sqrt(top / j), 0.0)

    def length(
        top: float,
    ) -> float:  # distance covered by speeding up to top and slowing down again
        return top * (2 * ramp(top)[0] + ramp(top)[1])

    if length(v) > distance:
        v = float(brentq(lambda top: length(top) - distance, 0.0, v, xtol=1e-18, rtol=1e-15))
    t_j, t_a = ramp(v)
    t_v = (distance - length(v)) / v
    pieces = zip((t_j, t_a, t_j, t_v, t_j, t_a, t_j), (j, 0.0, -j, 0.0, -j, 0.0, j), strict=True)
    t, angle, speed, acceleration = start, 0.0, 0.0, 0.0
    points: list[tuple[float, Mapping[str, float]]] = []
    for span, jerk in pieces:
        point = {"alpha_ref": acceleration, "jerk_ref": jerk, "omega_ref": speed}
        point = {name: direction * value for name, value in point.items()}
        points.append((t, point | {"theta_ref": origin + direction * angle}))
        t += span
        angle += speed * span + acceleration * span**2 / 2 + jerk * span**3 / 6
        speed += acceleration * span + jerk * span**2 / 2
        acceleration += jerk * span
    rest = {
        "theta_ref": origin + direction * distance,
        "omega_ref": 0,
        "alpha_ref": 0,
        "jerk_ref": 0,
    }
    return Motion((*points, (t, rest)))


# ------------------------------------------------- the equations: one affine system for each mode

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


# ------------------------------------------------------------------- the exact solution of a mode

ORDER = 22  # of the Taylor series over one slice
EXPONENTS = np.arange(ORDER + 1)
SLICE = 0.5  # a slice lasts this over the fastest eigenvalue: 0.5^22/22! = 2e-28
ROUNDING = 1e-13  # below this share of its terms a quantity is zero


class Mode:
    """ż = A z with its guards: sampled, searched for the first crossing, and followed up to it."""

    def __init__(self, assembly: Assembly, grid: float) -> None:
        self.assembly, self.A, self.grid = assembly, assembly.A, grid
        self.guards = assembly.guards
        self.rows = np.array([guard.row for guard in self.guards])
        self.fastest = float(np.abs(np.linalg.eigvals(self.A)).max())

    @cached_property
    def guard_rates(self) -> list[Array]:
        """Rows of the guards and of their first three derivatives."""
        rows = [self.rows]
        for _ in range(3):
            rows.append(rows[-1] @ self.A)
        return rows

    @cached_property
    def table(self) -> Array:
        """exp(A t) at every slice of a whole grid step, shape (slices + 1, states, states)."""
        n = self.slices(self.grid)
        balanced, (scale, _) = matrix_balance(self.A, permute=False, separate=True)
        one = expm(balanced * (self.grid / n)) * scale[:, None] / scale[None, :]
        powers = [np.eye(len(self.A))]
        for _ in range(n):
            powers.append(one @ powers[-1])
        return np.array(powers)

    def slices(self, span: float) -> int:
        return max(1, ceil(self.fastest * span / SLICE))

    def series(self, z: Array, span: float) -> Array:
        """Return the Taylor coefficients of z(t), t in units of span; shape (ORDER + 1, states)."""
        terms = np.empty((ORDER + 1, len(z)))
        terms[0] = z
        for k in range(1, ORDER + 1):
            terms[k] = self.A @ terms[k - 1] * (span / k)
        return terms

    def samples(self, z: Array, span: float) -> Array:
        if span == self.grid:
            return self.table @ z
        states = [z]
        for _ in range(n := self.slices(span)):
            states.append(self.series(states[-1], span / n).sum(axis=0))
        return np.array(states)

    def margin(self, z: Array, order: int) -> tuple[Array, Array]:
        """Return a derivative of every guard, and the size of its terms."""
        rows = self.guard_rates[order]
        return rows @ z, np.abs(rows) @ np.abs(z)

    def signs(self, z: Array) -> Array:
        """Return the sign every guard takes at once: that of its first derivative not zero."""
        sign = np.zeros(len(self.guards))
        for order in range(len(self.guard_rates)):
            value, size = self.margin(z, order)
            undecided = (sign == 0) & (np.abs(value) > ROUNDING * size)
            sign[undecided] = np.sign(value[undecided])
        return sign

    def advance(self, z: Array, span: float) -> tuple[float, Guard | None, Array]:
        """Follow the mode for `span` or up to its first crossing: time passed, guard, state."""
        states = self.samples(z, span)
        width = span / (len(states) - 1)
        value, slope = states @ self.rows.T, states @ self.guard_rates[1].T
        turning = (slope[:-1] < 0) & (slope[1:] > 0)
        suspect = (value[:-1] <= 0) | (value[1:] <= 0) | turning
        suspect[0] |= np.abs(value[0]) <= ROUNDING * self.margin(z, 0)[1]
        for k in map(int, np.flatnonzero(suspect.any(axis=1))):
            terms = self.series(states[k], width)
            crossings = []
            for n in map(int, np.flatnonzero(suspect[k])):
                at = self._crossing(terms @ self.rows[n], states[k], n, width)
                if at is not None:
                    crossings.append((at, n))
            if crossings:
                at, n = min(crossings)
                return (k + at) * width, self.guards[n], np.power(at, EXPONENTS) @ terms
        return span, None, states[-1]

    def _crossing(self, guard: Array, z: Array, n: int, width: float) -> float | None:
        """Return the first zero in (0, 1] of a guard's series; 0 if it is negative at once.

        A zero the slice starts on is divided out. Between the samples an interior minimum is looked
        for as well, so that a contact shorter than a sample is not lost.
        """
        lowest = 0
        for rows in self.guard_rates:
            if abs(rows[n] @ z) > ROUNDING * (np.abs(rows[n]) @ np.abs(z)):
                break
            lowest += 1
        else:
            return None
        if guard[lowest] < 0:
            return 0.0
        q = guard[lowest:].tolist()
        slope = [k * term for k, term in enumerate(q)][1:]
        at = [k / 8 for k in range(9)]
        value, rise = ([horner(series, t) for t in at] for series in (q, slope))
        for left, right, here, before, after in zip(
            at, at[1:], value[1:], rise, rise[1:], strict=False
        ):
            if here <= 0:
                return root(q, left, right)
            if before < 0 < after:
                lowest_point = root(slope, left, right)
                if horner(q, lowest_point) <= 0:
                    return root(q, left, lowest_point)
        return None


def horner(series: list[float], t: float) -> float:
    value = 0.0
    for term in reversed(series):
        value = value * t + term
    return value


def root(series: list[float], left: float, right: float) -> float:
    return float(brentq(lambda t: horner(series, t), left, right, xtol=1e-16, rtol=1e-15))


# -------------------------------------------------------------------------------------- a run


class Event(NamedTuple):
    """A change of one switching element; for a mesh the modes are its flanks −1, 0, +1."""

    t: float
    element: str
    before: str
    after: str


@dataclass
class Trajectory:
    """States on a regular grid, shape (times, states), with the events between."""

    t: Array
    z: Array
    modes: list[Mode] = field(repr=False)
    events: list[Event] = field(repr=False)

    def __getitem__(self, name: str) -> Array:
        """Return a state or an output, shape (times,)."""
        assembly = self.modes[0].assembly
        if name in assembly.state:
            return np.array(self.z[:, assembly.names.index(name)])
        rows = np.array([mode.assembly.outputs[name] for mode in self.modes])
        return np.array(np.einsum("ij,ij->i", rows, self.z))

    @property
    def X(self) -> Array:
        """The state vector in the order of Eq. 23, shape (times, 8)."""
        return np.column_stack([self[name.replace("x_", "theta_c")] for name in PLANT])

    @property
    def contacts(self) -> list[tuple[float, int, int, int]]:
        """(time, mesh, flank before, flank after) of every contact made or lost."""
        changes = [
            (event.t, int(event.element[-1]), FLANK.get(event.before, 0), FLANK.get(event.after, 0))
            for event in self.events
            if event.element.startswith("mesh")
        ]
        return [change for change in changes if change[2] != change[3]]

    def flanks(self) -> NDArray[np.int_]:
        """Return the flank each mesh stands on, shape (times, 2)."""
        modes = [mode.assembly.modes for mode in self.modes]
        meshes = ("mesh_1", "mesh_2")
        return np.array([[FLANK.get(mode.get(mesh, ""), 0) for mesh in meshes] for mode in modes])


class ChatteringError(RuntimeError):
    """The elements of the machine switch for ever at one instant."""


class Simulation:
    """The modes of one machine under one motion, made when they are first met."""

    def __init__(self, machine: Machine, motion: Motion, grid: float) -> None:
        frequencies = tuple(frequency for _, frequency, _ in motion.sines)

        @cache
        def mode(items: tuple[tuple[str, str], ...]) -> Mode:
            return Mode(Assembly(machine, frequencies, dict(items)), grid)

        self._mode, self.motion, self.grid, self.machine = mode, motion, grid, machine
        self.events: list[Event] = []

    def mode(self, modes: Modes) -> Mode:
        return self._mode(tuple(modes.items()))

    def switch(self, t: float, mode: Mode, guard: Guard, z: Array) -> Mode:
        """Return the mode after a crossing: the first successor whose own guards hold."""
        before = mode.assembly.modes
        for successor in guard.successors:
            after = self.mode(before | {guard.element: successor})
            own = [other.element == guard.element for other in after.guards]
            if np.all(after.signs(z)[own] >= 0):
                break
        self.events.append(Event(t, guard.element, before[guard.element], successor))
        return after

    def settle(self, t: float, mode: Mode, z: Array) -> Mode:
        """Switch at one instant, after a jump of the command or load, until every guard holds."""
        for _ in range(100):
            signs = mode.signs(z)
            if np.all(signs >= 0):
                return mode
            mode = self.switch(t, mode, mode.guards[int(np.argmin(signs))], z)
        raise ChatteringError(f"the machine finds no consistent mode at t = {t:.6g} s")

    def start(self, start: Mapping[str, float]) -> tuple[Mode, Array]:
        mode = self.mode(first_modes(self.machine, start))
        values = dict.fromkeys(mode.assembly.names, 0.0) | {"one": 1.0} | dict(start)
        for k, (amplitude, _, phase) in enumerate(self.motion.sines):
            values[f"sine_{k}"] = amplitude * np.sin(phase)
            values[f"cosine_{k}"] = amplitude * np.cos(phase)
        z = np.array([values[name] for name in mode.assembly.names])
        mode = self.settle(0.0, mode, z)
        self.events.clear()
        return mode, z

    def spans(self, steps: int) -> Iterator[tuple[int, float, float, Mapping[str, float]]]:
        """Yield (grid step, offset in it, span up to the next stop, states set anew first)."""
        points = list(self.motion.breakpoints)
        for k in range(steps):
            offset = 0.0
            fresh: Mapping[str, float] = {}
            while points and (at := points[0][0] - k * self.grid) < self.grid * (1 - 1e-9):
                if at > offset + 1e-12:
                    yield k, offset, at - offset, fresh
                    offset, fresh = at, {}
                fresh = {**fresh, **points.pop(0)[1]}
            yield k, offset, self.grid - offset if offset else self.grid, fresh

    def run(self, steps: int, start: Mapping[str, float]) -> Trajectory:
        mode, z = self.start(start)
        names = mode.assembly.names
        states, modes = np.empty((steps + 1, len(z))), []
        for k, offset, span, fresh in self.spans(steps):
            if fresh:
                z[[names.index(name) for name in fresh]] = list(fresh.values())
                mode = self.settle(k * self.grid + offset, mode, z)
            if not offset:
                states[k] = z
                modes.append(mode)
            switches = 0
            while span > 0:
                passed, guard, z = mode.advance(z, span)
                span, offset = span - passed, offset + passed
                if guard is None:
                    break
                if guard.vanishing is not None:
                    z[guard.vanishing] = 0.0
                mode = self.switch(k * self.grid + offset, mode, guard, z)
                switches += 1
                if switches > 1000:
                    raise ChatteringError(f"{guard.element} chatters at t = {k * self.grid:.6g} s")
        states[-1] = z
        t = np.arange(steps + 1, dtype=np.float64) * self.grid
        return Trajectory(t, states, [*modes, mode], self.events)


def simulate(
    machine: Machine,
    motion: Motion,
    duration: float,
    grid: float = 1e-3,
    start: Mapping[str, float] | None = None,
    perturbation: float = 0.0,
) -> Trajectory:
    """Run the machine from rest, pinions mid-gap unless `start` sets states otherwise.

    `perturbation` shifts the first twist by that share of the half gap: two runs that differ by
    1e-12 there show how far the chaos of impacts lets any two solvers agree.
    """
    start = dict(start or {})
    start["x_1"] = start.get("x_1", 0.0) + perturbation * machine.drives[0].gap
    return Simulation(machine, motion, grid).run(round(duration / grid), start)

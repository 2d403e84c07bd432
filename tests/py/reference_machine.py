"""The reference model's machines: their numbers, and the ones that tests take."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf


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

"""Drive parameters by the numbers, names and units of the control, and what each is in a machine.

Numbers from 32000 are machine data of a Sinumerik 840D axis, p-numbers parameters of a Sinamics
drive. The paper names MD37256, MD37258 and MD37264 (and calls the first one the tension: an
erratum). All other numbers, names and units are from engineering knowledge, not from a manual:
they are marked `to be verified`, and stay so on every table that is written.

In 840D terms 100 % of speed is the axis' largest, here that of motor 1; 100 % of torque is the
rated torque of motor 1. Speeds are those of the pinion, torques those of the motor.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from dualdrive.machine import Machine

__all__ = ["KNOWN", "PAPER", "VERIFY", "Base", "DriveParameter"]

PAPER: Final = "paper, section 3.3"
VERIFY: Final = "to be verified"

#: where a number is typed in
SLAVE, BOTH, DRIVES = "slave axis", "both axes", "both drives"


class Base:
    """What percentages and ratios of a machine refer to; SI."""

    def __init__(self, machine: Machine) -> None:
        core = machine.core
        self.gear = core.get("gearbox_1.ratio") if "gearbox_1" in core.connections else 1.0
        self.torque = core.get("motor_1.T_rated")
        self.speed = core.get("motor_1.omega_max") / self.gear
        self.angle = "rad" if machine.axis == "rotary" else "m"


@dataclass(frozen=True)
class DriveParameter:
    """One number of the control.

    number:   "37264", "p1460"
    name:     of the control
    unit:     as the control has it, in words
    meaning:  one line
    where:    slave axis, both axes or both drives
    source:   who says so: `PAPER` or `VERIFY`
    path:     of the machine; "" for a choice, a limit of motion, or what no model knows
    si:       unit of the machine's number
    size:     SI value of one unit of the control, from the machine's base
    fixed:    value to type in where no model number stands behind it; None: only keep it equal
    """

    number: str
    name: str
    unit: str
    meaning: str
    where: str = SLAVE
    source: str = VERIFY
    path: str = ""
    si: str = ""
    size: Callable[[Base], float] = lambda base: 1.0
    fixed: float | None = None


def _speed(base: Base) -> float:
    return base.speed / 100.0


def _torque(base: Base) -> float:
    return base.torque / 100.0


def _turns(base: Base) -> float:
    from math import tau

    return tau if base.angle == "rad" else 1.0


_ALL: Final = (
    DriveParameter("32200", "POSCTRL_GAIN", "1000/min", "position gain", BOTH,
                   path="controller.K_v", si="1/s", size=lambda base: 1000.0 / 60.0),
    DriveParameter("32300", "MAX_AX_ACCEL", "rev/s^2 (m/s^2)", "acceleration", BOTH,
                   si="rad/s^2", size=_turns),
    DriveParameter("32431", "MAX_AX_JERK", "rev/s^3 (m/s^3)", "jerk", BOTH,
                   si="rad/s^3", size=_turns),
    DriveParameter("32610", "VELO_FFW_WEIGHT", "factor", "weight of speed feed-forward", BOTH,
                   path="controller.f_v"),
    DriveParameter("32620", "FFW_MODE", "0 none, 1 speed", "kind of feed-forward", BOTH),
    DriveParameter("32640", "STIFFNESS_CONTROL_ENABLE", "0, 1", "dynamic stiffness control", BOTH),
    DriveParameter("37250", "MS_ASSIGN_MASTER_SPEED_CMD", "axis number",
                   "master axis of the speed set-point"),
    DriveParameter("37252", "MS_ASSIGN_MASTER_TORQUE_CTR", "axis number",
                   "master axis of the torque equaliser"),
    DriveParameter("37254", "MS_TORQUE_CTRL_MODE", "0 both, 1 slave, 2 master, 3 none",
                   "where the equaliser's output goes"),
    DriveParameter("37255", "MS_TORQUE_CTRL_ACTIVATION", "0, 1", "how the equaliser is activated"),
    DriveParameter("37256", "MS_TORQUE_CTRL_P_GAIN", "% of v_max at rated torque",
                   "P gain of the torque equaliser", source=PAPER,
                   si="rad/(N*m*s)", size=lambda base: base.speed / base.torque / 100.0),
    DriveParameter("37258", "MS_TORQUE_CTRL_I_TIME", "s", "integral time of the equaliser, 0 off",
                   source=PAPER, path="controller.T_E", si="s"),
    DriveParameter("37260", "MS_MAX_CTRL_VELO", "% of v_max", "limit of the equaliser's output",
                   path="controller.Omega_E", si="rad/s", size=_speed),
    DriveParameter("37262", "MS_COUPLING_ALWAYS_ACTIVE", "0, 1", "coupling permanently active",
                   fixed=1.0),
    DriveParameter("37264", "MS_TENSION_TORQUE", "% of rated torque",
                   "tension: difference of the motor torques", source=PAPER,
                   path="controller.T_ten", si="N*m", size=_torque),
    DriveParameter("37266", "MS_TENSION_TORQ_FILTER_TIME", "s", "filter of the tension",
                   path="controller.tau_t", si="s"),
    DriveParameter("37268", "MS_TORQUE_WEIGHT_SLAVE", "%", "the slave's share of the torque",
                   path="controller.w", size=lambda base: 0.01),
    DriveParameter("p1460", "speed controller P gain", "N*m*s/rad", "at the motor", DRIVES,
                   path="controller.k_p", si="N*m*s/rad", size=lambda base: base.gear**2),
    DriveParameter("p1462", "speed controller integral time", "ms", "0 off", DRIVES,
                   path="controller.T_N", si="s", size=lambda base: 1e-3),
    DriveParameter("p1656", "current set-point filter activation", "bits",
                   "0 none, 1 the first filter", DRIVES),
    DriveParameter("p1657", "current set-point filter 1 type", "1 low-pass, 2 general",
                   "of second order either way", DRIVES),
    DriveParameter("p1658", "current set-point filter 1 denominator natural frequency", "Hz",
                   "of a low-pass or notch", DRIVES, path="motors.filter_pole", si="Hz"),
    DriveParameter("p1659", "current set-point filter 1 denominator damping", "1",
                   "of a low-pass or notch", DRIVES,
                   path="motors.filter_pole_damping"),
    DriveParameter("p1660", "current set-point filter 1 numerator natural frequency", "Hz",
                   "of a notch", DRIVES, path="motors.filter_zero", si="Hz"),
    DriveParameter("p1661", "current set-point filter 1 numerator damping", "1",
                   "of a notch", DRIVES,
                   path="motors.filter_zero_damping"),
)  # fmt: skip

#: number -> what it is, in the order of numbers
KNOWN: Final = {parameter.number: parameter for parameter in _ALL}

"""Drive parameters out of a machine, and into it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from dualdrive.machine import Machine
from dualdrive.tune.errors import TuneError
from dualdrive.tune.known import KNOWN, SLAVE, Base, DriveParameter
from dualdrive.tune.limits import MotionLimits

__all__ = ["Applied", "DriveTable", "Entry", "drive_parameters", "set_drive_parameters"]

_MODES = {"both": 0.0, "slave": 1.0, "master": 2.0}
_LIMITS = {"32300": "acceleration", "32431": "jerk"}
_GAIN = "37256"
_FILTER = tuple(number for number in KNOWN if number.startswith("p16"))


@dataclass(frozen=True)
class Entry:
    """A number of the control with its value in the master's and in the slave's axis or drive.

    Values in the control's own unit; None where the axis has no such number or none was given.
    """

    parameter: DriveParameter
    master: float | None
    slave: float | None

    @property
    def value(self) -> float | None:
        """The one value, if the axes agree or only one has it."""
        given = {v for v in (self.master, self.slave) if v is not None}
        return given.pop() if len(given) == 1 else None

    @property
    def differs(self) -> bool:
        """Whether both axes have the number, and not the same."""
        return self.master is not None and self.slave is not None and self.master != self.slave


@dataclass(frozen=True)
class DriveTable:
    """Numbers of a control by parameter number; `name` says of which machine or file."""

    name: str
    entries: dict[str, Entry] = field(default_factory=dict)

    def __getitem__(self, number: str) -> float:
        """The value of a number in the control's unit. Raises TuneError where there is no one."""
        entry = self.entries.get(number)
        if entry is None or entry.value is None:
            what = "differs between the axes" if entry and entry.differs else "is not in the table"
            raise TuneError(f"{self.name}: {number} {what}; there are {', '.join(self.entries)}")
        return entry.value


@dataclass(frozen=True, eq=False)
class Applied:
    """What setting a table gave.

    machine:  a changed copy
    limits:   of motion, which no machine holds; None where the table says nothing of them
    unused:   numbers that the machine has no place for: axis numbers, activation
    """

    machine: Machine
    limits: MotionLimits | None
    unused: tuple[str, ...]


def drive_parameters(machine: Machine, limits: MotionLimits | None = None) -> DriveTable:
    """The machine's numbers as the control has them; those of motion from `limits`, if given.

    What the machine does not know (axis numbers, activation) is in the table without a value, to be
    kept as the control has it. Raises TuneError for a machine without master/slave controller.
    """
    base = _base(machine)
    entries = {}
    for number, parameter in KNOWN.items():
        if parameter.where == SLAVE and len(machine.core.motors) < 2:
            continue
        value = _read(machine, base, parameter, limits)
        master = None if parameter.where == SLAVE else value
        entries[number] = Entry(parameter, master, value)
    return DriveTable(machine.name, entries)


def set_drive_parameters(machine: Machine, table: DriveTable) -> Applied:
    """A copy of the machine with the table's numbers; what it does not name stays as it is.

    The equaliser's gain is a number of its own in the control (MD37256): a new speed gain alone
    changes the loop gain g_E with it. Raises TuneError, naming number, value and rule, for a
    value the machine can't have and where the axes differ.
    """
    base = _base(machine)
    differing = [number for number, entry in table.entries.items() if entry.differs]
    if differing:
        number = differing[0]
        entry = table.entries[number]
        raise TuneError(
            f"{table.name}: {number}: master {entry.master:g}, slave {entry.slave:g}: must be the "
            f"same in both axes (step 1 of the procedure); differing: {', '.join(differing)}"
        )
    values = {n: e.value for n, e in table.entries.items() if e.value is not None}
    trial = machine.copy()
    has_equaliser = len(machine.core.motors) > 1
    gain = values.get(_GAIN, _gain(machine, base)) if has_equaliser else None
    unused = [number for number, value in values.items() if not _write(trial, base, number, value)]
    if values.get("32620") == 0.0:  # whatever weight it would have
        trial.set("controller.f_v", 0.0)
    if gain is not None:
        _set(trial, _GAIN, "controller.g_E", _loop_gain(trial, base, gain), gain)
    return Applied(trial, _limits(values, base), tuple(unused))


def _base(machine: Machine) -> Base:
    if machine.core.controller_options["kind"] != "master_slave" or not machine.core.motors:
        raise TuneError(
            f"{machine.name}: controller = {machine.core.controller_options['kind']}: has no drive "
            "parameters; take a machine with a [controller]"
        )
    base = Base(machine)
    if not (math.isfinite(base.speed) and math.isfinite(base.torque) and base.torque > 0):
        raise TuneError(
            f"{machine.name}: motor_1.T_rated = {base.torque:g}, motor_1.omega_max: must be "
            "finite, since drive parameters are percentages of them; set both"
        )
    return base


def _read(
    machine: Machine, base: Base, parameter: DriveParameter, limits: MotionLimits | None
) -> float | None:
    number = parameter.number
    if number in _LIMITS:
        limit = getattr(limits, _LIMITS[number]) if limits else None
        return limit / parameter.size(base) if limit is not None and math.isfinite(limit) else None
    if number == "32620":
        return float(machine.get("controller.f_v") != 0.0)
    if number == "37254":
        return _MODES[machine.core.controller_options["equaliser"]]
    if number == _GAIN:
        return _gain(machine, base)
    if number in _FILTER:
        return _filter(machine, number)
    if not parameter.path:
        return parameter.fixed
    value = machine.get(parameter.path)
    return value / parameter.size(base) if math.isfinite(value) else None


def _filter(machine: Machine, number: str) -> float | None:
    """A set-point filter's numbers; None for those that it does not have."""
    core = machine.core
    pole, zero = (core.get(f"motors.filter_{part}") for part in ("pole", "zero"))
    if number == "p1656":
        return float(pole > 0.0)
    if not pole or (number in ("p1660", "p1661") and not zero):
        return None
    return (2.0 if zero else 1.0) if number == "p1657" else core.get(KNOWN[number].path)


def _gain(machine: Machine, base: Base) -> float:
    """MD37256 of the loop gain g_E = 2 K_E k_p / i."""
    k_E = machine.get("controller.g_E") * base.gear / (2.0 * machine.get("controller.k_p"))
    return k_E / KNOWN[_GAIN].size(base)


def _loop_gain(machine: Machine, base: Base, gain: float) -> float:
    k_E = gain * KNOWN[_GAIN].size(base)
    return 2.0 * k_E * machine.get("controller.k_p") / base.gear


def _write(machine: Machine, base: Base, number: str, value: float) -> bool:
    """Set one number; False where the machine has no place for it."""
    parameter = KNOWN[number]
    if parameter.where == SLAVE and len(machine.core.motors) < 2:
        return False
    if number in (*_LIMITS, _GAIN):
        return True
    if number == "32620":
        _refuse_unless(number, value, (0.0, 1.0), "the model has speed feed-forward or none")
        return True
    if number == "37254":
        _refuse_unless(number, value, tuple(_MODES.values()), "for no equaliser set 37256 to 0")
        words = {v: k for k, v in _MODES.items()}
        if words[value] != machine.core.controller_options["equaliser"]:
            machine.set("controller.equaliser", words[value])
        return True
    if number in ("p1656", "p1657"):
        return _switch_filter(machine, number, value)
    if number == "37262":
        _refuse_unless(number, value, (1.0,), "the model's coupling is always active")
        return True
    if not parameter.path or machine.core.unread(parameter.path):
        return False
    _set(machine, number, parameter.path, value * parameter.size(base), value)
    return True


def _switch_filter(machine: Machine, number: str, value: float) -> bool:
    """Filter off, or a low-pass: a zero frequency; its own number comes after."""
    allowed, part = {
        "p1656": ((0.0, 1.0), "filter_pole"),
        "p1657": ((1.0, 2.0), "filter_zero"),
    }[number]
    _refuse_unless(number, value, allowed, "the model has one second-order filter per drive")
    if value == allowed[0]:
        machine.set(f"motors.{part}", 0.0)
    return True


def _set(machine: Machine, number: str, path: str, si: float, value: float) -> None:
    try:
        machine.set(path, si)
    except ValueError as error:
        raise TuneError(f"{number} = {value:g}: {error}") from None


def _refuse_unless(number: str, value: float, allowed: tuple[float, ...], why: str) -> None:
    if value not in allowed:
        known = " or ".join(f"{v:g}" for v in allowed)
        raise TuneError(f"{number} = {value:g}: must be {known} here, since {why}")


def _limits(values: dict[str, float], base: Base) -> MotionLimits | None:
    if not _LIMITS.keys() & values.keys():
        return None
    a, j = (values[n] * KNOWN[n].size(base) if n in values else math.inf for n in _LIMITS)
    return MotionLimits(a, j)

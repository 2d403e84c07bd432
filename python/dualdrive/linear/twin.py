"""A machine's continuous twin, and where its delays and sampled loops sit.

The core linearises what is continuous. Sampling and delays are taken out of a copy and kept as
factors on the signal path that they delay; a frequency response puts them back.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core

__all__ = ["Late", "continuous_twin", "late_paths", "motor_numbers"]

_LOOPS = ("position", "tension", "speed", "current")


@dataclass(frozen=True)
class Late:
    """A path on which a signal comes late.

    source:  the signal that is late
    enters:  the input of the linear system that stands where it enters
    delay:   s
    hold:    s, over which it is held or averaged besides: (1 - exp(-s hold)) / (s hold)
    reason:  in words
    """

    source: str
    enters: str
    delay: float
    hold: float
    reason: str

    @property
    def mean(self) -> float:
        """How late the signal is for slow changes, s."""
        return self.delay + self.hold / 2

    def factor(self, s: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Its transfer function at s, shape as s."""
        late = np.exp(-s * self.delay)
        if self.hold:
            late = late * -np.expm1(-s * self.hold) / (s * self.hold)
        return np.asarray(late, np.complex128)


def motor_numbers(core: _core.Machine) -> list[str]:
    """How signals call the motors: 1, 2."""
    return [motor.removeprefix("motor_") for motor in core.motors]


def continuous_twin(core: _core.Machine) -> _core.Machine:
    """A copy without sampling and delays, and with a finite limit wherever there can be one."""
    twin = core.copy()
    if core.controller_options["kind"] == "none":
        return twin
    for loop in _LOOPS:
        twin.set(f"controller.{loop}_sample", 0.0)
        twin.set(f"controller.{loop}_latency", 0.0)
    twin.set("controller.delta_c", 0.0)
    twin.set("controller.delta_t", 0.0)
    twin.set_controller(**{**core.controller_options, "speed_samples": 0})
    for effect in core.effects:
        if effect["effect"] == "sensor_delay":
            twin.set(f"{effect['label']}.time", 0.0)
    limits = [
        f"{motor}.{name}" for motor in core.motors for name in ("omega_max", "T_max", "U_max")
    ]
    for parameter in twin.parameters():
        if parameter.path in (*limits, "controller.Omega_E") and not isfinite(parameter.value):
            twin.set(parameter.path, 1.0)
    return twin


def late_paths(core: _core.Machine) -> list[Late]:
    """Every delay and every sampled loop of the machine, those of zero length left out."""
    if core.controller_options["kind"] == "none":
        return []
    return [
        path
        for path in (*_sampled(core), *_transported(core), *_sensed(core))
        if path.delay > 0 or path.hold > 0
    ]


def _sampled(core: _core.Machine) -> list[Late]:
    """A loop's output is held for a sample time, and put out late by its computing time."""
    numbers = motor_numbers(core)
    outputs = {
        "position": ["Omega_1"],
        "tension": ["equaliser"] if len(numbers) > 1 else [],
        "speed": [f"T_{n}*" for n in numbers],
        "current": [f"U_{n}" for n in numbers if core.kind(f"motor_{n}") == "armature"],
    }
    found = []
    for loop in _LOOPS:
        hold = core.get(f"controller.{loop}_sample")
        delay = core.get(f"controller.{loop}_latency")
        reason = f"{loop} loop sampled every {hold * 1e3:g} ms"
        found += [Late(name, name, delay, hold, reason) for name in outputs[loop]]
    return found


def _transported(core: _core.Machine) -> list[Late]:
    """The set-point that comes late to all drives, and the slave's lag behind the master."""
    command, slave = core.get("controller.delta_c"), core.get("controller.delta_t")
    slaves = motor_numbers(core)[1:]
    return [
        Late("Omega_1", "Omega_1", command, 0.0, f"set-point {command * 1e3:g} ms late"),
        *(
            Late("Omega_1", f"Omega_{n}*", slave, 0.0, f"slave {slave * 1e3:g} ms late")
            for n in slaves
        ),
    ]


def _sensed(core: _core.Machine) -> list[Late]:
    """Sensors that are late, and speeds taken from the mean of several samples."""
    found = []
    for effect in core.effects:
        if effect["effect"] == "sensor_delay":
            delay = core.get(f"{effect['label']}.time")
            for member in effect["members"]:
                name = f"sensed.{member}"
                found.append(Late(name, name, delay, 0.0, f"{name} {delay * 1e3:g} ms late"))
    samples = core.controller_options["speed_samples"]
    span = samples * core.get("controller.speed_sample")
    for motor in core.motors if samples else ():
        reason = f"speed of {motor} from {samples} samples"
        found.append(Late(f"sensed.{motor}", f"sensed.{motor}", 0.0, span, reason))
    return found

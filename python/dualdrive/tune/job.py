"""What a step is given, and what it hands back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from dualdrive.linear import DriveComparison
from dualdrive.machine import Machine
from dualdrive.motion import Motion
from dualdrive.tune.limits import MotionLimits
from dualdrive.tune.parameters import DriveTable
from dualdrive.tune.result import Panel

__all__ = ["Draft", "Job", "decoupled"]


@dataclass
class Job:
    """The machine as it stands, the test move, and what was given besides.

    first:     the machine as it was found
    state:     where the table turns on the test move: the point that poles are taken at
    table:     drive parameters as read from a control, to be compared in step 1
    unused:    numbers in it that the machine has no place for
    measured:  responses of both drives as measured; step 3 judges them in place of the model's
    """

    first: Machine
    machine: Machine
    motion: Motion
    limits: MotionLimits | None
    tolerance_db: float
    tolerance_deg: float
    table: DriveTable | None = None
    unused: tuple[str, ...] = ()
    measured: DriveComparison | None = None
    state: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Draft:
    """A step's proposal: a changed machine, what was done, and why to stop, if so."""

    machine: Machine
    done: Sequence[str]
    panels: tuple[Panel, ...] = ()
    reason: str = ""
    details: Mapping[str, Any] = field(default_factory=dict)
    limits: MotionLimits | None = None


def decoupled(machine: Machine) -> Machine:
    """A copy whose equaliser does nothing yet, as it is up to step 7."""
    copy = machine.copy()
    copy.core.set("controller.g_E", 0.0)
    return copy

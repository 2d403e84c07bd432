"""Limit cycles: foretold by the describing function, found exactly by shooting, mapped."""

from dualdrive.cycles.continuation import Branch, branch
from dualdrive.cycles.cycle_map import Survey, survey
from dualdrive.cycles.describing import Predicted, describing_function
from dualdrive.cycles.errors import CycleError, NoCycleError
from dualdrive.cycles.orbit import Orbit
from dualdrive.cycles.shooting_method import shooting

__all__ = [
    "Branch",
    "CycleError",
    "NoCycleError",
    "Orbit",
    "Predicted",
    "Survey",
    "branch",
    "describing_function",
    "shooting",
    "survey",
]

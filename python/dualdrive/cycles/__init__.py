"""Limit cycles: foretold by the describing function, found exactly by shooting, mapped."""

from dualdrive.cycles.branch import Branch, branch
from dualdrive.cycles.describing import Predicted, describing_function
from dualdrive.cycles.errors import CycleError, NoCycleError
from dualdrive.cycles.orbit import Orbit
from dualdrive.cycles.shooting import shooting
from dualdrive.cycles.survey import Survey, survey

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

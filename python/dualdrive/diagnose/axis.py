"""Units of a machine's own axis in what a diagnosis says: newtons where nothing turns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from dualdrive.describe import unit_on
from dualdrive.diagnose.result import Candidate, Interval, Shape


def numbers_on(machine: Any, numbers: Mapping[str, Interval]) -> dict[str, Interval]:
    """The same numbers with the units of this machine's axis, path by path."""
    return {
        path: replace(x, unit=unit_on(machine, path, x.unit)) if x.unit else x
        for path, x in numbers.items()
    }


def candidate_on(machine: Any, candidate: Candidate) -> Candidate:
    """A candidate likewise."""
    return replace(candidate, parameters=numbers_on(machine, candidate.parameters))


def shape_on(machine: Any, shape: Shape) -> Shape:
    """A missing torque likewise: a missing force along a distance."""
    coordinate = shape.coordinate_unit
    return replace(
        shape,
        unit=unit_on(machine, shape.unit),
        coordinate_unit=unit_on(machine, coordinate) if coordinate else coordinate,
    )

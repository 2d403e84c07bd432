"""Tables 1 and 2 of the source paper as it prints them, and the presets that stand for them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from dualdrive.indexing.rules import IndexingError
from dualdrive.machine import Machine

__all__ = ["DEMANDED", "LOADS", "PRINTED", "TOLERANCE", "TRAINS", "loaded", "printed_gain"]

ARCSEC: Final = math.pi / 648000  # rad

#: drive train -> the column of the tables that it stands for
TRAINS: Final[Mapping[str, str]] = {
    "heavy-table-double-pinion": "traditional",
    "heavy-table-dual-servo": "double motors",
    "heavy-table-single-motor": "single motor",
}
#: load -> the preset whose table has its inertia
LOADS: Final[Mapping[str, str]] = {
    "empty": "heavy-table-empty",
    "100t": "heavy-table-100t",
    "250t": "heavy-table-250t",
    "550t": "heavy-table-550t",
}
#: (load, column) -> printed figures, arcsec. Table 2 prints one "indexing accuracy", read as A
PRINTED: Final[Mapping[tuple[str, str], Mapping[str, float]]] = {
    ("empty", "traditional"): {"A": 8, "R": 5, "B": 4},
    ("empty", "double motors"): {"A": 4, "R": 4, "B": 3},
    ("100t", "traditional"): {"A": 8},
    ("100t", "double motors"): {"A": 3},
    ("250t", "traditional"): {"A": 9},
    ("250t", "double motors"): {"A": 4},
    ("550t", "traditional"): {"A": 10},
    ("550t", "double motors"): {"A": 4},
}
#: tolerance of Table 1, arcsec
TOLERANCE: Final[Mapping[str, float]] = {"A": 10, "R": 6, "B": 8}
#: what section 4 demands of the table, ± arcsec: a range of 8, under a tolerance of 10
DEMANDED: Final = 4.0

#: s between the ticks of the position loop
_SAMPLE: Final = 4e-3


def printed_gain(load: str, figure: str) -> float:
    """By how much the printed figure of two motors is smaller, as a share of the traditional."""
    return 1.0 - PRINTED[load, "double motors"][figure] / PRINTED[load, "traditional"][figure]


def loaded(train: str | Machine, load: str) -> Machine:
    """A drive train under a load, its position loop sampled. Raises IndexingError."""
    if load not in LOADS:
        raise IndexingError(f"load {load!r}: unknown; choose of {', '.join(LOADS)}")
    machine = train.copy() if isinstance(train, Machine) else Machine.load(train)
    machine.set("table.J", Machine.load(LOADS[load]).get("table.J"))
    machine.set("controller.position_sample", _SAMPLE)
    machine.name = f"{machine.name}, {load}"
    return machine

"""Corner cases: the machine at the ends of what is not known of it, or changes in its work."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

from dualdrive.machine import Machine
from dualdrive.optimise.errors import OptimiseError, refuse_all_but_two_drives
from dualdrive.units import parse

__all__ = ["SPREAD", "Corner", "corners"]

#: ends as fractions of the machine's own numbers, where nothing is said: a load known to a fifth,
#: play that is worn in or was set with care
SPREAD = {"table.J": ("80%", "120%"), "meshes.gap": ("70%", "130%")}


@dataclass(frozen=True)
class Corner:
    """One case: what is changed in the machine, path -> SI value; `name` says it in words."""

    name: str
    values: Mapping[str, float]


def corners(
    machine: Machine, spread: Mapping[str, tuple[str | float, str | float]] | None = None
) -> list[Corner]:
    """The machine as it is, then every combination of the ends of `spread`.

    spread:  path or tie group -> (low, high), SI or with units; ``80%`` is a fraction of the
             machine's own number. Default: `SPREAD`; an empty one leaves the machine alone

    Raises OptimiseError naming path, value and rule, and for a machine without two drives;
    MachineError for an unknown path.
    """
    refuse_all_but_two_drives(machine)
    ends = {
        path: tuple(_value(machine, path, end) for end in both)
        for path, both in (SPREAD if spread is None else spread).items()
    }
    found = [Corner("as it is", {path: machine.get(path) for path in ends})]
    for path, both in ends.items():
        if len(both) != 2 or not both[0] < both[1]:
            raise OptimiseError(
                f"{path} = {', '.join(f'{end:g}' for end in both)}: must be low and high, "
                "low below high; write e.g. table.J=80%:120%"
            )
    if ends:
        for chosen in product(*ends.values()):
            values = dict(zip(ends, chosen, strict=True))
            found.append(Corner(_spoken(machine, values), values))
    return found


def _value(machine: Machine, path: str, given: str | float) -> float:
    """SI from a number, from text with a unit, or from a fraction of what the machine has."""
    share = re.fullmatch(r"\s*(.+?)\s*%\s*", given) if isinstance(given, str) else None
    own = machine.get(path)
    if share:
        return parse(share[1], "", key=path) / 100.0 * own
    return parse(given, machine.parameter(path).unit, key=path)


def _spoken(machine: Machine, values: Mapping[str, float]) -> str:
    """``table.J 80 %, meshes.gap 130 %``; the value itself where the machine has none."""
    words = []
    for path, value in values.items():
        own = machine.get(path)
        words.append(f"{path} {100 * value / own:.3g} %" if own else f"{path} {value:.4g}")
    return ", ".join(words)

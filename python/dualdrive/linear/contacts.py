"""Contact modes as a person writes them: which flank of each gap is closed."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, Final

from dualdrive import _core
from dualdrive.assembly import core_of, gaps
from dualdrive.linear.errors import LinearError
from dualdrive.machine import Machine

__all__ = ["FLANKS", "Modes", "all_sides", "closed", "frozen", "sides_at_rest", "spoken"]

#: side of a gap -> the core's word for that mode
FLANKS: Final[Mapping[int, str]] = {-1: "back", 0: "gap", 1: "front"}

#: "(1, -1)", (1, -1), or switching element -> mode as the core names it; None: as at rest
Modes = str | Sequence[int] | Mapping[str, str] | None


def all_sides(count: int) -> list[tuple[int, ...]]:
    """Every combination of sides of so many gaps: nine for two."""
    return list(product(FLANKS, repeat=count))


def spoken(sides: Sequence[int]) -> str:
    """Sides in words, as keys of `modes`: ``(1, -1)``."""
    return f"({', '.join(str(side) for side in sides)})"


def closed(machine: Machine | _core.Machine) -> tuple[int, ...]:
    """Every flank closed: the contact in which a loop must be stable by itself."""
    return tuple(1 for _ in gaps(core_of(machine)))


def sides_at_rest(core: _core.Machine) -> tuple[int, ...]:
    """The flanks that tension closes: the master's in front, the slave's at its back.

    Without tension all front flanks, as while the table is driven forward.
    """
    tension = _tension(core)
    return tuple(
        1 if not tension or name.endswith("_1") == (tension > 0) else -1 for name in gaps(core)
    )


def _tension(core: _core.Machine) -> float:
    options = core.controller_options
    if options["kind"] == "none" or options["tension"] == "off" or len(core.motors) < 2:
        return 0.0
    return float(core.get("controller.T_ten"))


def frozen(core: _core.Machine, modes: Modes, friction: str = "forward") -> dict[str, str]:
    """The mode of every switching element that isn't the core's own default.

    modes:     sides of the gaps in the machine's order, or element -> mode
    friction:  what dry friction does: forward, backward (constant, so that it drops out of small
               signals) or stuck

    Raises LinearError for a wrong number of sides or a side that is none.
    """
    elements = _core.possible_modes(core)
    found = {name: friction for name in elements if name.startswith("friction of ")}
    names = gaps(core)
    given: Mapping[str, str] = {}
    if isinstance(modes, Mapping):
        given, sides = modes, sides_at_rest(core)
    else:
        sides = sides_at_rest(core) if modes is None else _sides(modes, names)
    closed = zip(names, sides, strict=True)  # a gap of zero width is no switch
    found |= {name: FLANKS[side] for name, side in closed if name in elements}
    return {**found, **given}


def _sides(modes: str | Sequence[int], names: Sequence[str]) -> tuple[int, ...]:
    """Read sides from text or numbers."""
    words: Sequence[Any] = re.findall(r"[^\s,()]+", modes) if isinstance(modes, str) else modes
    try:
        sides = tuple(int(word) for word in words)
    except ValueError:
        sides = ()
    if len(sides) != len(names) or not set(sides) <= set(FLANKS):
        raise LinearError(
            f"modes = {modes!r}: needs -1 (back flank), 0 (in the gap) or 1 (front flank) for each "
            f"of {', '.join(names) or 'no gap: give nothing'}, e.g. {spoken([1] * len(names))}"
        )
    return sides

"""What both kinds of diagnosis find: machines with effects, candidates, numbers, equations."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from dualdrive import _core
from dualdrive.compare.equation import EquationAtFault
from dualdrive.diagnose.result import Candidate, Interval
from dualdrive.estimation.unknowns import Unknown
from dualdrive.replay import core_of

Effects = Sequence[tuple[str, str]]  # effect and place

TOLD = 8  # candidates in the result
RIVALS = 3  # names that the next experiment parts


def with_effects(machine: Any, effects: Effects, values: Mapping[str, float]) -> Any:
    """A copy of the machine with effects in it and numbers set, path -> SI value."""
    copy = machine.copy()
    core = core_of(copy)
    for effect, place in effects:
        if hasattr(copy, "add"):
            copy.add(effect, place)
        else:
            core.add_effect(effect, place)
    for path, value in values.items():
        core.set(path, value)
    return copy


def command_for(effects: Effects, numbers: Mapping[str, Interval]) -> str:
    """The commands that add these effects, one per effect, with their own of the numbers."""
    lines, source = [], "MACHINE"
    for k, (effect, place) in enumerate(effects, 1):
        label = f"{effect}@{place}"
        own = {p: x for p, x in numbers.items() if p.startswith(f"{label}.")}
        sets = " ".join(f"--set {p.rpartition('.')[2]}={x.value:.6g}" for p, x in own.items())
        target = "grown.toml" if k == len(effects) else f"grown-{k}.toml"
        lines.append(f"dualdrive add {source} {label} {sets} -o {target}".replace("  ", " "))
        source = target
    return " && ".join(lines)


def screened(
    scores: Iterable[tuple[Effects, float, str]], known: Sequence[Candidate]
) -> list[Candidate]:
    """The best by score alone, as many as there is room for: a shortlist, no more.

    scores: effects, what they gain, and a note, best first; known: candidates that were refitted
    """
    unknown, labels, found = math.nan, {c.label for c in known}, list[Candidate]()
    for effects, gain, note in scores:
        c = Candidate(tuple(effects), 0.0, {}, unknown, unknown, gain, unknown, False, note)
        if gain > 0.0 and c.label not in labels and len(known) + len(found) < TOLD:
            labels.add(c.label)
            found.append(c)
    return found


def moved_numbers(nominal: Sequence[Unknown], known: Mapping[str, Interval]) -> dict[str, Interval]:
    """Nominal numbers that the records put elsewhere, beyond doubt."""
    found = {}
    for p in nominal:
        k = known[p.path]
        if not k.low <= p.nominal <= k.high and abs(k.value - p.nominal) > 0.01 * abs(p.nominal):
            found[p.path] = k
    return found


def equation_by_name(candidates: Iterable[Candidate]) -> EquationAtFault:
    """The equation that the most probable names enter."""
    shares: dict[str, float] = {}
    for c in candidates:
        name = equation_of(*c.effects[0])
        shares[name] = shares.get(name, 0.0) + c.probability
    best = max(shares, key=lambda n: shares[n])
    return EquationAtFault(best, min(shares[best], 1.0), shares, "probability")


def equation_of(effect: str, place: str) -> str:
    """The equation that an effect enters: mesh, table, drive, controller, sensors, electrical."""
    acts = _core.effect_type(effect).acts_on
    if "sensor" in acts or "estimate" in acts:
        return "sensors"
    if "mesh" in acts:
        return "mesh"
    if "command" in acts or "limit" in acts:
        return "controller"
    if acts == "motor voltage":
        return "electrical"
    return "table" if place in ("table", "ring") else "drive"

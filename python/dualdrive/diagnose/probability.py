"""How probable each hypothesis is: among those tried, and counting those that were not."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from dualdrive import _core
from dualdrive.diagnose.candidates import akin
from dualdrive.diagnose.heldout import held_out
from dualdrive.diagnose.laws import CONTAINS, rubs
from dualdrive.diagnose.refit import Refit
from dualdrive.diagnose.settle import ENOUGH
from dualdrive.diagnose.survey import Survey, excess, explained_by, key_of
from dualdrive.replay import ratio_to_table

#: fall of the criterion below which no second effect is named beside a first
SECOND = 25.0
#: share of a pair's gain that the second of two laws confused with one another must bring, where
#: the first alone leaves no more than noise
MENDED = 0.03
#: of the criterion, tempered: odds of 1 to 20 against a law of the angle on less than a radian
SMALL_ARC = 12.0
#: share that a plainer law may explain less than one of the angle on a small arc
AS_MUCH = 0.03
#: of twice the log evidence: how sure differences between good fits are (see the blind suite)
TEMPER = 2.0
#: probability of the leader that makes it the only name
SURE = 0.9
#: how often a leader is right, however far the others that were tried are behind: by what it leaves
#: over the floor in its worst series, and by the share of what could be explained that it explains;
#: the larger counts. Chosen by hand on cases whose labels had been read: a faint second effect, or
#: one from outside the library, hides beside a third of all leaders. `tests.blind score` prints how
#: it fares
RIGHT_AT_FLOOR = ((1.0, 1.15, 1.22), (0.85, 0.65, 0.0))
RIGHT_BY_SHARE = ((0.25, 0.5, 0.75, 0.9, 0.97), (0.05, 0.1, 0.3, 0.45, 0.65))


def probabilities(found: Survey) -> tuple[list[tuple[Refit, float]], float]:
    """Every hypothesis worth a name with its probability, best first, and that of nothing at all.

    They sum to one: the true cause is taken to be among those that were tried.
    """
    named = _worth_a_name(found)
    every = [found.base, *named]
    value = {id(r): value_of(found, r) for r in every}
    for r in named:  # a radian is no turn: what it shows along the way is no law of the angle
        if plain := [value[id(other)] for other in named if _is_plainer(found, other, r)]:
            value[id(r)] = max(value[id(r)], min(plain) + SMALL_ARC)
    least = min(value.values())
    weights = {key: math.exp(-0.5 * (x - least) / TEMPER) for key, x in value.items()}
    whole = sum(weights.values())
    ranked = sorted(named, key=lambda r: value[id(r)])
    return [(r, weights[id(r)] / whole) for r in ranked], weights[id(found.base)] / whole


def _worth_a_name(found: Survey) -> list[Refit]:
    """Of every hypothesis the best of those that differ in counted numbers alone.

    Left out are whole laws that do no more than the one they contain, and pairs of which one
    effect earns nothing.
    """
    by_label: dict[str, Refit] = {}
    singles = {
        r.hypothesis.effects[0]: value_of(found, r)
        for r in reversed(found.refits)
        if len(r.hypothesis.effects) == 1
    }
    sound = [r for r in found.refits if not r.beyond()]
    for r in sound or found.refits:
        [*_, (effect, place)] = r.hypothesis.effects
        simpler = [singles.get((e, place), math.inf) for e in CONTAINS.get(effect, ())]
        if len(r.hypothesis.effects) == 1 and min(simpler, default=math.inf) <= value_of(found, r):
            continue
        if len(r.hypothesis.effects) > 1:
            alone = min(singles.get(e, math.inf) for e in r.hypothesis.effects)
            if value_of(found, r) > alone - SECOND or _foretells_worse(found, r):
                continue
            if _mended(found, r):
                continue
        label = r.hypothesis.label
        if label not in by_label or value_of(found, r) < value_of(found, by_label[label]):
            by_label[label] = r
    return list(by_label.values())


def how_often_right(over_floor: float, explained: float) -> float:
    """The share of leaders that are right, of those that leave and explain as much.

    over_floor: residual over floor, of the worst series; explained: share of what could be, 0 .. 1
    """
    by_floor = np.interp(over_floor, *RIGHT_AT_FLOOR)
    return float(max(by_floor, np.interp(explained, *RIGHT_BY_SHARE)))


def leaders(ranked: Sequence[tuple[Refit, float]]) -> tuple[str, ...]:
    """The leader and those that keep the sum of probabilities from being sure."""
    group, whole = [], 0.0
    for r, p in ranked:
        if whole >= SURE:
            break
        group.append(r.hypothesis.label)
        whole += p
    return tuple(group)


def value_of(found: Survey, r: Refit) -> float:
    """The criterion, and the price of a law of the angle where hardly any angle was travelled.

    Over a small arc such a law is a constant or a slope, and the plainer name is the likelier one.
    """
    return found.criterion[key_of(r)] + SMALL_ARC * small_arcs(found, r)


def small_arcs(found: Survey, r: Refit) -> int:
    """How many of its laws of the angle saw less than a radian of it."""
    travel = found.evidence.confrontation.sizes().get("travel", 0.0)
    count = 0
    for effect, place in r.hypothesis.effects:
        label = f"{effect}@{place}"
        order = max([x for p, x in r.hypothesis.fixed.items() if p.startswith(label)], default=1.0)
        if any(p.path == f"{label}.phase" for p in r.free):
            arc = order * travel * ratio_to_table(found.evidence.confrontation.core, _part(place))
            count += arc < 1.0
    return count


def _is_plainer(found: Survey, r: Refit, bent: Refit) -> bool:
    """Whether r has a plain law where the other has one of a small arc, and does as much.

    There the law of the angle is a constant and a slope, and anything that varies along the way.
    """
    if not small_arcs(found, bent) or small_arcs(found, r):
        return False
    [changed, *more] = set(bent.hypothesis.effects) - set(r.hypothesis.effects) or [("", "")]
    alike = {e for e, _ in set(r.hypothesis.effects) - set(bent.hypothesis.effects)}
    if more or not changed[0] or not alike:
        return False
    confused = set(_core.effect_type(changed[0]).confused_with.split(","))
    return alike <= confused and explained_by(found, r) > explained_by(found, bent) - AS_MUCH


def _part(place: str) -> str:
    """One part of a group."""
    return {"motors": "motor_1", "pinions": "pinion_1", "meshes": "mesh_1"}.get(place, place)


def _mended(found: Survey, pair: Refit) -> bool:
    """Whether its second law only mends the first, which is nearly of its kind and explains all.

    A model is never quite the machine, and what it lacks grows with what it explains. Two laws of
    friction are for `judge` to look at.
    """
    (first, _), (second, _) = pair.hypothesis.effects
    if not akin(first, second) or (rubs(first) and rubs(second)):
        return False
    alone, share = brought(found, pair)
    if alone is None or share >= MENDED:
        return False
    return bool(excess(found, alone.left).max() < ENOUGH)


def brought(found: Survey, pair: Refit) -> tuple[Refit | None, float]:
    """The better of a pair's laws alone, and the share of the pair's gain that the other brings."""
    effects = pair.hypothesis.effects
    singles = [r for r in found.refits if len(r.hypothesis.effects) == 1]
    parts = [r for r in singles if r.hypothesis.effects[0] in effects]
    alone = min(parts, key=lambda r: found.criterion[key_of(r)], default=None)
    if alone is None:
        return None, 1.0
    none, one, both = (found.criterion[key_of(r)] for r in (found.base, alone, pair))
    return alone, (one - both) / (none - both) if none > both else 0.0


def _foretells_worse(found: Survey, pair: Refit) -> bool:
    """Whether either effect alone foretells each stretch from the others better than both."""
    c, seen = found.evidence.confrontation, found.evidence
    alone = [r for r in found.refits if r.hypothesis.effects[0] in pair.hypothesis.effects]
    alone = [r for r in alone if len(r.hypothesis.effects) == 1]
    own = c.headline(held_out(seen, pair))
    return any(c.headline(held_out(seen, r)) < own for r in alone)

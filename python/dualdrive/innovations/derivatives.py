"""Slopes of innovations: by the recursion of the filter's own sensitivities, else by differences.

(Ljung, System Identification, 2nd ed., 10.3; `cpp/src/innovations/sensitivity.hpp`.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.innovations.greybox import GreyBox
from dualdrive.innovations.prediction import LOST, sensitivities
from dualdrive.innovations.records import Predictable
from dualdrive.innovations.variant import Point, Variant, flat

Array = NDArray[np.float64]

#: of a unit of an unknown: a difference at most, and at least; how far it moves all residuals
#: together, and how often that before it is taken anew
_DIFFERENCE, _LEAST, _SCATTER, _TOO_LONG = 1e-3, 1e-8, 1.0, 3.0
_TOGETHER = 8  # neighbours of one replay
_FEW = 2  # numbers whose slopes two replays tell as soon


def has_sensitivities(grey: GreyBox, point: Point) -> bool:
    """Whether first-order changes can be told about a point.

    Args:
        grey: records and shared unknowns.
        point: where.

    """
    return _told_at(grey.machine(point.variant, point.theta), grey.records)


def _told_at(core: Any, records: Sequence[Predictable]) -> bool:
    return all(_core.has_sensitivities(core, r.sampled) for r in records)


def changes(
    grey: GreyBox,
    point: Point,
    others: Sequence[tuple[Variant, Array]],
    gains: Sequence[Any],
    *,
    most_apart: float = 1.0,
    share: float = 1.0,
) -> list[Array | None]:
    """How the residuals at a point change, to first order, with other machines in its place.

    Args:
        grey: records and shared unknowns.
        point: where.
        others: (variant, its unknowns) of each.
        gains: held.
        most_apart: share of the changes of modes that may come more than a sample apart in one:
            beyond, it is no small change.
        share: of the change that is meant: as much of it has to be small.

    Returns:
        Of each, flat; None where the first order can't tell, or no machine is made. A change
        beyond what a lost replay counts is none of first order: contacts that bounce, and
        filters that hardly correct, part from their neighbours as fast as they can.

    """
    core, offsets = grey.machine(point.variant, point.theta), grey.constants(point.theta)
    if not _told_at(core, grey.records):
        return [None] * len(others)
    neighbours: list[tuple[int, tuple[Any, Mapping[str, float]]]] = []
    for k, (variant, theta) in enumerate(others):
        try:
            neighbours.append((k, (grey.machine(variant, theta), grey.constants(theta))))
        except ValueError:
            continue
    parts = [neighbours[k : k + _TOGETHER] for k in range(0, len(neighbours), _TOGETHER)]
    jobs = [(part, r, g) for part in parts for r, g in zip(grey.records, gains, strict=True)]

    def one(job: tuple[Any, Predictable, Any]) -> list[Array | None]:
        part, record, own = job
        return sensitivities(
            core, offsets, record, own, [x for _, x in part], most_apart=most_apart
        )

    grey.counter.add(len(grey.records) * len(neighbours))
    told: dict[int, list[Array | None]] = {}
    for (part, _, _), found in zip(jobs, grey.pool.map(one, jobs), strict=True):
        for (k, _), own in zip(part, found, strict=True):
            told.setdefault(k, []).append(own)
    result: list[Array | None] = [None] * len(others)
    for k, parts_of_it in told.items():
        known = [x for x in parts_of_it if x is not None]
        if len(known) == len(grey.records) and all(
            share * np.max(np.abs(x)) <= LOST for x in known
        ):
            result[k] = flat(known)
    return result


def slopes(grey: GreyBox, point: Point, which: Sequence[int], gains: Sequence[Any]) -> list[Array]:
    """Derivatives of the residuals by some unknowns, flat per unknown.

    By the recursion of the filter's own sensitivities where it tells, else by differences, and
    so where only few are asked for.
    """
    steps = {k: _longest(grey, k) for k in which}
    found = _told(grey, point, steps, gains) if len(which) > _FEW else {}
    rest = [k for k in which if k not in found]
    if rest:
        found |= _by_differences(grey, point, rest, gains)
    return [found[k] for k in which]


def slopes_nearby(grey: GreyBox, point: Point, gains: Sequence[Any]) -> tuple[list[Array], bool]:
    """Derivatives by all unknowns with which a fit may go some way, and whether they are exact.

    Of a machine with laws that are not affine those by the shared unknowns are told about that
    machine without them: while much torque is unknown the record holds both on one course, and a
    law changes little of these derivatives. They go along with one replay, as differences do not.

    Args:
        grey: records and shared unknowns.
        point: where.
        gains: held.

    Returns:
        Flat per unknown; True where all of them are those at the point.

    """
    every, shared = range(len(point.theta)), grey.shared
    machine = grey.machine(point.variant, point.theta)
    affine = affine_part(machine)
    if len(affine.effects) == len(machine.effects) or not _told_at(affine, grey.records):
        return slopes(grey, point, every, gains), True
    try:
        about = replace(point, variant=Variant(affine), theta=point.theta[:shared])
        found = _told(grey, about, {k: _longest(grey, k) for k in range(shared)}, gains)
    except ValueError:  # a shared unknown of such a law, or gains of another state
        found = {}
    rest = [k for k in every if k not in found]
    found |= dict(zip(rest, slopes(grey, point, rest, gains), strict=True))
    return [found[k] for k in every], len(rest) == len(every)


def affine_part(core: Any) -> Any:
    """A machine without those of its laws that are not affine between switches."""
    own = core.copy()
    for e in core.effects:
        if not _core.effect_type(e["effect"]).affine:
            own.remove_effect(e["label"])
    return own


def _told(
    grey: GreyBox, point: Point, steps: Mapping[int, float], gains: Sequence[Any]
) -> dict[int, Array]:
    signed, moved = _moved(grey, point, steps)
    found = changes(grey, point, [(point.variant, theta) for theta in moved], gains)
    return {
        k: change / h
        for (k, h), change in zip(signed.items(), found, strict=True)
        if change is not None
    }


def _by_differences(
    grey: GreyBox, point: Point, which: Sequence[int], gains: Sequence[Any]
) -> dict[int, Array]:
    """Derivatives by finite differences.

    A step moves the residuals by their own scatter and no further: numbers that a record tells
    only together would seem to be told apart by the error of the differences.
    """
    names = {k: _name(grey, point.variant, k) for k in which}
    steps = {k: grey.steps.get(name, _longest(grey, k)) for k, name in names.items()}
    found = _differences(grey, point, steps, gains)
    again = {}
    for k, column in found.items():
        length = float(np.linalg.norm(column))
        known = min(_longest(grey, k), max(_SCATTER / max(length, 1e-300), _LEAST))
        grey.steps[names[k]] = known
        if _TOO_LONG * known < steps[k]:
            again[k] = known
    return found | _differences(grey, point, again, gains)


def _moved(
    grey: GreyBox, point: Point, steps: Mapping[int, float]
) -> tuple[dict[int, float], list[Array]]:
    """Unknown -> its step, into its bounds, and where each leads."""
    high = grey.bounds(point.variant)[1]
    signed = {k: -h if point.theta[k] + h > high[k] else h for k, h in steps.items()}
    moved = []
    for k, h in signed.items():
        theta = point.theta.copy()
        theta[k] += h
        moved.append(theta)
    return signed, moved


def _differences(
    grey: GreyBox, point: Point, steps: Mapping[int, float], gains: Sequence[Any]
) -> dict[int, Array]:
    signed, moved = _moved(grey, point, steps)
    base = flat(point.residuals)
    others = grey.points([point.variant] * len(moved), moved, gains)
    return {
        k: (flat(other.residuals) - base) / h
        for (k, h), other in zip(signed.items(), others, strict=True)
    }


def _longest(grey: GreyBox, k: int) -> float:
    """Of a difference: a share of what is believed of the unknown."""
    known = k < grey.shared and np.isfinite(grey.sigma[k])
    return _DIFFERENCE * (float(grey.sigma[k]) if known else 1.0)


def _name(grey: GreyBox, variant: Variant, k: int) -> str:
    if k < grey.shared:
        return [*(p.path for p in grey.nominal), *grey.offsets][k]
    return variant.extra[k - grey.shared].path

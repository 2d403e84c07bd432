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
_Parts = list[Array | None]  # of every record; None where the first order can't tell

#: of a unit of an unknown: how far a neighbour of the recursion is, and a difference of replays
_NEIGHBOUR, _DIFFERENCE = 1e-3, 1e-6
_TOGETHER = 32  # neighbours of one replay: what switches cost is shared by them
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
    return [_whole(x) for x in _by_record(grey, point, others, gains, most_apart, share)]


def _whole(parts: _Parts) -> Array | None:
    known = [x for x in parts if x is not None]
    return flat(known) if len(known) == len(parts) else None


def _by_record(
    grey: GreyBox,
    point: Point,
    others: Sequence[tuple[Variant, Array]],
    gains: Sequence[Any],
    most_apart: float = 1.0,
    share: float = 1.0,
) -> list[_Parts]:
    """The changes of every record, as far as the first order tells of it."""
    found: list[_Parts] = [[None] * len(grey.records) for _ in others]
    core, offsets = grey.machine(point.variant, point.theta), grey.constants(point.theta)
    if not _told_at(core, grey.records):
        return found
    neighbours: list[tuple[int, tuple[Any, Mapping[str, float]]]] = []
    for k, (variant, theta) in enumerate(others):
        try:
            neighbours.append((k, (grey.machine(variant, theta), grey.constants(theta))))
        except ValueError:
            continue
    parts = [neighbours[k : k + _TOGETHER] for k in range(0, len(neighbours), _TOGETHER)]
    jobs = [(part, r) for part in parts for r in range(len(grey.records))]

    def one(job: tuple[Any, int]) -> _Parts:
        part, r = job
        return sensitivities(
            core, offsets, grey.records[r], gains[r], [x for _, x in part], most_apart=most_apart
        )

    grey.counter.add(len(grey.records) * len(neighbours))
    for (part, r), told in zip(jobs, grey.pool.map(one, jobs), strict=True):
        for (k, _), own in zip(part, told, strict=True):
            if own is not None and share * np.max(np.abs(own)) <= LOST:
                found[k][r] = own
    return found


def slopes(grey: GreyBox, point: Point, which: Sequence[int], gains: Sequence[Any]) -> list[Array]:
    """Derivatives of the residuals by some unknowns, flat per unknown.

    Of each record by the recursion of the filter's own sensitivities where it tells, else by
    differences, and so where only few are asked for.
    """
    steps = {k: _NEIGHBOUR * _unit(grey, k) for k in which}
    told = _told(grey, point, steps, gains) if len(which) > _FEW else {}
    return _completed(grey, point, which, told, gains)


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
        told = _told(grey, about, {k: _NEIGHBOUR * _unit(grey, k) for k in range(shared)}, gains)
    except ValueError:  # a shared unknown of such a law, or gains of another state
        told = {}
    # Of an unknown all records are told nearby or none: a step by both kinds has no objective.
    wholes = {k: _whole(parts) for k, parts in told.items()}
    nearby = {k: whole for k, whole in wholes.items() if whole is not None}
    rest = [k for k in every if k not in nearby]
    exact = dict(zip(rest, slopes(grey, point, rest, gains), strict=True))
    return [(exact | nearby)[k] for k in every], len(rest) == len(every)


def affine_part(core: Any) -> Any:
    """A machine without those of its laws that are not affine between switches."""
    own = core.copy()
    for e in core.effects:
        if not _core.effect_type(e["effect"]).affine:
            own.remove_effect(e["label"])
    return own


def _told(
    grey: GreyBox, point: Point, steps: Mapping[int, float], gains: Sequence[Any]
) -> dict[int, _Parts]:
    """Unknown -> derivatives by it, as far as the first order tells of a record."""
    signed, moved = _moved(grey, point, steps)
    found = _by_record(grey, point, [(point.variant, theta) for theta in moved], gains)
    return {
        k: [None if own is None else own / h for own in parts]
        for (k, h), parts in zip(signed.items(), found, strict=True)
    }


def _completed(
    grey: GreyBox,
    point: Point,
    which: Sequence[int],
    told: Mapping[int, _Parts],
    gains: Sequence[Any],
) -> list[Array]:
    """Derivatives by some unknowns, flat; by differences on those records where none are told."""
    nothing: _Parts = [None] * len(grey.records)
    found = {k: list(told.get(k, nothing)) for k in which}
    for r in range(len(grey.records)):
        if missing := [k for k, parts in found.items() if parts[r] is None]:
            there = replace(point, residuals=(point.residuals[r],))
            on = grey.on([grey.records[r]])
            for k, column in _by_differences(on, there, missing, [gains[r]]).items():
                found[k][r] = column
    return [flat([own for own in parts if own is not None]) for parts in found.values()]


def _by_differences(
    grey: GreyBox, point: Point, which: Sequence[int], gains: Sequence[Any]
) -> dict[int, Array]:
    """Derivatives by finite differences, of one record.

    As short as rounding allows, which moves all residuals by 2e-9: numbers that a record tells
    only together would seem to be told apart by the error of longer ones. And innovations jump,
    where a correction parts flanks or does not, or a step of integration is halved or is not:
    such a jump, divided by the difference that it lies in, is no slope, and long ones hold more.
    """
    signed, moved = _moved(grey, point, {k: _DIFFERENCE * _unit(grey, k) for k in which})
    base = flat(point.residuals)
    others = grey.points([point.variant] * len(moved), moved, gains)
    return {
        k: (flat(other.residuals) - base) / h
        for (k, h), other in zip(signed.items(), others, strict=True)
    }


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


def _unit(grey: GreyBox, k: int) -> float:
    """What is believed of an unknown; of a law's number its usual size."""
    known = k < grey.shared and np.isfinite(grey.sigma[k])
    return float(grey.sigma[k]) if known else 1.0

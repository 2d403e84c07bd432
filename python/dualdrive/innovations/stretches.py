"""Stretches of long records: what a search looks at before its answer is held against everything.

How well a law is told from another one grows with the samples, and so does the work. What tells
them apart may last a second: a chirp in the loop's resonance, a turn at full speed. Half of the
stretches are spread over every record, the others lie where a machine fails most; or, where it
fails nowhere, where records tell most of its numbers (D-optimal: Fedorov, Theory of Optimal
Experiments, 1972). Each begins from the state that a filter of the whole record had there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.innovations.greybox import GreyBox
from dualdrive.innovations.prediction import predicted
from dualdrive.innovations.records import Predictable
from dualdrive.innovations.variant import Point

Array = NDArray[np.float64]

_LENGTH = 500  # samples of a stretch: many times what a filter needs to find its state
_GOLDEN = 0.6180339887498949


def spread(samples: Sequence[int], most: int) -> list[list[int]]:
    """Blocks of `_LENGTH` samples of records, spread evenly: numbers of blocks per record.

    As many of each as its length allows, one at least, at places that no period of a motion repeats
    (multiples of the golden section, the least even of sequences).

    Args:
        samples: how many each record has.
        most: samples to be kept, as far as one block of every record allows.

    """
    whole = sum(samples)
    found, serial = [], 0
    for n in samples:
        blocks = n // _LENGTH
        count = min(blocks, max(1, int(most * n / whole) // _LENGTH))
        own = []
        for k in range(count):
            serial += 1
            own.append(int((k + serial * _GOLDEN % 1.0) * blocks / count))
        found.append(own)
    return found


def chosen(
    residuals: Sequence[Array],
    most: int,
    periods: Sequence[int] = (),
    columns: Sequence[Array] | None = None,
    precision: Array | None = None,
) -> list[list[tuple[int, int]]]:
    """Stretches of records, (first sample, how many) per record: blocks of `_LENGTH` samples.

    Half of them are spread evenly, the others lie where most is left, or where derivatives are
    given, where they tell most. Of a record that is shorter than a block, all.

    Args:
        residuals: whitened innovations of every record, shape (n, channels).
        most: samples to be kept.
        periods: samples of each after which sampled loops repeat; stretches begin with one.
        columns: derivatives by every number, records end to end, shape (rows,).
        precision: of what is believed of the numbers, shape (numbers,).

    """
    # of whole periods: they neither overlap nor begin amid one
    lengths = [_LENGTH // p * p for p in periods or [1] * len(residuals)]
    blocks = spread([len(r) for r in residuals], most // 2)
    taken = [(k, b) for k, own in enumerate(blocks) for b in own]
    known = set(taken)
    places = [
        (k, b)
        for k, r in enumerate(residuals)
        for b in range(len(r) // _LENGTH)
        if (k, b) not in known
    ]
    count = max(0, most // _LENGTH - len(taken))

    def of(of_each: Sequence[Array], place: tuple[int, int]) -> Array:
        k, b = place
        n = lengths[k]
        own: Array = of_each[k][b * n : (b + 1) * n]
        return own

    if columns is None or precision is None:
        places.sort(key=lambda place: -float(np.sum(of(residuals, place) ** 2)))
        added = places[:count]
    else:
        slopes = _of_records(columns, residuals)
        told = [np.einsum("tca,tcb->ab", *2 * (of(slopes, place),)) for place in taken + places]
        first = np.diag(precision) + sum(told[: len(taken)], np.zeros((len(columns),) * 2))
        added = [places[j] for j in d_optimal(first, told[len(taken) :], count)]
    for k, b in added:
        blocks[k].append(b)
    return [
        [(b * n, n) for b in sorted(own)] or [(0, len(r))]
        for r, own, n in zip(residuals, blocks, lengths, strict=True)
    ]


def _of_records(columns: Sequence[Array], residuals: Sequence[Array]) -> list[Array]:
    """Derivatives of every record's innovations, shape (n, channels, numbers)."""
    ends = np.cumsum([r.size for r in residuals])[:-1]
    parts = zip(*(np.split(own, ends) for own in columns), strict=True)
    return [
        np.stack(part, axis=1).reshape(*r.shape, len(columns))
        for part, r in zip(parts, residuals, strict=True)
    ]


def d_optimal(first: Array, told: Sequence[Array], count: int) -> list[int]:
    """Which informations make the determinant of their sum largest, one after the other.

    Args:
        first: the information that is there already, positive definite, shape (numbers, numbers).
        told: that of every candidate.
        count: how many are taken.

    """
    unit = 1.0 / np.sqrt(np.diag(first))
    total, added = unit * first * unit[:, None], list[int]()
    rest = {j: unit * own * unit[:, None] for j, own in enumerate(told)}
    for _ in range(min(count, len(rest))):
        best = max(rest, key=lambda j: float(np.linalg.slogdet(total + rest[j])[1]))
        total = total + rest.pop(best)
        added.append(best)
    return added


def some(
    grey: GreyBox,
    point: Point,
    gains: Sequence[Any],
    most: int,
    columns: Sequence[Array] | None = None,
) -> GreyBox:
    """The same unknowns on stretches of the records, begun as the filter of a point has it.

    Args:
        grey: on whole records.
        point: a variant at a point, whose failures the stretches are to show.
        gains: Kalman gains there, per record.
        most: samples to be kept; where there are no more, all of them.
        columns: derivatives there, of which the stretches are to tell, where it fails nowhere.

    """
    if grey.samples <= most:
        return grey
    core, offsets = grey.machine(point.variant, point.theta), grey.constants(point.theta)

    def one(job: tuple[Predictable, Any, list[tuple[int, int]]]) -> Predictable:
        record, own, which = job
        found = predicted(core, offsets, record, own, states=True)
        names, trajectory = found["states"], found["trajectory"]
        begins = [
            dict(zip(names, map(float, trajectory[first]), strict=True)) if first else {}
            for first, _ in which
        ]
        return record.stretches(which, begins)

    grey.counter.add(len(grey.records))
    _, precision = grey.believed(point.variant)
    which = chosen(point.residuals, most, [own.phases for own in gains], columns, precision)
    jobs = zip(grey.records, gains, which, strict=True)
    return grey.on(list(grey.pool.map(one, jobs)))

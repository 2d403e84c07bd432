"""Stretches of long records: what a search looks at before its answer is held against everything.

How well a law is told from another one grows with the samples, and so does the work. Stretches
spread over every record, each begun from the state that a filter of the whole record had there,
tell strong laws apart at a cost that does not depend on how long the records are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from dualdrive.innovations.greybox import GreyBox
from dualdrive.innovations.prediction import predicted
from dualdrive.innovations.records import Predictable
from dualdrive.innovations.variant import Point

_LENGTH = 500  # samples of a stretch: many times what a filter needs to find its state
_GOLDEN = 0.6180339887498949


def spread(
    samples: Sequence[int], most: int, periods: Sequence[int] = ()
) -> list[list[tuple[int, int]]]:
    """Stretches of records, (first sample, how many) per record, `most` samples in all or fewer.

    One in each of as many equal parts of a record as its length allows, at places that no period
    of a motion repeats (multiples of the golden section, the least even of sequences).

    Args:
        samples: how many each record has.
        most: to be kept; every record keeps a stretch.
        periods: samples of each after which sampled loops repeat; stretches begin with one.

    """
    whole = sum(samples)
    if whole <= most:
        return [[(0, n)] for n in samples]
    found, serial = [], 0
    for n, period in zip(samples, periods or [1] * len(samples), strict=True):
        count = max(1, int(most * n / whole) // _LENGTH)
        part = n / count
        if part <= _LENGTH:
            found.append([(0, n)])
            continue
        own = []
        for k in range(count):
            serial += 1
            first = int(k * part + (serial * _GOLDEN % 1.0) * (part - _LENGTH))
            own.append((first // period * period, _LENGTH))
        found.append(own)
    return found


def some(grey: GreyBox, point: Point, gains: Sequence[Any], most: int) -> GreyBox:
    """The same unknowns on stretches of the records, begun as the filter of a point has it.

    Args:
        grey: on whole records.
        point: a variant at a point.
        gains: Kalman gains there, per record.
        most: samples to be kept; where there are no more, all of them.

    """
    if grey.samples <= most:
        return grey
    core, offsets = grey.machine(point.variant, point.theta), grey.constants(point.theta)
    periods = [own.phases for own in gains]
    chosen = spread([len(r.measured) for r in grey.records], most, periods)

    def one(job: tuple[Predictable, Any, list[tuple[int, int]]]) -> Predictable:
        record, own, which = job
        found = predicted(core, offsets, record, own, states=True)
        names, trajectory = found["states"], found["trajectory"]
        begins = [
            dict(zip(names, map(float, trajectory[first]), strict=True)) if first else {}
            for first, _ in which
        ]
        return record.stretches(which, begins)

    grey.counter.replays += len(grey.records)
    jobs = zip(grey.records, gains, chosen, strict=True)
    return grey.on(list(grey.pool.map(one, jobs)))

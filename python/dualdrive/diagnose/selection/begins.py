"""Where a law begins beside one that is known already."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.candidates import parts_of
from dualdrive.diagnose.screening import Library, is_part, scores
from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.diagnose.selection.refits import begin
from dualdrive.innovations import GreyBox, Point, Variant, carried, coordinates, values
from dualdrive.replay import ratio_to_table

Array = NDArray[np.float64]

_RANGE = ("centre", "width")  # angles of a local fault, at its own wheel


def begins_beside(core: Any, known: Point, variant: Variant, theta: Array) -> list[Array]:
    """Where a law may begin beside one that is known, shape (unknowns,) each.

    From its own numbers; from the known one's, where they share any; and where both are one local
    fault at two wheels, with its range by the gear ratio: a pinion that goes to and fro shows at
    every angle what the ring does.

    Args:
        core: of the machine.
        known: the known law, at its best.
        variant: the other law.
        theta: its own numbers, shape (unknowns,).

    """
    beside = carried(known, variant, theta)
    shared = len(theta) - len(variant.extra)
    told = values(known.variant.extra, known.theta[shared:])
    (effect, place), (other, at) = known.variant.effects[-1], variant.effects[-1]
    own = {p.path: p for p in variant.extra if p.path.startswith(f"{other}@{at}.")}
    there = {path: told.get(f"{effect}@{place}.{path.rpartition('.')[2]}") for path in own}
    ranged = {f"{other}@{at}.{name}" for name in _RANGE} <= set(own)
    if effect != other or place == at or not ranged or None in there.values():
        return [theta, beside]
    first, second = ((parts_of(core, x) or [x])[0] for x in (at, place))
    times = ratio_to_table(core, first) / ratio_to_table(core, second)
    asked = dict(told)
    for path, x in there.items():
        turned = times if path.rpartition(".")[2] in _RANGE else 1.0
        asked[path] = min(max(turned * float(x or 0.0), own[path].low), own[path].high)
    return [theta, beside, np.r_[beside[:shared], coordinates(variant.extra, asked)]]


def in_its_place(library: Library, grey: GreyBox, known: Fitted, variant: Variant) -> Array | None:
    """Where a law does most of what the last law of a known machine does, shape (unknowns,).

    That one taken out, all other numbers and the noise as they are, and the innovations regressed
    on what this one would change. Under so little unknown torque a fit goes astray that begins far
    from its valley; of two laws that do nearly the same this is in it.

    Args:
        library: what variants are made of.
        grey: the records.
        known: the machine.
        variant: the law, beside all others of the machine.

    Returns:
        None where the regression says nothing: a law with states of its own, or one that does
        nothing of the kind.

    """
    rest = library.without(known.variant, known.variant.effects[-1])
    if rest is None or any(map(is_part, (known.variant, variant))):
        return None
    paths = [p.path for p in rest.extra]
    if paths != [p.path for p in variant.extra[: len(paths)]]:
        return None
    theta = carried(known.point, rest, grey.start(rest))
    [without] = grey.points([rest], [theta], known.gains)
    if without.lost:
        return None
    [told] = scores(grey, without, [], [variant], known.gains, known.inflation)
    return begin(without, told) if told.start and told.gain > 0.0 else None

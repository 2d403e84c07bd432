"""Which scores are worth a refit, and the refits under their leader's noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.diagnose.screening import Scored, is_part, local_faults, travel
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.diagnose.selection.parts import part_refitted, part_score
from dualdrive.estimation.thresholds import threshold
from dualdrive.innovations import GreyBox, Noise, Place, Point, Variant, coordinates, fit, values

Array = NDArray[np.float64]

#: where a law begins beside the data sheet: times its score's size, most of which unknown torque
#: bears there; and a delay, times its usual one
_SIZES = tuple(1.5**k for k in range(-2, 5))
_DELAYS = tuple(1.5**k for k in range(-4, 7))
_MANY, _FEW = 20, 3  # points: of more, so few are looked at under gains of their own
_SMALLER, _TRIES = 0.25, 5  # backtracking: each of so many sizes times the last one


def worth_refitting(
    found: Sequence[Scored], most: int, hopeless: float, orders: int | None = None
) -> list[Scored]:
    """The best scores, and what they may be taken for.

    Args:
        found: score tests beside one leader.
        most: how many of the best.
        hopeless: gain below which none is.
        orders: of one law, at most; None: as `THRESHOLDS` has it, and all that are tied with the
            best: about one angle waves of many orders are alike.

    """
    known = [s for s in found if np.isfinite(s.gain)]
    known.sort(key=lambda s: -(s.gain - 2.0 * np.log(s.variant.looks)))
    each = int(threshold("orders")) if orders is None else orders
    hopeful = [s for s in known if s.gain > hopeless]
    best = _of_each_law(hopeful, each)[:most]
    if orders is None and best:
        laws, tied = {s.variant.label for s in best}, threshold("tied") * best[0].gain
        best += [s for s in hopeful if s.variant.label in laws and s.gain > tied and s not in best]
    # and what the best are taken for, whose own score may be faint while another law is missing
    names = {s.variant.label for s in best}
    rivals = [
        s
        for s in known
        if s.gain > 0.0
        and s.variant.label not in names
        and any(confused(b.variant, s.variant) for b in best)
    ]
    return best + _of_each_law(rivals, 1)[: most // 2]


def _of_each_law(found: Sequence[Scored], most: int) -> list[Scored]:
    """So many orders of each, the first ones."""
    kept, orders = list[Scored](), dict[str, int]()
    for s in found:
        orders[s.variant.label] = orders.get(s.variant.label, 0) + 1
        if orders[s.variant.label] <= most:
            kept.append(s)
    return kept


def begin(point: Point, s: Scored, times: float = 1.0) -> Array:
    """Where a law begins: a leader's numbers, and its own as its score has them.

    Args:
        point: the leader.
        s: the law's score.
        times: what its strengths are multiplied by.

    """
    variant, known = s.variant, len(point.variant.extra)
    own = variant.extra[known:]
    asked = {
        p.path: min(max(s.start[p.path] * (times if p.strength else 1.0), p.low), p.high)
        for p in own
        if p.path in s.start
    }
    start: Array = np.r_[point.theta, coordinates(own, asked)]
    return start


def _other_sizes(grey: GreyBox, point: Point, s: Scored) -> list[Array]:
    """Where a law may begin whose score, beside numbers that stand in for it, is of another size.

    What a delay does is no multiple of what it does within a sample: its likelihood has a valley. A
    local fault has one at its own place, which a score under numbers that stand in for it misses.
    """
    own = s.variant.extra[len(point.variant.extra) :]
    if faults := local_faults(s.variant.grown, own, travel(grey)):
        return [begin(point, replace(s, start=fault)) for fault in faults]
    late = [p for p in own if p.strength and p.unit == "s"]
    if not late:
        return [begin(point, s, k) for k in _SIZES]
    started = [{p.path: k * p.scale for p in late} for k in _DELAYS]
    return [begin(point, replace(s, start={**s.start, **x})) for x in started]


def refining(grey: GreyBox, known: Fitted, s: Scored) -> Array:
    """Where a part begins that may refine a law that suffices already, shape (unknowns,).

    What it is taken for has its numbers, too: bristles slide at Coulomb's level.

    Args:
        grey: the records.
        known: the law, beside the leader that the part was scored beside.
        s: the part's score.

    """
    effect, place = known.variant.effects[-1]
    told = values(known.variant.extra, known.point.theta[grey.shared :])
    alike = {
        path.rpartition(".")[2]: x
        for path, x in told.items()
        if path.startswith(f"{effect}@{place}.") and confused(s.variant, known.variant)
    }
    asked = dict(s.start)
    for p in s.variant.extra:
        name = p.path.rpartition(".")[2]
        if p.path in told or name in alike:
            asked[p.path] = min(max(told.get(p.path, alike.get(name, p.low)), p.low), p.high)
    begun: Array = np.r_[known.point.theta[: grey.shared], coordinates(s.variant.extra, asked)]
    return begun


def refitted(
    estimator: Estimator,
    grey: GreyBox,
    leader: Fitted,
    s: Scored,
    columns: Sequence[Array],
    far: Scored | None = None,
) -> Place | None:
    """A law refitted under its leader's noise, a part near its best; None where that is nowhere.

    Args:
        estimator: of the machine.
        grey: the records.
        leader: beside which the law was scored.
        s: its score.
        columns: derivatives of the leader's innovations by all its unknowns.
        far: its score where the law may begin beside the data sheet's numbers, too.

    """
    point, variant, noise = leader.point, s.variant, leader.noise
    start, sheet = begin(point, s), grey.of_the_data_sheet(Variant(estimator.core))
    if is_part(variant):
        own = part_score(grey, point, columns, variant, noise)
        if not own.gain > threshold("hopeless"):
            return None
        # from the data sheet: the part may stand for what the numbers had stood for
        start[: grey.shared] = sheet
        scored = float(own.start[len(point.theta)])
        near = part_refitted(estimator, grey, variant, start, point.variant, noise, scored)
        stuck = near is None or near[0].minus_two_log > point.minus_two_log
        if stuck and own.gain > threshold("gain"):
            beside = estimator.likeliest(grey, variant, own.start, noise, roughly=True)
            if beside and (near is None or beside.point.minus_two_log < near[0].minus_two_log):
                near = beside.point, beside.noise
        return near
    shared = columns[: grey.shared]
    begun = _backtracked(grey, leader, s)
    found = [
        fit(
            grey, variant, begun.theta, leader.gains, steps=5, shared_columns=shared, nearby=True,
            begun=begun,
        )
    ]  # fmt: skip
    if far:
        # so may any law: it does for the data sheet's machine nearly what the leader's numbers do
        begins = [np.r_[sheet, own[grey.shared :]] for own in _other_sizes(grey, point, far)]
        begins = _nearest(grey, variant, begins, noise)
        seen = [f for f in grey.likelihoods(variant, [(x, noise) for x in begins]) if f]
        best = min(seen, key=lambda f: f[0].minus_two_log, default=None)
        alone = np.r_[sheet, point.theta[grey.shared :]]
        [without] = grey.likelihoods(point.variant, [(alone, noise)])
        worst = without[0].minus_two_log if without else point.minus_two_log
        share = threshold("tied") * (worst - point.minus_two_log)
        if best and worst - best[0].minus_two_log > share:
            found.append(fit(grey, variant, best[0].theta, best[1], steps=5, nearby=True))
    followed = [p for p in found if not p.lost]
    nearest = min(followed, key=lambda p: p.minus_two_log, default=None)
    return (nearest, noise) if nearest else None


def _backtracked(grey: GreyBox, leader: Fitted, s: Scored) -> Point:
    """Where a law begins beside a leader: at the size of its score, or a smaller one that fits.

    A mesh that bounces parts from its record under a hundredth of a usual damping, and a fit that
    begins there spends its steps on the way back (backtracking: Nocedal, Wright, Numerical
    Optimization, 2nd ed., algorithm 3.1). Beside numbers that stand in for a law none of its sizes
    may be likelier than none at all: the least harmful one then.
    """
    tried = list[Point]()
    for k in range(1 + _TRIES):
        start = begin(leader.point, s, _SMALLER**k)
        if tried and np.array_equal(start, tried[-1].theta):
            break  # nothing of it is a strength, or that is the least there is
        [there] = grey.points([s.variant], [start], leader.gains)
        tried.append(there)
        if there.minus_two_log < leader.point.minus_two_log or grey.counter.stop():
            break
    return min(tried, key=lambda p: p.minus_two_log)


def _nearest(grey: GreyBox, variant: Variant, begins: list[Array], noise: Noise) -> list[Array]:
    """Those of many points at which a variant is near the records, by the gains of one of them."""
    if len(begins) <= _MANY:
        return begins
    try:
        gains = grey.gains(variant, begins[0], noise)
    except ValueError:
        return begins  # each under gains of its own, then
    found = list[tuple[float, Array]]()
    for k in range(0, len(begins), _MANY):  # innovations of that many are kept at a time
        lot = begins[k : k + _MANY]
        points = grey.points([variant] * len(lot), lot, gains)
        found += [(p.minus_two_log, p.theta) for p in points]
    found.sort(key=lambda own: own[0])
    return [theta for _, theta in found[:_FEW]]


def with_rivals(ranked: Sequence[tuple[float, Place]], most: int) -> list[Place]:
    """The best laws, and as many of what the library says they are taken for.

    Two orders of each, and all that are tied with the best: beside a leader's noise an order, a
    number that is counted, is hardly told.

    Args:
        ranked: gains and refits, best first.
        most: how many laws of either.

    """
    labels: dict[str, list[Place]] = {}
    tied = threshold("tied") * ranked[0][0] if ranked else 0.0
    for gain, place in ranked:
        orders = labels.setdefault(place[0].variant.label, [])
        if len(orders) < threshold("orders") or gain > tied:
            orders.append(place)
    own = list(labels.values())
    best, rest = own[:most], own[most:]
    rivals = [
        places
        for places in rest
        if any(confused(b[0][0].variant, places[0][0].variant) for b in best)
    ]
    return [place for places in best + rivals[:most] for place in places]


def confused(known: Variant, other: Variant) -> bool:
    """Whether the other's last law is declared to be what the known one's is taken for.

    At the same place; where a law is declared to be taken for itself, at another one. And a wave
    for the same one of another order.
    """
    (effect, place), (rival, at) = known.effects[-1], other.effects[-1]
    if (effect, place) == (rival, at):
        return True
    declared: Any = _core.effect_type(effect).confused_with
    return (place == at or rival == effect) and rival in str(declared).split(",")

"""Zeros that drift, as a rival of every law."""

from __future__ import annotations

from collections.abc import Sequence

from dualdrive.diagnose.selection.estimation import on_all_samples
from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.diagnose.selection.forward import Forward, Means
from dualdrive.diagnose.selection.residual_analysis import white
from dualdrive.estimation.thresholds import threshold
from dualdrive.identify import FitError
from dualdrive.innovations import GreyBox


def weigh_drifting_zeros(own: Means, on: Forward, stretches: Sequence[GreyBox]) -> None:
    """What the best machine leaves, or one of its laws, explained by zeros that drift.

    Over times of their own, from a fraction of a second (1/f noise) to minutes. A rival of the laws
    like any other, and the last one: eccentric rings and encoders would pass for it while no law is
    in, and so may a second law beside the first.

    Args:
        own: of the search.
        on: what is known on all samples; what is found is kept there.
        stretches: on which was searched: what is far behind there is so everywhere.

    """
    ranking, estimator = on.ranking, own.estimator
    best = ranking.best
    if on.grey.counter.stop() or white(best):
        return
    places = [(grey, found) for grey in stretches if (found := _at(grey, best))]
    places = [*places, (on.grey, best)] if best is not ranking.base else []
    rivals = list[Fitted]()
    for fewer in _simpler(own, on, best):
        own.tell(f"drifting zeros beside {fewer.variant.key}")
        alone, behind = fewer, False
        for grey, lead in places:
            there = fewer if grey is on.grey else _at(grey, fewer)
            if there is None:
                continue
            alone = estimator.drifting(grey, there, rival=lead.point.minus_two_log)
            behind = alone.point.minus_two_log > lead.point.minus_two_log
            if behind and best.inflation < threshold("inflation"):
                break
        if not behind:
            rivals.append(alone)
    if not rivals and best is not ranking.base and best.inflation < threshold("inflation"):
        return
    own.tell(f"drifting zeros beside {best.variant.key}")
    found = estimator.drifting(on.grey, best)
    ranking.keep([found])
    ranking.keep(f for f in rivals if ranking.criterion(f) < ranking.criterion(found))


def _at(grey: GreyBox, f: Fitted) -> Fitted | None:
    """A fitted machine on other records, as it is; None where it can't follow them."""
    try:
        return on_all_samples(grey, f)
    except FitError:
        return None


def _simpler(own: Means, on: Forward, best: Fitted) -> list[Fitted]:
    """The best machine without one of its laws, as far as it is known, and without any."""
    ranking, found = on.ranking, [on.ranking.base]
    for effect in best.variant.effects:
        variant = own.library.without(best.variant, effect)
        known = ranking[variant.key] if variant and variant.key in ranking else ranking.base
        found += [known] if known not in found else []
    return found

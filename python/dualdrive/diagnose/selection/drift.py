"""Zeros that drift, as a rival of every law."""

from __future__ import annotations

from collections.abc import Sequence

from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.diagnose.selection.forward import Forward, Means
from dualdrive.diagnose.selection.residual_analysis import white
from dualdrive.estimation.thresholds import threshold
from dualdrive.innovations import GreyBox

#: records, and the numbers alone and the best machine on them
Stretches = tuple[GreyBox, Fitted, Fitted]


def weigh_drifting_zeros(own: Means, on: Forward, stretches: Sequence[Stretches]) -> None:
    """What the best machine leaves, explained by zeros that drift over times of their own.

    From a fraction of a second (1/f noise) to minutes. A rival of the laws like any other, and the
    last one: eccentric rings and encoders would pass for it while no law is in.

    Args:
        own: of the search.
        on: what is known on all samples; what is found is kept there.
        stretches: on which was searched: what is far behind there is so everywhere.

    """
    ranking, estimator = on.ranking, own.estimator
    best, base = ranking.best, ranking.base
    if on.grey.counter.stop() or white(best):
        return
    alone = base
    places = [*stretches, (on.grey, base, best)] if best is not base else []
    for grey, nothing, lead in places:
        own.tell("drifting zeros")
        alone = estimator.drifting(grey, nothing, rival=lead.point.minus_two_log)
        behind = alone.point.minus_two_log > lead.point.minus_two_log
        if behind and best.inflation < threshold("inflation"):
            return
    own.tell(f"drifting zeros beside {best.variant.key}")
    found = estimator.drifting(on.grey, best)
    ranking.keep([found])
    if ranking.criterion(alone) < ranking.criterion(found):
        ranking.keep([alone])

"""Variants at their best, ranked by the Bayesian criterion with a price on what is explained."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.estimation.thresholds import threshold

_NOTHING = "nothing"  # key of the machine as it is


class Ranking:
    """The best fit that is known of every variant.

    samples: of the records on which they are compared
    """

    def __init__(self, samples: int, found: Iterable[Fitted]) -> None:
        self.samples = samples
        self._fits: dict[str, Fitted] = {}
        self.keep(found)

    def __iter__(self) -> Iterator[Fitted]:
        return iter(self._fits.values())

    def __contains__(self, key: str) -> bool:
        return key in self._fits

    def __getitem__(self, key: str) -> Fitted:
        return self._fits[key]

    def keep(self, found: Iterable[Fitted]) -> None:
        """Each where it is likelier than what is known of its variant."""
        for f in found:
            known = self._fits.get(f.variant.key)
            if known is None or f.point.minus_two_log < known.point.minus_two_log:
                self._fits[f.variant.key] = f

    def forget(self, f: Fitted) -> None:
        """As if its variant had not been tried."""
        del self._fits[f.variant.key]

    @property
    def base(self) -> Fitted:
        """The machine as it is, its numbers refitted."""
        return self._fits[_NOTHING]

    @property
    def best(self) -> Fitted:
        """The leader."""
        return min(self, key=self.criterion)

    def criterion(self, f: Fitted) -> float:
        """Under the inflation of the best, lest a bad model's colour speaks for it."""
        numbers = len(f.variant.extra) * self.price() + 2.0 * np.log(f.variant.looks)
        return float(f.point.minus_two_log / self._inflation() + numbers)

    def price(self) -> float:
        """Of a number: that of the Bayesian criterion, and a share of all that is explained."""
        least = min(f.point.minus_two_log for f in self)
        explained = max(0.0, self.base.point.minus_two_log - least)
        share = threshold("price of a number") * explained / self._inflation()
        return float(np.log(self.samples) + share)

    def _inflation(self) -> float:
        return min(f.inflation for f in self)

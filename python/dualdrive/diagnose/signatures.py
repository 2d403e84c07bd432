"""Signatures of hypotheses: how each would show about a machine."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.diagnose.hypotheses import Hypothesis, Setting, is_strength, probes
from dualdrive.diagnose.orders import travel_of

Array = NDArray[np.float64]

#: RMS change, in units of noise, that a probe may make in its most touched series, and must
_LOUD, _FAINT = 10.0, 0.005
_WISHED = 0.5
_RESIZED = 3  # times at most: far too strong a probe does not tell by how much
_ALONG = (0.15, 0.5, 0.85)  # of the travel: where a local fault is tried


@dataclass(frozen=True, eq=False)
class Signature:
    """How a hypothesis would show: change of every series per probe, (n, k) each.

    settings: of the probes, made to be seen; usual: of the first, at its usual size
    strength: path of the effect's first strength, by which a probe grows
    """

    hypothesis: Hypothesis
    grown: Any
    settings: Sequence[Setting]
    usual: Setting
    strength: str
    columns: Sequence[Array]


class Prober:
    """Finds signatures about one machine, its nuisances at u."""

    def __init__(
        self, confrontation: TorqueBalance, u: Array, left: Sequence[Array], noise: Sequence[float]
    ) -> None:
        self.confrontation, self.u, self.left, self.noise = confrontation, u, left, noise
        self.sizes = confrontation.sizes()

    def __call__(self, hypothesis: Hypothesis) -> Signature | None:
        """None where no balance shows it."""
        grown, paths = hypothesis.put_in(self.confrontation.core, self.sizes)
        free = hypothesis.unknowns(grown, paths, self.sizes)
        strengths = {p.path: (p.low, p.high) for p in free if is_strength(grown, p.path)}
        if not strengths:
            return None  # nothing of it can be fitted
        settings = _scaled(probes(grown, free, self._travel(hypothesis)), 1.0, strengths)
        usual = settings[0]
        late = any("delay" in _core.effect_type(e).acts_on for e, _ in hypothesis.effects)
        first = self._change(grown, settings[0])
        if first is None:
            return None
        for _ in range(_RESIZED):
            factor = self._factor(first)
            if late:  # what a long delay does is no multiple of what a short one does
                factor = min(factor, 1.0)
            if factor == 1.0:
                break
            settings = _scaled(settings, factor, strengths)
            other = self._change(grown, settings[0])
            if other is None:
                return None
            first = other
        changes = [first, *(self._change(grown, one) for one in settings[1:])]
        kept = [(s, c) for s, c in zip(settings, changes, strict=True) if c is not None]
        columns = [np.stack(parts, axis=1) for parts in zip(*(c for _, c in kept), strict=True)]
        strength = next(path for path in usual if path in strengths)
        return Signature(hypothesis, grown, [s for s, _ in kept], usual, strength, columns)

    def _travel(self, hypothesis: Hypothesis) -> list[float]:
        """Angles along the travel of the effect's place, rad; about its spot where one is known."""
        c, label = self.confrontation, hypothesis.label
        if f"{label}.centre" in hypothesis.begins:
            centre, width = (hypothesis.begins[f"{label}.{name}"] for name in ("centre", "width"))
            return [centre - 0.5 * width, centre + 0.5 * width]
        reach = travel_of(c, hypothesis.effects[-1][1])
        if reach is None:
            return []
        return [reach[0] + share * (reach[1] - reach[0]) for share in _ALONG]

    def _change(self, grown: Any, setting: Mapping[str, float]) -> list[Array] | None:
        core = grown.copy()
        for path, value in setting.items():
            core.set(path, value)
        there = self.confrontation.left(core, self.u)
        if there is None:
            return None
        return [b - a for a, b in zip(self.left, there, strict=True)]

    def _factor(self, change: Sequence[Array]) -> float:
        """By how much a probe should be stronger or fainter."""
        loud = max(
            float(np.sqrt(np.mean(c**2))) / max(n, 1e-300)
            for c, n in zip(change, self.noise, strict=True)
        )
        if not math.isfinite(loud) or loud <= 0.0 or _FAINT <= loud <= _LOUD:
            return 1.0
        return float(min(max(_WISHED / loud, 1e-4), 1e4))


def _scaled(
    settings: Sequence[Setting], factor: float, bounds: Mapping[str, tuple[float, float]]
) -> list[Setting]:
    """The same with every strength so much larger, inside its bounds."""
    return [
        {
            path: min(max(x * factor, bounds[path][0]), bounds[path][1])
            if path in bounds and x != 0.0
            else x
            for path, x in one.items()
        }
        for one in settings
    ]

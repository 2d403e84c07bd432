"""Coordinates of a number that changes with an angle: what it is at the usual angle, and its wave.

Records that accelerate about one angle θ₀ tell J(θ₀) far better than the mean J̄ of
J(θ) = J̄ [1 + a cos(nθ + φ)]. In J̄ and a what they tell well is a curve, which a fit leaves with
every step of some length. J(θ₀), and the wave in units of the data sheet's J, are orthogonal to one
another (Cox, Reid, J. Royal Stat. Soc. B 49 (1987) 1-39), and the law is linear in them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.estimation.unknowns import Unknown
from dualdrive.innovations.harmonics import waves
from dualdrive.innovations.variant import Variant

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Modulation:
    """What changes with an angle.

    number:   path of it, in the machine its mean
    strength: path of the wave's amplitude, a fraction of that
    phase:    path of the wave's phase
    nominal:  the data sheet's number
    turned:   n θ₀, rad
    """

    number: str
    strength: str
    phase: str
    nominal: float
    turned: float

    def mean(self, at: Mapping[str, float]) -> dict[str, float]:
        """Number and strength as the machine has them.

        Args:
            at: path -> value in coordinates: the number at θ₀, the strength over the nominal one.

        """
        swing = self.nominal * at[self.strength]
        mean = at[self.number] - swing * math.cos(self.turned + at[self.phase])
        return {self.number: mean, self.strength: swing / mean if mean else math.inf}

    def usual(self, at: Mapping[str, float]) -> dict[str, float]:
        """The way back: number and strength in coordinates, from those of the machine."""
        mean, strength = at[self.number], at[self.strength]
        there = mean * (1.0 + strength * math.cos(self.turned + at[self.phase]))
        return {self.number: there, self.strength: mean * strength / self.nominal}


def modulations(
    variant: Variant, nominal: Sequence[Unknown], angles: Mapping[str, float]
) -> list[Modulation]:
    """Those of a variant whose number is unknown as well.

    Args:
        variant: a machine with laws under trial.
        nominal: unknown numbers of the data sheet.
        angles: body -> θ₀, its usual angle, rad.

    """
    known = {p.path: p.nominal for p in nominal}
    found = []
    for strength, phase in waves(variant.extra):
        path = variant.extra[strength].path
        label = path.rpartition(".")[0]
        effect, _, place = label.partition("@")
        number = f"{place}.{_modulated(effect)}"
        if number in known:
            turned = float(variant.grown.get(f"{label}.order")) * angles[place]
            turns = variant.extra[phase].path
            found.append(Modulation(number, path, turns, known[number], turned))
    return found


@cache
def _modulated(effect: str) -> str:
    """Name of the body's number that a law makes a wave of; empty where it makes none."""
    return str(_core.effect_type(effect).hypothesis.modulates)


def usual_angle(angle: Sequence[Array], steps: Sequence[float]) -> float:
    """The angle about which records accelerate most: the median, accelerations squared its weights.

    Args:
        angle: of each record, rad, shape (n,).
        steps: of each, s.

    """
    rates = [np.gradient(np.gradient(x, h), h) ** 2 for x, h in zip(angle, steps, strict=True)]
    every, weight = np.concatenate(angle), np.concatenate(rates)
    order = np.argsort(every, kind="stable")
    total = np.cumsum(weight[order])
    return float(every[order[np.searchsorted(total, 0.5 * total[-1])]])

"""Where a refit may begin: what a score foretells, the probes themselves, the torque balance."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.hypotheses import Setting, is_strength
from dualdrive.diagnose.refit import Refit, Start
from dualdrive.diagnose.signatures import Score

Array = NDArray[np.float64]

#: of the step that a score foretells: far away it foretells too much
_SHARES = (1.0, 0.3)
_FEW = 4  # probes
_OTHER_SIZES = (0.2, 3.0)  # times the usual one, of speeds and stiffnesses
_LEVELS = (0.1, 0.3, 1.0, 3.0)  # times the usual Stribeck speed


def near(score: Score, base: Refit) -> Iterator[Start]:
    """Along the way the score foretells, the nuisances moving with the effect, and its probes."""
    expected = _expected(score)
    for share in _SHARES:
        yield Start(base.u + share * score.gain.moved, _weaker(score, expected, share))
    for values in _probes(score)[:_FEW]:
        yield Start(base.u, values)


def from_nominal(score: Score, u: Array) -> Iterator[Start]:
    """From other nuisances than the refitted machine's, which the missing effect may have moved."""
    expected = _expected(score)
    yield Start(u, expected)
    for values in _probes(score)[:1]:
        yield Start(u, values)


def grown_from(score: Score, simple: Refit) -> Iterator[Start]:
    """Starts of a whole law that do what the simpler one did: the same level, little more."""
    label = score.signature.hypothesis.label
    level = next(x for path, x in simple.values().items() if path.endswith(".torque"))
    usual = score.signature.settings[0]
    own = {**usual, f"{label}.torque": level, f"{label}.static_ratio": 1.15}
    for factor in _LEVELS:
        yield Start(simple.u, {**own, f"{label}.speed": factor * usual[f"{label}.speed"]})


def _expected(score: Score) -> Setting:
    """The effect's numbers as the strengths of its probes tell."""
    settings, strengths = score.signature.settings, score.gain.strengths
    grown = score.signature.grown
    if not _strength(score):
        return dict(settings[int(np.argmax(strengths))])
    base = dict(settings[0])
    expected, amplitude = dict(base), float(strengths[0])
    whole = amplitude
    for one, g in zip(settings[1:], strengths[1:], strict=True):
        moved = next((path for path in one if one[path] != base[path] and one[path] != 0.0), "")
        if not moved:
            continue
        if is_strength(grown, moved):
            expected[moved] = float(g) * one[moved]
        elif moved.endswith("phase"):
            expected[moved] = base[moved] + math.atan2(float(g), amplitude)
            whole = math.hypot(amplitude, float(g))
        elif not moved.endswith("centre") and (total := whole + float(g)) > 0:
            share = min(max(float(g) / total, -1.0), 2.0)
            expected[moved] = base[moved] + share * (one[moved] - base[moved])
            whole = total
    if first := _strength(score):
        expected[first] = base[first] * whole
    return expected


def _weaker(score: Score, setting: Setting, share: float) -> Setting:
    grown = score.signature.grown
    return {p: share * x if is_strength(grown, p) else x for p, x in setting.items()}


def _probes(score: Score) -> list[Setting]:
    """The probes, their strength as the score has it, and at other speeds and stiffnesses."""
    first, settings = _strength(score), score.signature.settings
    base = dict(settings[0])
    size = max(_expected(score)[first] / base[first], 0.1) if first and base[first] else 1.0
    found = [{**one, first: one[first] * size} if first else dict(one) for one in settings]
    if first:
        found.append(base)
    found += [
        {**found[0], path: factor * x}
        for path, x in base.items()
        if path.endswith((".speed", ".stiffness"))
        for factor in _OTHER_SIZES
    ]
    return found


def _strength(score: Score) -> str:
    """Path of the effect's first strength; empty where it has none: limits, play."""
    grown = score.signature.grown
    return next((path for path in score.signature.settings[0] if is_strength(grown, path)), "")

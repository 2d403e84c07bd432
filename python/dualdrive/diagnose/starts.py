"""Where a refit may begin: what a score foretells, and usual sizes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.hypotheses import Setting, is_strength
from dualdrive.diagnose.refit import Refit, Start
from dualdrive.diagnose.stage import Score

Array = NDArray[np.float64]

#: of its usual size, where a refit of an effect may begin
_SIZES = (0.1, 1.0)
_MUCH = 2.0  # a factor between two sizes: nearer ones are one start
_LEVELS = (0.1, 0.3, 1.0, 3.0)  # times the usual Stribeck speed
_SOFTER = (1.0, 0.1, 0.01)  # times the usual stiffness of bristles


def near(score: Score, u: Array) -> Iterator[Start]:
    """Along the way the score foretells, the nuisances moving with the effect; at other sizes.

    A score is linear. Where flanks change or a drive sticks it foretells the direction, not how far
    to go: a refit that begins at a usual size may still see the valley which that start overlooks.
    """
    foretold, first = expected(score), score.signature.strength
    yield Start(u + score.gain.moved, foretold)
    bristles = f"{score.label}.stiffness" in foretold
    for size in _sizes(score, foretold[first]):
        for one in _softer(score, {**foretold, first: size}):
            yield Start(u, one, further=not bristles)


def beside(score: Score, u: Array, own: Setting) -> Iterator[Start]:
    """Starts of a second effect beside one whose numbers, path -> SI value, are known.

    The score may have moved those too, after the nuisances u, (m,).
    """
    moved = score.gain.moved[: len(u)]
    for start in near(replace(score, gain=replace(score.gain, moved=moved)), u):
        yield Start(start.u, {**own, **start.values})


def _sizes(score: Score, foretold: float) -> Iterator[float]:
    """Usual sizes of the first strength, where the score foretells another; none of a delay."""
    first = score.signature.strength
    declared = score.signature.grown.parameter(score.signature.grown.members(first)[0])
    if declared.unit == "s":  # filtered motion is smooth, and the score foretells how late it comes
        return
    for share in _SIZES:
        size = share * score.signature.usual[first]
        if foretold < 0.0 and declared.low < 0.0:
            size = -size
        ratio = foretold / size if size else 1.0
        if not 1.0 / _MUCH < ratio < _MUCH:
            yield size


def _softer(score: Score, setting: Setting) -> Iterator[Setting]:
    """The same with bristles as stiff as usual, and softer: how far they give way is not known."""
    path = f"{score.label}.stiffness"
    for factor in _SOFTER if path in setting else (1.0,):
        yield {**setting, path: factor * setting[path]} if path in setting else setting


def from_nominal(score: Score, u: Array) -> Iterator[Start]:
    """From other nuisances than the refitted machine's, which the missing effect may have moved."""
    yield Start(u, expected(score))


def grown_from(score: Score, simple: Refit) -> Iterator[Start]:
    """Starts of a whole law that do what the simpler one did: the same level, little more."""
    label = score.signature.hypothesis.label
    level = next(x for path, x in simple.values().items() if path.endswith(".torque"))
    usual = score.signature.settings[0]
    own = {**usual, f"{label}.torque": level, f"{label}.static_ratio": 1.15}
    for factor in _LEVELS:
        speed = {f"{label}.speed": factor * usual[f"{label}.speed"]}
        for one in _softer(score, {**own, **speed}):
            yield Start(simple.u, one)


def expected(score: Score) -> Setting:
    """The effect's numbers as the strengths of its probes tell."""
    settings, strengths = score.signature.settings, score.gain.strengths
    grown = score.signature.grown
    base = dict(settings[0])
    found, amplitude = dict(base), float(strengths[0])
    whole = amplitude
    for one, g in zip(settings[1:], strengths[1:], strict=True):
        moved = next((path for path in one if one[path] != base[path] and one[path] != 0.0), "")
        if not moved:
            continue
        if is_strength(grown, moved):
            found[moved] = float(g) * one[moved]
        elif moved.endswith("phase"):
            found[moved] = base[moved] + math.atan2(float(g), amplitude)
            whole = math.hypot(amplitude, float(g))
        elif not moved.endswith("centre") and (total := whole + float(g)) > 0:
            share = min(max(float(g) / total, -1.0), 2.0)
            found[moved] = base[moved] + share * (one[moved] - base[moved])
            whole = total
    first = score.signature.strength
    found[first] = base[first] * whole
    return found

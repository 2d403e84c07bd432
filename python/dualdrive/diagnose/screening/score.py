"""Score tests: by how much chi-squared would fall if a law were let in, all shared numbers free.

Each law is put in at its usual size; the change of the innovations, less what shared unknowns could
do as well, is its regressor. Engle, Handbook of Econometrics II (1984), ch. 13: the Lagrange
multiplier test, with a finite probe in place of the derivative so that limits and play count, too.
One-sided where a strength has one sign: a delay that would have to be negative gains nothing
(Gourieroux, Holly, Monfort, Econometrica 50 (1982) 63-80).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.hypotheses import is_strength, probes
from dualdrive.diagnose.screening.variants import LARGER, is_part, periods, spots, travel
from dualdrive.estimation.thresholds import threshold
from dualdrive.estimation.unknowns import Unknown
from dualdrive.innovations import (
    GreyBox,
    Point,
    Variant,
    changes,
    coordinates,
    flat,
    has_sensitivities,
)

Array = NDArray[np.float64]

_WITHIN = 0.3  # of a sample
_BATCH = 16  # probes whose innovations are kept at a time
_ROOT = math.sqrt(2.0)
_SMALLEST = 0.1  # of its usual size: a strength that the score has smaller begins there


@dataclass(frozen=True, eq=False)
class Scored:
    """A law and what it would gain.

    gain:  fall of chi-squared, over the inflation of what the base leaves; NaN: a probe broke down
    start: parameter path -> value that the regression asks for, where it is one of sizes and phases
    """

    variant: Variant
    gain: float
    start: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class _Probe:
    """A law at trial values, and what each regression coefficient is a size of.

    strength: path of the strength that this probe lets in; empty: its coefficient means nothing
    turned: the probe a quarter of a turn after the one before
    opposite: path of the spacing by which the next pinion meets the wheel half a period later, in
        this probe and the one before; a law that two pinions meet has its phase at each
    signed: whether the coefficient may be negative, too
    instead: whether it is one of several places, of which the best counts alone
    larger: whether it is at more than the law's usual size
    """

    setting: Mapping[str, float]
    strength: str = ""
    phase: str = ""
    turned: bool = False
    opposite: str = ""
    signed: bool = True
    instead: bool = False
    larger: bool = False


#: which of the laws, with all its unknowns where, and the probe
_Job = tuple[int, Variant, Array, _Probe]


def scores(
    grey: GreyBox,
    base: Point,
    columns: Sequence[Array],
    variants: Sequence[Variant],
    gains: Sequence[object],
    inflation: float,
    tell: Callable[[int, int], None] = lambda done, of: None,
    *,
    faint: bool = False,
) -> list[Scored]:
    """Score of every variant beside a base point, in the order given.

    Args:
        grey: records and shared unknowns.
        base: the point they are tried beside.
        columns: derivatives of the base's innovations by all its unknowns; none: these are held.
        variants: to be tried; their first numbers are the base's.
        gains: Kalman gains, the base's.
        inflation: of what the base leaves.
        tell: told how many of how many are done.
        faint: whether what is missing is small: first-order changes tell then, whatever a law does
            at its usual size.

    """
    r = flat(base.residuals)
    apart = residual_maker(columns, grey.believed(base.variant)[1])
    left = apart(r)

    within = _WITHIN * min(x.sampled.step for x in grey.records)
    sensitive = has_sensitivities(grey, base)
    small = {"share": _SMALLEST} if faint else {"most_apart": threshold("apart")}
    jobs: list[_Job] = []
    way = travel(grey)
    for k, v in enumerate(variants):
        if is_part(v):
            continue  # the base's gains are none for it
        own = v.extra[len(base.variant.extra) :]
        for probe in _probes(v.grown, own, way):
            # a reading that moves by whole samples moves its noise, too: a probe stays within one
            held = {
                p: min(x, within) if p.endswith(".time") else x for p, x in probe.setting.items()
            }
            there = np.r_[base.theta, coordinates(own, held)]
            jobs.append((k, v, there, replace(probe, setting=held)))

    found: dict[int, list[tuple[_Probe, Array]]] = {}
    begin = 0
    while begin < len(jobs) and not grey.counter.stop():
        batch = jobs[begin : begin + _BATCH]
        begin += len(batch)
        told = changes(grey, base, [(j[1], j[2]) for j in batch], gains, **small)
        rest = [k for k, change in enumerate(told) if change is None]
        points = grey.points([batch[k][1] for k in rest], [batch[k][2] for k in rest], gains)
        for k, p in zip(rest, points, strict=True):
            told[k] = None if p.lost else flat(p.residuals) - r
        if sensitive and not faint:
            jobs += [larger for k in rest for larger in _larger(base, batch[k])]
        known = [(j, change) for j, change in zip(batch, told, strict=True) if change is not None]
        if not known:
            continue
        left_apart = apart(np.stack([change for _, change in known]))
        for ((k, _, _, probe), _), own_part in zip(known, left_apart, strict=True):
            found.setdefault(k, []).append((probe, own_part))
        tell(begin, len(jobs))
    return [_scored(v, found.get(k, []), left, inflation) for k, v in enumerate(variants)]


def _larger(base: Point, job: _Job) -> list[_Job]:
    """A law at one place that no first order tells of, at other sizes: no one tells of another.

    Where flanks part elsewhere with it, a record may go another way at half its size: beside the
    data sheet's numbers, a worn range of 2.4 mrad scored 3 at 0.5 mrad, 50 at 2 and 340 at 4.
    """
    k, variant, _, probe = job
    if not probe.instead or probe.larger:
        return []
    own = variant.extra[len(base.variant.extra) :]
    found = []
    for times in LARGER:
        setting = {**probe.setting, probe.strength: times * probe.setting[probe.strength]}
        there = np.r_[base.theta, coordinates(own, setting)]
        found.append((k, variant, there, replace(probe, setting=setting, larger=True)))
    return found


def residual_maker(columns: Sequence[Array], precision: Array) -> Callable[[Array], Array]:
    """What a machine's numbers, moved within their priors, leave of changes.

    The residual maker of a regression on its derivatives (Greene, Econometric Analysis, 3.2).

    Args:
        columns: derivatives of its innovations by them; none: held.
        precision: of the priors, shape (numbers,).

    Returns:
        Of one change, shape (rows,), or of several, (changes, rows).

    """
    if not columns:
        return lambda change: change
    J = np.stack(columns)
    H = J @ J.T + np.diag(precision + 1e-12 * np.max(np.abs(np.diag(J @ J.T))))
    factor = np.linalg.inv(H)
    return lambda change: change - ((change @ J.T) @ factor) @ J


def _probes(core: Any, free: Sequence[Unknown], way: tuple[float, float]) -> list[_Probe]:
    """Every strength by itself, at two phases where it has one; other laws at usual values.

    A local fault is tried wherever its wheel turns, as far apart as it is wide.
    Of a wheel that two pinions meet each phase is tried at two spacings of theirs, alike and in
    turn: the four waves span every spacing.
    """
    strengths = [p for p in free if is_strength(core, p.path)]
    if not strengths:
        return [_Probe(s) for s in probes(core, free)]
    phases = {p.path.rpartition(".")[0]: p for p in free if p.path.endswith(".phase")}
    off = {p.path: 0.0 for p in strengths}
    found = []
    for p in strengths:
        on = {**off, p.path: p.scale}
        if begins := spots(core, p.path.rpartition(".")[0], free, way):
            return [_Probe({**on, **spot}, p.path, signed=False, instead=True) for spot in begins]
        phase = phases.get(p.path.rpartition(".")[0])
        if phase is None:
            found.append(_Probe(on, p.path, signed=p.low < 0.0))
            continue
        first = phase.value(phase.start)
        plain = {**on, phase.path: first}
        turned = {**on, phase.path: first + 0.5 * math.pi}
        found.append(_Probe(plain, p.path, phase.path))
        found.append(_Probe(turned, p.path, phase.path, turned=True))
        label = phase.path.rpartition(".")[0]
        for path in (x.path for x in free if x.path == f"{label}.spacing"):
            half = {path: math.pi / periods(core, label)}
            found.append(_Probe({**plain, **half}, p.path, phase.path, opposite=path))
            found.append(_Probe({**turned, **half}, p.path, phase.path, True, path))
    known = {p.path for p in strengths}
    shapes = [p for p in free if p.path not in known and not p.path.endswith(".phase")]
    return found + [_Probe(s) for s in probes(core, [strengths[0], *shapes])[1:]]


def _scored(
    variant: Variant, found: Sequence[tuple[_Probe, Array]], rest: Array, inflation: float
) -> Scored:
    if not found:
        return Scored(variant, float("nan"), {})
    if found[0][0].instead:
        return _best_of(variant, found, rest, inflation)
    from scipy.optimize import lsq_linear

    C = np.stack([change for _, change in found])
    M = C @ C.T
    scale = np.sqrt(np.diag(M) + 1e-300)
    root = np.linalg.cholesky(M / np.outer(scale, scale) + 1e-9 * np.eye(len(M)))
    b = np.linalg.solve(root, C @ rest / scale)
    # what is left is least with so many times each change
    least = [-np.inf if probe.signed else 0.0 for probe, _ in found]
    size = np.asarray(lsq_linear(root.T, -b, (least, np.inf)).x, dtype=np.float64)
    gain = float(b @ b - np.sum((root.T @ size + b) ** 2))
    return Scored(variant, gain / inflation, _start(found, size / scale))


def _best_of(
    variant: Variant, found: Sequence[tuple[_Probe, Array]], rest: Array, inflation: float
) -> Scored:
    """Of a law that is tried at several places, each alone.

    One that is larger than usual tells of its own size alone: far from it, it goes another way.
    """
    squares = [max(float(change @ change), 1e-300) for _, change in found]
    sizes = [
        max(-float(change @ rest) / s, 0.0) for (_, change), s in zip(found, squares, strict=True)
    ]
    high = threshold("own size")
    sizes = [
        0.0 if probe.larger and not 1.0 / high <= x <= high else x
        for (probe, _), x in zip(found, sizes, strict=True)
    ]
    k = int(np.argmax([x**2 * s for x, s in zip(sizes, squares, strict=True)]))
    probe = found[k][0]
    strength = probe.setting[probe.strength] * max(sizes[k], _SMALLEST)
    return Scored(
        variant, sizes[k] ** 2 * squares[k] / inflation, {**probe.setting, probe.strength: strength}
    )


def _start(found: Sequence[tuple[_Probe, Array]], sizes: Array) -> dict[str, float]:
    """Strengths, phases and spacings at the regression's minimum."""
    start: dict[str, float] = {}
    waves: dict[str, complex] = {}  # phase -> what the probes before asked for at it
    for k, (probe, _) in enumerate(found):
        if not probe.strength:
            continue
        scale, size = probe.setting[probe.strength], float(sizes[k])
        if probe.phase and not probe.turned:
            quarter = float(sizes[k + 1]) if k + 1 < len(found) and found[k + 1][0].turned else 0.0
            wave = complex(size, quarter)
            if probe.opposite:  # what all pinions meet alike, and what they meet in turn
                # nothing alike is told where those probes lost the record
                alike = waves.get(probe.phase, 0j)
                half = probe.setting[probe.opposite]
                wave, other = alike + wave, alike - wave
                start[probe.opposite] = cmath.phase(other * wave.conjugate()) * half / math.pi
                wave = cmath.rect(math.hypot(abs(wave), abs(other)) / _ROOT, cmath.phase(wave))
            waves[probe.phase] = wave
            start[probe.strength] = scale * max(abs(wave), _SMALLEST)
            start[probe.phase] = probe.setting[probe.phase] + cmath.phase(wave)
        elif not probe.phase:
            turned = probe.signed and size < -_SMALLEST
            start[probe.strength] = scale * (size if turned else max(size, _SMALLEST))
    return start

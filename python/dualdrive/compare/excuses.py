"""What may excuse a residual: nominal numbers within their tolerances, constants, encoder zeros.

All of them are refitted before an equation is blamed, and again under every hypothesis: an inertia
that is a few per cent off is no missing effect.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.compare.held import Held
from dualdrive.compare.laws import Laws, balance, laws, shifted
from dualdrive.estimation.unknowns import Unknown, default_free, unknowns
from dualdrive.identify.coloured import correlation_time

Array = NDArray[np.float64]

_GRID = 41  # first guesses of an encoder's zero
_LARGEST = 0.5  # step of a logarithm
_HELD = 0.75  # samples, one sigma, by which a torque acts late: computed in one, held for the next


@dataclass(frozen=True, eq=False)
class Point:
    """Records, and where their excuses stand; slopes of the rows are by the unknowns' u.

    zeros:    per record the encoders' zeros, channel -> rad
    open_law: whether the controller's law may be off by any constant
    """

    core: Any
    free: Sequence[Unknown]
    u: Array
    zeros: Sequence[dict[str, float]]
    rows: Sequence[Laws]
    open_law: bool = False

    @property
    def equations(self) -> tuple[str, ...]:
        """Names of the rows, the same in all records."""
        return self.rows[0].held.rows


def with_open_law(point: Point) -> Point:
    """The same, the controller's law off by any constant: a tension that is another, say."""
    rows = [
        replace(
            r,
            constants=np.where(np.array(r.driven) >= len(r.held.equations), np.inf, r.constants),
        )
        for r in point.rows
    ]
    return replace(point, rows=rows, open_law=True)


#: inverse covariances of a point's residuals, per record (n, m, m)
Weigh = Callable[[Point], Sequence[Array]]


def first_point(core: Any, held: Sequence[Held]) -> Point:
    """Nominal numbers, and the zeros under which the drives' equations close best."""
    free = _free(core, held)
    u = np.array([x.coordinate(x.nominal) if x.nominal else x.start for x in free])
    return _at(core, free, u, [first_zeros(core, h) for h in held], held)


def refitted(point: Point, weigh: Weigh, rounds: int) -> Point:
    """Move all excuses as far as they go under these weights, by Gauss-Newton steps."""
    low, high = (np.array([x.bounds[k] for x in point.free]) for k in (0, 1))
    for _ in range(rounds):
        step = _solve(point, weigh(point))
        count = len(point.u)
        u = np.clip(point.u + np.clip(step[:count], -_LARGEST, _LARGEST), low, high)
        zeros, k = [], count
        for row, own in zip(point.rows, point.zeros, strict=True):
            zeros.append({a: z + float(step[k + j]) for j, (a, z) in enumerate(own.items())})
            k += len(own) + len(row.driven) + 1
        settled = np.all(np.abs(u - point.u) < 1e-3)
        held = [r.held for r in point.rows]
        point = _at(point.core, point.free, u, zeros, held, open_law=point.open_law)
        if settled:
            break
    return point


def left(point: Point, weight: Sequence[Array], *, late: bool = False) -> list[Array]:
    """What the equations leave at the counted samples after one more step: per record (m, n).

    weight: per record, shape (n, m, m)
    late:   let the drives' encoders be late, too
    """
    step = _solve(point, weight, late=late)
    found, first = [], len(point.free)
    for row in point.rows:
        columns = _columns(row, late=late)
        own = columns.shape[2] - len(point.free)
        part = np.concatenate([step[: len(point.free)], step[first : first + own]])
        found.append((row.residual + columns @ part)[:, row.keep])
        first += own
    return found


def strain(point: Point, weight: Sequence[Array]) -> tuple[float, float]:
    """How far the excuses stretch what is believed of them, as squared deviations.

    Of numbers and of the plant's constants, then of the constants of the controller's law.
    """
    step = _solve(point, weight)
    sigma = np.array([x.sigma for x in point.free])
    centre = np.array([x.centre for x in point.free])
    count = len(point.free)
    off = (point.u + step[:count] - centre) / sigma
    plant, law, first = float(np.sum(off[np.isfinite(sigma)] ** 2)), 0.0, count
    for row in point.rows:
        first += len(row.held.encoders)
        constants = step[first : first + len(row.driven)] / np.maximum(row.constants, 1e-300)
        of_law = np.array(row.driven) >= len(row.held.equations)
        plant += float(np.sum(constants[~of_law] ** 2))
        law += float(np.sum(constants[of_law] ** 2))
        first += len(row.driven) + 1
    return plant, law


def noise_alone(point: Point) -> list[Array]:
    """Inverse covariances of the sensors' noise, (n, m, m) per record."""
    return [np.asarray(np.linalg.inv(r.noise), dtype=np.float64) for r in point.rows]


def cautious(point: Point) -> list[Array]:
    """Weights that do not believe the sensors more than the residuals.

    If noise alone were allowed for, a wrong equation would bend the numbers as far as they go.
    """
    noise = noise_alone(point)
    square = [
        np.einsum("an,nab,bn->n", r.residual[:, r.keep], w[r.keep], r.residual[:, r.keep])
        for r, w in zip(point.rows, noise, strict=True)
    ]
    worse = max(1.0, float(np.mean(np.concatenate(square))) / len(point.equations))
    return [w / (worse * alike(point)) for w in noise]


def alike(point: Point) -> float:
    """How many neighbouring samples count as one witness."""
    times = [
        1.0 + 2.0 * correlation_time(e - e.mean())
        for r in point.rows
        for e in r.residual[:, r.keep]
        if r.keep.any()
    ]
    return float(np.median(times))


def _at(
    core: Any,
    free: Sequence[Unknown],
    u: Array,
    zeros: Sequence[dict[str, float]],
    held: Sequence[Held],
    *,
    open_law: bool = False,
) -> Point:
    own = core.copy()
    for x, v in zip(free, u.tolist(), strict=True):
        own.set(x.path, x.value(v))
    slopes = np.array([x.slope(v) for x, v in zip(free, u.tolist(), strict=True)])
    paths = [x.path for x in free]
    found = [laws(own, h, paths, z) for h, z in zip(held, zeros, strict=True)]
    rows = [replace(r, slopes=r.slopes * slopes) for r in found]
    point = Point(core, free, u, zeros, rows)
    return with_open_law(point) if open_law else point


def _free(core: Any, held: Sequence[Held]) -> list[Unknown]:
    """Nominal numbers that move the balance on these records."""
    paths = default_free(core)
    moved = np.zeros(len(paths), dtype=bool)
    for h in held:
        moved |= np.any(balance(core, h, h.samples, paths)[1] != 0.0, axis=(0, 1))
    kept = [path for path, own in zip(paths, moved, strict=True) if own]
    return unknowns(core, kept, None, {}) if kept else []


def first_zeros(core: Any, h: Held) -> dict[str, float]:
    """The zero under which a drive's own equation closes best, of those that its play allows."""
    found = {}
    thin = max(1, len(h.t) // 400)
    samples = {name: np.ascontiguousarray(x[::thin]) for name, x in h.samples.items()}
    keep = h.keep[::thin]
    for angle in h.encoders:
        n, known = angle[-1], core.connections
        geared = not angle.startswith("theta_c") and f"gearbox_{n}" in known
        scale = core.get(f"gearbox_{n}.ratio") if geared else 1.0
        ratio = core.get(f"mesh_{n}.ratio") if f"mesh_{n}" in known else 1.0
        play = f"mesh_{n}" in known and core.kind(f"mesh_{n}") == "gap"
        gap = core.get(f"mesh_{n}.gap") if play else 0.0
        twist = samples[angle] / scale - ratio * samples["theta_m"]
        grid = scale * np.linspace(float(twist.min()) - gap, float(twist.max()) + gap, _GRID)
        row = next((k for k, e in enumerate(h.equations) if e.endswith(n)), 0)
        left = [balance(core, h, shifted(samples, {angle: z}))[0][row] for z in grid.tolist()]
        sizes = [float(np.mean(np.abs(e[keep]))) if keep.any() else 0.0 for e in left]
        found[angle] = float(grid[int(np.argmin(sizes))])
    return found


def _solve(point: Point, weight: Sequence[Array], *, late: bool = False) -> Array:
    """Step of all excuses: numbers, then per record what `_columns` adds, shape (p,)."""
    numbers = len(point.free)
    columns = [_columns(r, late=late) for r in point.rows]
    count = numbers + sum(c.shape[2] - numbers for c in columns)
    information, pull = np.zeros((count, count)), np.zeros(count)
    first = numbers
    for row, w, every in zip(point.rows, weight, columns, strict=True):
        own = every.shape[2] - numbers
        kept = every[:, row.keep]
        weighted = np.einsum("nab,bnp->anp", w[row.keep], kept)
        which = np.r_[0:numbers, first : first + own]
        information[np.ix_(which, which)] += np.einsum("anp,anq->pq", kept, weighted)
        pull[which] -= np.einsum("anp,an->p", weighted, row.residual[:, row.keep])
        known = np.concatenate([row.constants, [_HELD * row.held.step]])
        at = first + len(row.held.encoders) + np.arange(len(known))
        information[at, at] += 1.0 / np.maximum(known, 1e-300) ** 2
        first += own
    sigma = np.array([x.sigma for x in point.free])
    believed = np.flatnonzero(np.isfinite(sigma))
    information[believed, believed] += 1.0 / sigma[believed] ** 2
    centre = np.array([x.centre for x in point.free])
    pull[believed] += (centre - point.u)[believed] / sigma[believed] ** 2
    # what no sample tells of, such as the zero of a drive whose flanks stay open, does not move
    told = np.diag(information) > 0.0
    scale = np.where(told, 1.0 / np.sqrt(np.where(told, np.diag(information), 1.0)), 0.0)
    whole = information * np.outer(scale, scale)
    result: Array = np.linalg.lstsq(whole, pull * scale, rcond=1e-10)[0] * scale
    return result


def _columns(row: Laws, *, late: bool) -> Array:
    """What may move in one record, shape (m, n, p).

    Numbers, zeros, constants, the time for which torques are held, and delays of encoders.
    """
    constants = np.zeros((*row.residual.shape, len(row.driven)))
    for k, equation in enumerate(row.driven):
        constants[equation, :, k] = 1.0
    every = [row.slopes, -row.angles, constants, row.rates[:, :, None]]
    if late:
        every.append(row.angles * row.speeds)
    return np.concatenate(every, axis=2)

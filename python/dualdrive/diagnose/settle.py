"""All hypotheses judged by one measure: the noise that the best of them leaves.

Noise and misfit are told apart in rounds. At first all that the refitted machine leaves counts as
noise; each better hypothesis leaves less, and the rest is judged again under the noise it leaves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose import whitening
from dualdrive.diagnose.evidence import Evidence, effective, evidence
from dualdrive.diagnose.hypotheses import is_strength
from dualdrive.diagnose.profiled import profile
from dualdrive.diagnose.refit import Fitter, Refit
from dualdrive.diagnose.score import Scorer
from dualdrive.diagnose.survey import Survey, excess, key_of
from dualdrive.diagnose.work import Work, misfit_left

Array = NDArray[np.float64]

_NOISE = 1.5  # residual over floor, up to which what is left may be taken for noise
_ROUNDS = 3
_CLOSE = 60.0  # of criterion behind the best: refitted again under the new noise
_FEW = 4  # of them
_POLISH = 2
_FURTHER = 10.0  # fall of chi^2: another valley of the numbers, no polish
ENOUGH = 1.15  # residual over floor in every series, below which nothing is left to explain


def settle(found: Survey, work: Work) -> Survey:
    """Judge all again under the noise that the best of them leaves, until that is settled."""
    seen, every = found.evidence, [found.base, *_once(found.refits)]
    criterion, inflation = _criterion(seen, every, [profile(seen, r) for r in every])
    for number in range(_ROUNDS):
        ordered = sorted(every, key=lambda r: criterion[key_of(r)])
        label = ordered[0].hypothesis.label
        work.leader.judged(label, misfit_left(ordered[0].chi, every[0].chi))
        work.tell(f"noise under {label}")
        left = ordered[0].left
        series = seen.confrontation.series
        # colour is read off noise; what a wrong model leaves is weighed by its size alone
        noise = excess(found, left).max() < _NOISE
        now = evidence(
            seen.confrontation, (whitening.fitted if noise else whitening.sized)(series, left)
        )
        fitter = Fitter(now, work.stop)
        least = criterion[key_of(ordered[0])]
        close = [r for r in ordered[:_FEW] if criterion[key_of(r)] < least + _CLOSE]
        again = [
            fitter.again(r, fresh=number == 0)
            if r is found.base or r in close
            else replace(r, chi=now.chi(r.u, r.left))
            for r in every
        ]
        best = int(np.argmin([r.chi for r in again]))
        if number == 0:
            if excess(found, again[best].left).max() > ENOUGH:
                again[best] = _polished(fitter, again[best], found.nominal.u)
            if best > 0:  # a name must gain over the machine at its very best, its numbers too
                known = again[0].chi
                again[0] = _polished(fitter, again[0], found.nominal.u, again[best].u)
                if again[0].chi < known - _FURTHER:  # another valley: all that is close may have it
                    again[1:] = [
                        min(r, fitter.again(r, u=again[0].u), key=lambda end: end.chi)
                        if before in close and not work.stop()
                        else r
                        for before, r in zip(every[1:], again[1:], strict=True)
                    ]
        found = replace(found, base=again[0])
        settled = whitening.settled(_size(seen), _size(now))
        seen, every = now, again
        criterion, inflation = _criterion(seen, every)
        if settled or work.stop():
            break
    base, *refits = every
    return replace(
        found,
        evidence=seen,
        base=base,
        refits=sorted(refits, key=lambda r: criterion[key_of(r)]),
        criterion=criterion,
        inflation=inflation,
    )


def _once(refits: Sequence[Refit]) -> list[Refit]:
    """The best of those that were refitted twice: nothing is known of them but by their key."""
    best: dict[str, Refit] = {}
    for r in refits:
        known = best.get(key_of(r))
        if known is None or r.chi < known.chi:
            best[key_of(r)] = r
    return list(best.values())


def _polished(fitter: Fitter, best: Refit, *others: Array) -> Refit:
    """The leader with slopes of its own until they gain nothing: all others are judged by it.

    It begins again from other nuisances, (m,) each, too: the nominal ones, where the machine
    without it had moved them, or those that a rival ended at.
    """
    for u in others:
        if not fitter.stop():
            other = fitter.again(best, u=u, fresh=True)
            best = other if other.chi < best.chi else best
    for _ in range(_POLISH):
        if fitter.stop():
            break
        better = fitter.again(best, fresh=True)
        gained = best.chi - better.chi
        best = better if gained > 0 else best
        if gained < 0.02 * best.chi:
            break
    return best


def _criterion(
    seen: Evidence, every: Sequence[Refit], costs: Sequence[float] = ()
) -> tuple[dict[str, float], float]:
    """Quasi-BIC: chi^2 over the overdispersion of the best, and log n per number that is needed.

    A number that may as well have its neutral value (an asymmetry of zero, a second strength of
    zero) counts as the simpler law that it leaves: by its own chi^2 where that costs less. What
    was picked from many, the order of a harmonic, a spot, the hour of a load, pays for the looking.

    costs: minus twice the log likelihood of each, where it is not chi^2
    """
    least = min(every, key=lambda r: r.chi)
    inflation = effective(seen.white(least.left), seen)
    count = max(seen.count / inflation, 10.0)
    each = float(np.log(count))
    found = {}
    for r, cost in zip(every, costs or [r.chi / inflation for r in every], strict=True):
        spare = sum(max(each - z, 0.0) for z in _spare(seen, r, inflation))
        looked = 2.0 * float(np.log(r.hypothesis.looked_at))
        found[key_of(r)] = cost + len(r.v) * each - spare + looked
    return found, inflation


def _spare(seen: Evidence, r: Refit, inflation: float) -> list[float]:
    """Squared distance from its neutral value, in standard deviations, of every number with one."""
    if not r.free:
        return []
    rows = seen.rows(r.u, r.left, r.slopes)
    own = Scorer(rows).rest(seen.white(r.columns))
    information = np.diag(np.linalg.pinv(np.linalg.pinv(own.T @ own, hermitian=True)))
    found, strong = [], set()
    for j, p in enumerate(r.free):
        label, strength = p.path.rpartition(".")[0], is_strength(r.grown, p.path)
        if p.path.endswith(".asymmetry") or (strength and label in strong):
            found.append(float(r.v[j] ** 2 * information[j] / inflation))
        if strength:
            strong.add(label)
    return found


def _size(seen: Evidence) -> list[float]:
    """Of the noise, one per series."""
    return [float(np.mean(w.scale[w.keep])) if w.keep.any() else 1.0 for w in seen.whiteners]

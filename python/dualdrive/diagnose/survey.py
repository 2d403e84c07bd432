"""Every hypothesis about one machine and its records: noise, scores, refits, second effects.

Noise and misfit are told apart in rounds. At first all that the refitted machine leaves counts as
noise; each better hypothesis leaves less, and the rest is judged again under the noise it leaves.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose import whitening
from dualdrive.diagnose.confront import Confrontation
from dualdrive.diagnose.evidence import Evidence, effective, evidence
from dualdrive.diagnose.floors import ratios
from dualdrive.diagnose.hypotheses import Hypothesis, candidates, is_strength, members
from dualdrive.diagnose.refit import Fitter, Refit
from dualdrive.diagnose.score import Scorer, alike
from dualdrive.diagnose.screen import worth_simulating
from dualdrive.diagnose.signatures import (
    CONTAINS,
    Prober,
    Score,
    fit_all,
    score_all,
    starts_of,
    with_orders,
)
from dualdrive.identify import FitError

Array = NDArray[np.float64]

SHORTLIST = 6
_ROUNDS = 3  # of noise
_HOPELESS = 300.0  # of criterion behind the best: not refitted again
_TWIN = 1.0 - 1e-5  # squared cosine above which two signatures are one
_PAIRS = 3
_NOISE = 1.5  # residual over floor, up to which what is left may be taken for noise
_CLEARLY = 1.4  # times that: something is missing, whatever a score says of its name
_POLISH, _SETTLING = 2, 2
ENOUGH = 1.1  # residual over floor in every series, below which no second effect is looked for
WORTH_A_REFIT = 10.0  # fall of chi^2 over its inflation, below which no name could be given
WORTH_A_PAIR = 15.0  # expected fall of chi^2 for which a second effect is tried
_SETTLED = 0.1  # change of the noise's size below which another round changes nothing


class Clock:
    """What is left of a time budget; `stop` turns true when it is used up or a user asks."""

    def __init__(self, budget: float, asked: Callable[[], bool] = lambda: False) -> None:
        self.begin, self.budget, self.asked = time.monotonic(), budget, asked
        self.cut: list[str] = []

    @property
    def used(self) -> float:
        """Seconds since the beginning."""
        return time.monotonic() - self.begin

    def stop(self) -> bool:
        """Whether no further simulation should begin."""
        return self.asked() or self.used > self.budget

    def leave_out(self, what: str) -> None:
        """Note what was not done."""
        self.cut.append(what)


@dataclass(frozen=True, eq=False)
class Survey:
    """What was found about one machine.

    nominal:  the machine as it came, only what belongs to the records fitted
    base:     its nominal numbers refitted, under the final noise
    refitted: the same under the noise that it leaves itself: what a user would call the refit
    refits:   hypotheses refitted under the final noise, least criterion first
    criterion: label -> chi^2 plus k log n, over `inflation`: differences are twice log evidence
    scores:   of every hypothesis at the refitted machine, best first
    twins:    label -> labels with the very same signature on these records
    """

    evidence: Evidence
    nominal: Refit
    base: Refit
    refits: Sequence[Refit]
    criterion: Mapping[str, float]
    inflation: float
    scores: Sequence[Score]
    untried: Sequence[str] = field(default_factory=tuple)
    twins: Mapping[str, Sequence[str]] = field(default_factory=dict)
    refitted: Refit | None = None

    @property
    def plain(self) -> Refit:
        """The refitted machine as it is reported."""
        return self.refitted or self.base

    @property
    def best(self) -> Refit:
        """The hypothesis with the least criterion, nothing missing among them."""
        every = [self.base, *self.refits]
        return min(every, key=lambda r: self.criterion[key_of(r)])


def key_of(refit: Refit) -> str:
    """Label with its counted numbers."""
    fixed = ", ".join(f"{p.rpartition('.')[2]} {x:g}" for p, x in refit.hypothesis.fixed.items())
    return f"{refit.hypothesis.label} ({fixed})" if fixed else refit.hypothesis.label


def survey(
    confrontation: Confrontation,
    clock: Clock,
    *,
    wanted: Sequence[Hypothesis] | None = None,
    shortlist: int = SHORTLIST,
    threads: int = 2,
    tell: Callable[[str], None] = lambda _: None,
) -> Survey:
    """Try every hypothesis.

    Raises:
        FitError: the machine itself can not be simulated.

    """
    c = confrontation
    tell("the machine as it stands")
    nominal = records_alone(c, clock)
    tell("refitting the nominal numbers")
    seen, base = _refitted(c, nominal.u, clock)
    scorer = Scorer(seen.rows(base.u, base.left, base.slopes))
    known = candidates(c.core, c.channels, balance=c.mode == "balance")
    if wanted is None and c.mode == "closed_loop":
        known = worth_simulating(c, known, clock, threads, tell)
    every = list(known if wanted is None else wanted)
    scores, untried = _scored(c, seen, base, scorer, every, clock, threads, tell)
    single, twins = _without_twins(seen, scorer, scores)
    found = Survey(seen, nominal, base, [], {key_of(base): 0.0}, 1.0, scores, tuple(untried), twins)
    found = replace(found, refitted=base)
    clear = excess(found, base.left).max() > _CLEARLY * ENOUGH
    chosen = _shortlist(single, shortlist, 1.0 if clear else WORTH_A_REFIT)
    fitter = Fitter(seen, clock.stop, [nominal.u])
    refits = fit_all(fitter, base, chosen, threads, tell)
    if len(refits) < len(chosen):
        missing = {s.label for s in chosen} - {r.hypothesis.label for r in refits}
        clock.leave_out(f"not refitted: {', '.join(sorted(missing))}")
    return with_pairs(settle(replace(found, refits=refits), clock, tell), clock, tell)


def _scored(
    c: Confrontation,
    seen: Evidence,
    base: Refit,
    scorer: Scorer,
    every: Sequence[Hypothesis],
    clock: Clock,
    threads: int,
    tell: Callable[[str], None],
) -> tuple[list[Score], list[str]]:
    """Scores under what is left as white noise and as coloured noise, the larger counting.

    Groups come first, and the single parts of those that gain something.
    """
    prober = Prober(c, base.u, base.left, [max(s.floor, 1e-3 * s.spread) for s in c.series])
    coloured = evidence(c, whitening.fitted(c.series, base.left))
    judges = [(seen, scorer), (coloured, Scorer(coloured.rows(base.u, base.left, base.slopes)))]
    over = [effective(e.white(base.left), e) for e, _ in judges]
    rest = [j.rest(j.rows.left[:, None])[:, 0] for _, j in judges]

    def tried(hypotheses: Sequence[Hypothesis]) -> list[Score]:
        tell(f"trying {len(hypotheses)} effects at their places")
        listed = with_orders(coloured, rest[1], hypotheses)
        return score_all(prober, judges, over, listed, threads, clock.stop)

    scores = tried(every)
    least = max(WORTH_A_REFIT, 0.02 * max((s.gain.gain for s in scores), default=0.0))
    groups = {s.label: s.signature.hypothesis for s in scores if s.gain.gain > least}
    parts = [m for h in groups.values() for m in members(c.core, Hypothesis(h.effects))]
    if parts:
        scores += tried(parts)
    known = {s.label for s in scores}
    untried = sorted({h.label for h in every} - known)
    if clock.stop() and untried:
        clock.leave_out(f"not tried: {', '.join(untried)}")
    return sorted(scores, key=lambda s: -s.gain.gain), untried


def _refitted(c: Confrontation, u: Array, clock: Clock) -> tuple[Evidence, Refit]:
    """Nominal numbers refitted under the noise that they leave, in rounds."""
    left = c.left(c.core, u)
    for last in reversed(range(_ROUNDS)):
        if left is None:
            break
        seen = evidence(c, whitening.sized(c.series, left))
        base = Fitter(seen, clock.stop).nominal(u)
        if base is None:
            break
        if last == 0 or _alike(left, base.left):
            return seen, base
        u, left = base.u, list(base.left)
    raise FitError(f"{c.core.name}: the machine can not be simulated on these records")


def settle(found: Survey, clock: Clock, tell: Callable[[str], None]) -> Survey:
    """Judge all again under the noise that the best of them leaves, until that is settled."""
    seen, every = found.evidence, [found.base, *found.refits]
    criterion, inflation = _criterion(seen, every)
    for number in range(_SETTLING):
        best = min(every, key=lambda r: criterion[key_of(r)])
        tell(f"noise under {best.hypothesis.label}")
        series = seen.confrontation.series
        # colour is read off noise; what a wrong model leaves is weighed by its size alone
        noise = excess(_now(found, seen, every, criterion), best.left).max() < _NOISE
        colour = whitening.fitted if noise else whitening.sized
        now = evidence(seen.confrontation, colour(series, best.left))
        fitter = Fitter(now, clock.stop)
        again = [
            fitter.again(r)
            if r is found.base or criterion[key_of(r)] < min(criterion.values()) + _HOPELESS
            else replace(r, chi=now.chi(r.u, r.left))
            for r in every
        ]
        found = replace(found, base=again[0])
        least = int(np.argmin([r.chi for r in again]))
        so_far = _now(found, now, every, criterion)
        if number == 0 and excess(so_far, again[least].left).max() > ENOUGH:
            again[least] = _polished(fitter, again[least], found.nominal.u)
        settled = _same_noise(seen, now)
        seen, every = now, again
        criterion, inflation = _criterion(seen, every)
        if settled or clock.stop():
            break
    base, *refits = every
    ordered = sorted(refits, key=lambda r: criterion[key_of(r)])
    return replace(
        found,
        evidence=seen,
        base=base,
        refits=ordered,
        criterion=criterion,
        inflation=inflation,
    )


def _now(
    found: Survey, seen: Evidence, every: Sequence[Refit], criterion: Mapping[str, float]
) -> Survey:
    """The survey as it stands between two rounds."""
    base, *refits = every
    return replace(found, evidence=seen, base=base, refits=refits, criterion=criterion)


def _polished(fitter: Fitter, best: Refit, nominal: Array) -> Refit:
    """The leader with slopes of its own until they gain nothing: all others are judged by it.

    It begins again from the nominal numbers, too, where the machine without it had moved them.
    """
    if len(best.free) and not fitter.stop():
        other = fitter.afresh(best, nominal)
        best = other if other is not None and other.chi < best.chi else best
    for _ in range(_POLISH):
        if fitter.stop():
            break
        better = fitter.again(best, fresh=True)
        gained = best.chi - better.chi
        best = better if gained > 0 else best
        if gained < 0.02 * best.chi:
            break
    return best


def with_pairs(found: Survey, clock: Clock, tell: Callable[[str], None]) -> Survey:
    """Two effects at once: what the best one leaves is scored again, and the best few refitted."""
    singles = [r for r in found.refits if len(r.hypothesis.effects) == 1]
    first = found.best
    if not singles or first is found.base or excess(found, first.left).max() < ENOUGH:
        return found
    seen = found.evidence
    rows = seen.rows(first.u, first.left, first.slopes)
    own = seen.white(first.columns)
    whole = replace(
        rows,
        slopes=np.concatenate([rows.slopes, own], axis=1),
        pull=np.concatenate([rows.pull, np.zeros(own.shape[1])]),
        sigma=np.concatenate([rows.sigma, np.full(own.shape[1], np.inf)]),
    )
    scorer = Scorer(whole)
    taken = first.hypothesis.effects[0]
    same = {label for twins in found.twins.values() for label in twins}
    others = [
        replace(s, gain=scorer(seen.white(s.signature.columns)))
        for s in found.scores
        if s.label not in same
        and s.signature.hypothesis.effects[0] != taken
        and (
            s.signature.hypothesis.effects[0][0] not in CONTAINS
            or s.signature.hypothesis.effects[0][1] != taken[1]
        )
    ]
    others.sort(key=lambda s: -s.gain.gain)
    worth = [s for s in others if s.gain.gain / found.inflation > WORTH_A_PAIR][:_PAIRS]
    fitter, refits = Fitter(seen, clock.stop), []
    for s in worth:
        if clock.stop():
            clock.leave_out(f"not refitted: {first.hypothesis.label} + {s.label}")
            continue
        pair = first.hypothesis + s.signature.hypothesis
        tell(f"refitting with {pair.label}")
        starts = [{**first.values(), **one} for one in starts_of(s)]
        refit = _tried(fitter, pair, first, starts)
        if refit is not None:
            refits.append(refit)
    if not refits:
        return found
    return settle(replace(found, refits=[*found.refits, *refits]), clock, tell)


def _tried(
    fitter: Fitter, pair: Hypothesis, first: Refit, starts: Sequence[dict[str, float]]
) -> Refit | None:
    try:
        return fitter(pair, first, starts)
    except ValueError:
        return None  # two effects that can't sit there together


def _without_twins(
    seen: Evidence, scorer: Scorer, scores: Sequence[Score]
) -> tuple[list[Score], dict[str, list[str]]]:
    """Scores of which no two span the same, and who is left out for whom."""
    kept: list[Score] = []
    spans: list[Array] = []
    twins: dict[str, list[str]] = {}
    for s in scores:
        columns = scorer.rest(seen.white(s.signature.columns))
        for other, span in zip(kept, spans, strict=True):
            near = abs(other.gain.gain - s.gain.gain) <= 1e-3 * max(s.gain.gain, 1.0)
            if near and span.shape[1] == columns.shape[1] and alike(span, columns) > _TWIN:
                twins.setdefault(other.label, []).append(s.label)
                break
        else:
            kept.append(s)
            spans.append(columns)
    return kept, twins


def _criterion(seen: Evidence, every: Sequence[Refit]) -> tuple[dict[str, float], float]:
    """Quasi-BIC: chi^2 over the overdispersion of the best, and log n per number that is needed.

    A number that may as well have its neutral value (an asymmetry of zero, a second strength of
    zero) counts as the simpler law that it leaves: by its own chi^2 where that costs less.
    """
    least = min(every, key=lambda r: r.chi)
    inflation = effective(seen.white(least.left), seen)
    count = max(seen.count / inflation, 10.0)
    each = float(np.log(count))
    found = {}
    for r in every:
        spare = sum(max(each - z, 0.0) for z in _spare(seen, r, inflation))
        found[key_of(r)] = r.chi / inflation + len(r.v) * each - spare
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


def _shortlist(scores: Sequence[Score], count: int, least: float) -> list[Score]:
    """The best of each simple law, and the whole laws of friction where a simpler one is in it."""
    simple = [s for s in scores if s.signature.hypothesis.effects[-1][0] not in CONTAINS]
    chosen = [s for s in simple[:count] if s.gain.gain > least]
    rubbing = [s.signature.hypothesis.effects[-1][1] for s in chosen if _rubs(s)][:2]
    whole = [s for s in scores if s not in simple and s.gain.gain > least]
    alone = [s for s in whole if not rubbing][:2]
    chosen += alone + [s for s in whole if s.signature.hypothesis.effects[-1][1] in rubbing]
    return chosen


def _rubs(score: Score) -> bool:
    return score.signature.hypothesis.effects[-1][0] == "coulomb"


def records_alone(c: Confrontation, clock: Clock | None = None) -> Refit:
    """What belongs to the records fitted, the machine's numbers held: an error as `compare` has it.

    Raises:
        FitError: the machine can not be simulated.

    """
    held = copy(c)
    held.sigma = c.sigma.copy()
    held.sigma[: len(c.nominal)] = 1e-9
    seen = evidence(held, whitening.plain(c.series))
    stop = clock.stop if clock is not None else lambda: False
    found = Fitter(seen, stop).nominal(c.levelled(c.core, c.start))
    if found is None:
        raise FitError(f"{c.core.name}: the machine can not be simulated on these records")
    return found


def _alike(first: Sequence[Array], second: Sequence[Array]) -> bool:
    a = np.array([np.sqrt(np.mean(x**2)) for x in first])
    b = np.array([np.sqrt(np.mean(x**2)) for x in second])
    return bool(np.all(np.abs(np.log((b + 1e-300) / (a + 1e-300))) < _SETTLED))


def _same_noise(first: Evidence, second: Evidence) -> bool:
    one, two = (
        np.array([float(np.mean(w.scale[w.keep])) if w.keep.any() else 1.0 for w in e.whiteners])
        for e in (first, second)
    )
    return bool(np.all(np.abs(np.log(one / two)) < _SETTLED))


def excess(found: Survey, left: Sequence[Array]) -> Array:
    """Residual over noise floor of every series, RMS, shape (series,)."""
    return ratios(found.evidence.confrontation.series, left, found.best.left)

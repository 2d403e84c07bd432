"""The search for what is missing: noise, scores, refits, second effects."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from copy import copy
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose import whitening
from dualdrive.diagnose.candidates import members, tried_with
from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.diagnose.evidence import Evidence, effective, evidence
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.diagnose.laws import CONTAINED, CONTAINS
from dualdrive.diagnose.loads import sought, stands_out
from dualdrive.diagnose.neighbours import with_neighbours
from dualdrive.diagnose.pairs import with_pairs
from dualdrive.diagnose.profiled import profile
from dualdrive.diagnose.refit import Fitter, Refit, Trial
from dualdrive.diagnose.score import Scorer
from dualdrive.diagnose.settle import ENOUGH, settle
from dualdrive.diagnose.shortlist import Shortlist, without_twins
from dualdrive.diagnose.stage import Scale, Score, Stage, scale_of
from dualdrive.diagnose.survey import Survey, excess, key_of
from dualdrive.diagnose.work import Clock, Work
from dualdrive.identify import FitError

Array = NDArray[np.float64]

_SHORTLIST = 6
_ROUNDS = 3  # of noise
_CLEARLY = 1.35  # times the noise: something is missing, whatever a score says of its name
WORTH_A_REFIT = 15.0  # fall of chi^2 over its inflation, below which no name could be given
_RIVAL = 0.3  # of the best gain: less is no rival, where no more than noise is left
_CONTAINED = 4.0  # gain of a simple law of friction from which the whole ones are tried there
_TAKEN_APART = 6  # best groups of which the single parts are tried
_FURTHER = 10.0  # of the profile likelihood: another valley of the numbers, no polish


def search(c: TorqueBalance, work: Work) -> Survey:
    """Try every hypothesis.

    Raises:
        FitError: the machine itself can not be simulated.

    """
    clock, tell = work.clock, work.tell
    tell("the machine as it stands")
    nominal = records_alone(c, clock)
    tell("refitting the nominal numbers")
    seen, base = _refitted(c, nominal.u, clock)
    every = tried_with(c, c.core)
    plain = Survey(seen, nominal, base, [], {key_of(base): 0.0}, 1.0, [])
    clear = not _explains(plain, base)
    if not clock.stop():
        every += sought(seen, base)
    scorer = Scorer(seen.rows(base.u, base.left, base.slopes))
    scores = _scored(c, seen, base, scorer, every, not clear, work)
    single, twins = without_twins(seen, scorer, scores)
    most = max((s.gain.gain for s in single), default=0.0)
    least = -math.inf if clear else max(WORTH_A_REFIT, _RIVAL * most)
    worth = [s for s in single if s.gain.gain > least or stands_out(s)]
    found = replace(plain, scores=scores, twins=twins, refitted=base)

    def listed(now: Survey) -> Shortlist:
        fitter = Fitter(now.evidence, clock.stop)
        return Shortlist(fitter, now.base, nominal.u, work)

    trials = listed(found).trials(worth, _SHORTLIST)
    return _as_reported(_refined(found, worth, trials, listed, clear, work), clock)


def _as_reported(found: Survey, clock: Clock) -> Survey:
    """The survey, its refit without any effect begun again where a rival has led it further."""
    seen = found.evidence
    if clock.stop() or profile(seen, found.base) > profile(seen, found.plain) - _FURTHER:
        return found
    try:
        _, other = _refitted(seen.confrontation, found.base.u, clock)
    except FitError:
        return found  # what is known stays
    better = profile(seen, other) < profile(seen, found.plain)
    return replace(found, refitted=other) if better else found


def _refined(
    plain: Survey,
    worth: Sequence[Score],
    trials: Sequence[Trial],
    listed: Callable[[Survey], Shortlist],
    clear: bool,
    work: Work,
) -> Survey:
    """The survey with the best refitted, alone and two at once.

    A leader far ahead of all else that still leaves more than noise gets its partners first.

    clear: whether something is missing, whatever a score says of its name
    """
    found, short, clock = plain, listed(plain), work.clock
    begun = short.leader(trials) if clear else []
    early = any(short.far_ahead(r, trials) and not _explains(plain, r) for r in begun)
    if early:
        found = _together(settle(replace(found, refits=begun), work), work)
        if excess(found, found.best.left).max() < ENOUGH:
            return found
        short = listed(found)
        begun = [r for r in found.refits if len(r.hypothesis.effects) == 1]
    known = {key_of(r) for r in begun}
    rest = [short.again(t) for t in trials if key_of(t) not in known]
    cut: list[str] = []
    if clear and not any(_explains(plain, r) for r in begun):
        more, cut = short.others(worth, trials, clock.stop)
        rest = sorted([*rest, *(t for t in more if key_of(t) not in known)], key=lambda t: t.chi)
    if cut:
        clock.leave_out(f"not tried: {', '.join(cut)}")
    refits, missing = short(rest, worth, begun)
    if missing:
        clock.leave_out(f"not refitted: {', '.join(missing)}")
    pairs = [r for r in found.refits if len(r.hypothesis.effects) > 1]
    now = settle(replace(found, refits=[*pairs, *refits]), work)
    return _looked_about(found, now, work) if early else _together(now, work)


def _together(found: Survey, work: Work) -> Survey:
    """The best single effect and its neighbours, then two at once and the neighbours of those."""
    single = with_neighbours(found, work)
    return _looked_about(single, with_pairs(single, work), work)


def _looked_about(before: Survey, now: Survey, work: Work) -> Survey:
    """What another best hypothesis may be taken for, too."""
    if now.best.hypothesis == before.best.hypothesis:
        return now
    return with_neighbours(now, work)


def _explains(plain: Survey, refit: Refit) -> bool:
    """Whether about no more than noise is left."""
    return bool(excess(plain, refit.left).max() < _CLEARLY * ENOUGH)


def _scored(
    c: TorqueBalance,
    seen: Evidence,
    base: Refit,
    scorer: Scorer,
    every: Sequence[Hypothesis],
    faint: bool,
    work: Work,
) -> list[Score]:
    """Scores under what is left as white noise and as coloured noise, the larger counting.

    Groups come first, and the single parts of those that gain something.

    faint: whether what may be missing is hardly seen: no spectrum shows its order, then
    """
    clock, coloured = work.clock, evidence(c, whitening.fitted(c.series, base.left))
    scales = [
        Scale(seen, scorer, effective(seen.white(base.left), seen)),
        scale_of(coloured, base, effective(coloured.white(base.left), coloured)),
    ]
    stage = Stage(c, base.u, base.left, scales, work)

    def tried(hypotheses: Sequence[Hypothesis]) -> list[Score]:
        work.tell(f"trying {len(hypotheses)} effects at their places")
        return stage.scores(stage.listed(hypotheses, faint))

    simple = [h for h in every if h.effects[-1][0] not in CONTAINS]
    scores = tried(simple)
    best = sorted(scores, key=lambda s: -s.gain.gain)
    groups = {s.label: s.signature.hypothesis for s in best if s.gain.gain > WORTH_A_REFIT}
    several = list(groups.values())[:_TAKEN_APART]
    parts = [m for h in several for m in members(c.core, Hypothesis(h.effects))]
    if parts and clock.stop():
        clock.leave_out(f"not tried: {', '.join(sorted(h.label for h in parts))}")
    elif parts:
        scores += tried(parts)
    rubbing = {
        s.signature.hypothesis.effects[-1][1]
        for s in scores
        if s.gain.gain > _CONTAINED and s.signature.hypothesis.effects[-1][0] in CONTAINED
    }
    whole = [h for h in every if h not in simple and _may_rub(h, rubbing, every)]
    if whole:
        scores += tried(whole)
    known = {s.label for s in scores}
    untried = sorted({h.label for h in every} - known)
    if clock.stop() and untried:
        clock.leave_out(f"not tried: {', '.join(untried)}")
    return sorted(scores, key=lambda s: -s.gain.gain)


def _may_rub(h: Hypothesis, rubbing: Collection[str], every: Sequence[Hypothesis]) -> bool:
    """Whether a whole law of friction is worth its time: dry friction gains, or is there."""
    place = h.effects[-1][1]
    return place in rubbing or not any(
        o.effects[-1][0] in CONTAINED and o.effects[-1][1] == place for o in every
    )


def _refitted(c: TorqueBalance, u: Array, clock: Clock) -> tuple[Evidence, Refit]:
    """Nominal numbers refitted under the noise that they leave, in rounds."""
    left = c.left(c.core, u)
    lopsided = [j for j, p in enumerate(c.nominal) if p.path.endswith(".asymmetry")]
    if left is not None and lopsided:  # friction alike both ways first: else drag becomes friction
        even = Fitter(evidence(_held(c, lopsided), whitening.sized(c.series, left)), clock.stop)
        first = even.nominal(u)
        u, left = (first.u, list(first.left)) if first is not None else (u, left)
    for last in reversed(range(_ROUNDS)):
        if left is None:
            break
        seen = evidence(c, whitening.sized(c.series, left))
        base = Fitter(seen, clock.stop).nominal(u)
        if base is None:
            break
        sizes = ([whitening.rms(x) for x in part] for part in (left, base.left))
        if last == 0 or whitening.settled(*sizes):
            return seen, base
        u, left = base.u, list(base.left)
    raise FitError(f"{c.core.name}: the machine can not be simulated on these records")


def records_alone(c: TorqueBalance, clock: Clock | None = None) -> Refit:
    """What belongs to the records fitted, the machine's numbers held: an error as `compare` has it.

    Raises:
        FitError: the machine can not be simulated.

    """
    seen = evidence(_held(c, list(range(len(c.nominal)))), whitening.plain(c.series))
    stop = clock.stop if clock is not None else lambda: False
    found = Fitter(seen, stop).nominal(c.levelled(c.core, c.start))
    if found is None:
        raise FitError(f"{c.core.name}: the machine can not be simulated on these records")
    return found


def _held(c: TorqueBalance, numbers: Sequence[int]) -> TorqueBalance:
    """The same with some nuisances believed to be what they are."""
    held = copy(c)
    held.sigma = c.sigma.copy()
    held.sigma[list(numbers)] = 1e-9
    return held

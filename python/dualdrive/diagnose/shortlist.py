"""Which hypotheses are refitted: those that lower chi^2 most where they were really tried.

A score is linear: it foretells what a small effect does to the machine as refitted without it.
Where flanks change or a drive sticks that is a shortlist, no more, so that all are put in at the
size they are foretold to have, and at usual ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.evidence import Evidence
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.diagnose.laws import CONTAINED, CONTAINS
from dualdrive.diagnose.profiled import profile, sharpened
from dualdrive.diagnose.refit import Fitter, Refit, Start, Trial
from dualdrive.diagnose.score import Scorer, alike
from dualdrive.diagnose.stage import Score
from dualdrive.diagnose.starts import from_nominal, grown_from, near
from dualdrive.diagnose.survey import key_of
from dualdrive.diagnose.work import Work, first_of_each, misfit_left

Array = NDArray[np.float64]

_TWIN = 1.0 - 1e-5  # squared cosine above which two signatures are one
_AS_FORETOLD = 0.6  # of the foretold gain: such a start is good enough
_OTHERS = 3  # of all other laws, where the leader leaves something
_FAR, _MUCH = 3.0, 50.0  # times the gain of all others, and of this: partners of such come first
_SURELY = 3  # best scores that are refitted wherever their starts stand


@dataclass(frozen=True, eq=False)
class Shortlist:
    """Refits the best of many scores.

    base:    the machine without any effect
    nominal: nuisances of the machine as it came, shape (m,)
    """

    fitter: Fitter
    base: Refit
    nominal: Array
    work: Work

    def trials(self, scores: Sequence[Score], count: int) -> list[Trial]:
        """The best of each simple law where they were really tried, least chi^2 first."""
        chosen = _simple(scores)
        self.work.tell(f"trying {len(chosen)} effects at the sizes they should have")
        tried = self.work.side_by_side(self._tried, chosen)
        return _best([t for t in tried if t is not None], count)

    def leader(self, trials: Sequence[Trial]) -> list[Refit]:
        """The first of them refitted."""
        return self._refitted(trials[:1])

    def far_ahead(self, leader: Refit, trials: Sequence[Trial]) -> bool:
        """Whether a refit gains far more than any other law does where it was tried.

        Gains are those of the profile likelihood: a law may explain one record and not another.
        """
        seen = self.fitter.evidence
        none = profile(seen, self.base)
        laws = {effect for effect, _ in leader.hypothesis.effects}
        others = [t for t in trials if laws.isdisjoint(e for e, _ in t.hypothesis.effects)]
        most = max([none - profile(seen, t) for t in others], default=0.0)
        return none - profile(seen, leader) > _FAR * max(most, _MUCH)

    def again(self, trial: Trial) -> Trial:
        """A trial as this evidence has it."""
        return replace(trial, chi=self.fitter.evidence.chi(trial.u, trial.left))

    def __call__(
        self, trials: Sequence[Trial], scores: Sequence[Score], begun: Sequence[Refit] = ()
    ) -> tuple[list[Refit], list[str]]:
        """What was tried, refitted, and the whole laws of friction that contain it.

        begun: single effects that were refitted already

        Returns:
            all refits, and labels of what the time limit left out.

        """
        found = sorted([*begun, *self._refitted(trials)], key=lambda r: r.chi)
        rubbing = [h.effects[-1][1] for h in (r.hypothesis for r in found) if _is_dry(h)]
        known = {r.hypothesis.label for r in begun}
        whole = [s for s in _whole(scores, rubbing) if s.label not in known]
        wanted = [key_of(t) for t in trials] + [s.label for s in whole]
        found += self._whole_laws(whole, found)
        return found, sorted(set(wanted) - {key_of(r) for r in found})

    def others(
        self, scores: Sequence[Score], trials: Sequence[Trial], late: Callable[[], bool]
    ) -> tuple[list[Trial], list[str]]:
        """The best of all other laws, put in at usual sizes, and labels of what time left out.

        For where the leader leaves something: a score tells little of a machine far off.

        late: no further law is tried once this turns true
        """
        laws = {effect for t in trials for effect, _ in t.hypothesis.effects} | set(CONTAINS)
        several = first_of_each((s for s in scores if _law(s) not in laws), _law)
        self.work.tell(f"trying {len(several)} more")

        def tried(score: Score) -> Trial | None:
            starts = near(score, self.base.u)
            h, slopes = score.signature.hypothesis, self.base.slopes
            return None if late() else self.fitter.tried(h, starts, slopes=slopes)

        found = self.work.side_by_side(tried, several)
        cut = [s.label for s, t in zip(several, found, strict=True) if t is None]
        best = sorted([t for t in found if t is not None], key=lambda t: t.chi)[:_OTHERS]
        return best, cut if late() or self.fitter.stop() else []

    def _refitted(self, trials: Sequence[Trial]) -> list[Refit]:
        """Refits of several trials, the lowest first."""
        found = [r for r in self.work.side_by_side(self._refit, trials) if r is not None]
        return sorted(found, key=lambda r: r.chi)

    def _tried(self, score: Score) -> Trial | None:
        enough = self.base.chi - _AS_FORETOLD * score.fall
        starts = _starts(score, self.base, self.nominal)
        return self.fitter.tried(score.signature.hypothesis, starts, enough, self.base.slopes)

    def _refit(self, trial: Trial) -> Refit | None:
        if self.fitter.stop():
            return None
        self.work.tell(f"refitting with {trial.hypothesis.label}")
        found = sharpened(self.fitter, self.fitter(trial, self.base.slopes))
        if found is not None:
            remark = misfit_left(found.chi, self.base.chi)
            self.work.leader.meets(found.hypothesis.label, found.chi, remark)
        return found

    def _best_end(self, score: Score, several: Iterable[Iterable[Start]]) -> Refit | None:
        """The lowest refit, each from the best of some starts."""
        h, ends = score.signature.hypothesis, list[Refit]()
        for starts in several:
            trial = None if self.fitter.stop() else self.fitter.tried(h, starts)
            if trial is not None and (end := self._refit(trial)) is not None:
                ends.append(end)
        return min(ends, key=lambda r: r.chi, default=None)

    def _whole_laws(self, whole: Sequence[Score], simpler: Sequence[Refit]) -> list[Refit]:
        """Whole laws of friction; lugre begins where stribeck ended."""
        by_effect = {r.hypothesis.effects[-1]: r for r in simpler}

        def larger(score: Score) -> Refit | None:
            effect, place = score.signature.hypothesis.effects[-1]
            first = next(
                (by_effect[e, place] for e in CONTAINS[effect] if (e, place) in by_effect), None
            )
            if first is not None:
                return self._best_end(score, [grown_from(score, first)])
            foretold, *usual = near(score, self.base.u)
            return self._best_end(score, [[foretold], usual])

        found: list[Refit] = []
        for law in CONTAINS:
            own = [s for s in whole if _law(s) == law]
            more = [r for r in self.work.side_by_side(larger, own) if r is not None]
            found += more
            by_effect.update({r.hypothesis.effects[-1]: r for r in more})
        return found


def _best(trials: Sequence[Trial], count: int) -> list[Trial]:
    """The lowest of them, and those of the best scores."""
    surely = trials[: min(_SURELY, count)]
    others = sorted((t for t in trials if t not in surely), key=lambda t: t.chi)
    return sorted([*surely, *others[: count - len(surely)]], key=lambda t: t.chi)


def _starts(score: Score, base: Refit, nominal: Array) -> Iterator[Start]:
    yield from near(score, base.u)
    yield from from_nominal(score, nominal)


def _is_dry(h: Hypothesis) -> bool:
    """Whether it is the friction that whole laws contain."""
    return h.effects[-1][0] in CONTAINED


def _whole(scores: Sequence[Score], rubbing: Sequence[str], most: int = 2) -> list[Score]:
    """Whole laws of friction: where a simpler one was refitted, or the best alone."""
    whole = [s for s in scores if _law(s) in CONTAINS]
    if not rubbing:
        return whole[:most]
    return [s for s in whole if s.signature.hypothesis.effects[-1][1] in rubbing[:most]]


def _simple(scores: Sequence[Score]) -> list[Score]:
    """All but the whole laws of friction."""
    return [s for s in scores if _law(s) not in CONTAINS]


def _law(score: Score) -> str:
    return score.signature.hypothesis.effects[-1][0]


def without_twins(
    seen: Evidence, scorer: Scorer, scores: Sequence[Score]
) -> tuple[list[Score], dict[str, list[str]]]:
    """Scores of which no two span the same, and who is left out for whom."""
    kept: list[Score] = []
    spans: list[Array] = []
    twins: dict[str, list[str]] = {}
    for s in scores:
        columns = scorer.rest(seen.white(s.signature.columns))
        for other, span in zip(kept, spans, strict=True):
            near_ = abs(other.gain.gain - s.gain.gain) <= 1e-3 * max(s.gain.gain, 1.0)
            if near_ and span.shape[1] == columns.shape[1] and alike(span, columns) > _TWIN:
                if s.label != other.label:
                    twins.setdefault(other.label, []).append(s.label)
                break
        else:
            kept.append(s)
            spans.append(columns)
    return kept, twins

"""Which hypotheses are refitted: those that lower chi^2 most where they were really tried.

A score is linear: it foretells what a small effect does to the machine as refitted without it.
Where flanks change or a drive sticks that is a shortlist, no more, so that the best by score are
simulated at the size they are foretold to have, at their probes, and where the torque balance puts
them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.evidence import Evidence
from dualdrive.diagnose.guesses import Guesses
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.diagnose.refit import Fitter, Refit, Start, Trial
from dualdrive.diagnose.score import Scorer, alike
from dualdrive.diagnose.signatures import CONTAINS, Score
from dualdrive.diagnose.starts import from_nominal, grown_from, near

Array = NDArray[np.float64]
T = TypeVar("T")
R = TypeVar("R")

_TWIN = 1.0 - 1e-5  # squared cosine above which two signatures are one
_AS_FORETOLD = 0.6  # of the foretold gain: such a start is good enough
_TRIED = 1.5  # times as many are tried as are refitted
_SURELY = 3  # best scores that are refitted wherever their starts stand


def refitted(
    fitter: Fitter,
    base: Refit,
    nominal: Array,
    scores: Sequence[Score],
    guesses: Guesses,
    count: int,
    threads: int,
    tell: Callable[[str], None],
) -> tuple[list[Refit], list[str]]:
    """The best of each simple law, then the whole laws of friction that contain them.

    Returns:
        the refits, and labels of what the time limit left out.

    """
    simple = [s for s in scores if _law(s) not in CONTAINS]
    chosen = _first(simple, guesses, round(_TRIED * count))

    def tried(score: Score) -> Trial | None:
        starts = _starts(fitter, score, base, nominal, guesses)
        enough = base.chi - _AS_FORETOLD * score.fall
        return fitter.tried(score.signature.hypothesis, starts, enough, base.slopes)

    def one(trial: Trial) -> Refit | None:
        if fitter.stop():
            return None
        tell(f"refitting with {trial.hypothesis.label}")
        return fitter(trial, base.slopes)

    tell(f"simulating {len(chosen)} effects at the sizes they should have")
    best = _best([t for t in side_by_side(tried, chosen, threads) if t is not None], count)
    found = [r for r in side_by_side(one, best, threads) if r is not None]
    by_effect = {r.hypothesis.effects[-1]: r for r in reversed(found)}
    whole = _whole(scores, by_effect)

    def larger(score: Score) -> Refit | None:
        effect, place = score.signature.hypothesis.effects[-1]
        first = next(
            (by_effect[e, place] for e in CONTAINS[effect] if (e, place) in by_effect), None
        )
        starts = grown_from(score, first) if first is not None else near(score, base)
        trial = None if fitter.stop() else fitter.tried(score.signature.hypothesis, starts)
        return one(trial) if trial is not None else None

    for law in reversed(CONTAINS):  # lugre begins where stribeck ended
        own = [s for s in whole if _law(s) == law]
        more = [r for r in side_by_side(larger, own, threads) if r is not None]
        found += more
        by_effect.update({r.hypothesis.effects[-1]: r for r in more})
    known = {r.hypothesis.label for r in found}
    wanted = [t.hypothesis.label for t in best] + [s.label for s in whole]
    return found, sorted(set(wanted) - known)


def _best(trials: Sequence[Trial], count: int) -> list[Trial]:
    """The lowest of them, and those of the best scores."""
    surely = trials[: min(_SURELY, count)]
    others = sorted((t for t in trials if t not in surely), key=lambda t: t.chi)
    return sorted([*surely, *others[: count - len(surely)]], key=lambda t: t.chi)


def _starts(
    fitter: Fitter, score: Score, base: Refit, nominal: Array, guesses: Guesses
) -> Iterator[Start]:
    c = fitter.evidence.confrontation
    guess = guesses.start(c, base.u, score.label)
    if guess is not None:
        yield guess
    yield from near(score, base)
    yield from from_nominal(score, nominal)


def _first(scores: Sequence[Score], guesses: Guesses, count: int) -> list[Score]:
    """The best by score, and those that close the torque balance."""
    known = {s.label: s for s in reversed(scores)}
    listed = [known[label] for label in guesses.by_label if label in known]
    return list({id(s): s for s in [*scores[:count], *listed]}.values())


def _whole(
    scores: Sequence[Score], known: dict[tuple[str, str], Refit], most: int = 2
) -> list[Score]:
    """Whole laws of friction: where a simpler one was refitted, or the best alone."""
    whole = [s for s in scores if _law(s) in CONTAINS]
    rubbing = [place for effect, place in known if effect == "coulomb"][:most]
    if not rubbing:
        return whole[:most]
    return [s for s in whole if s.signature.hypothesis.effects[-1][1] in rubbing]


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
                twins.setdefault(other.label, []).append(s.label)
                break
        else:
            kept.append(s)
            spans.append(columns)
    return kept, twins


def side_by_side(work: Callable[[T], R], several: Sequence[T], threads: int) -> list[R]:
    """Results in order; the core computes without holding the interpreter."""
    if threads == 1 or len(several) < 2:
        return [work(one) for one in several]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, several))


def distinct(hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
    """No hypothesis twice, by its effects and counted numbers."""
    return list({(h.effects, tuple(h.fixed.items())): h for h in hypotheses}.values())

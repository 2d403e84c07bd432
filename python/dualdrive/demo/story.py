"""Nominal, refitted, candidates, the effect added: each step's error on both records."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.resources import as_file, files
from typing import Any

from dualdrive.compare import Comparison, compare
from dualdrive.identify import Fit, FitError, evaluate, fit
from dualdrive.identify.coloured import correlation_time
from dualdrive.identify.screening import Candidate, screen
from dualdrive.machine import Machine
from dualdrive.traces import Trace, read

#: how many candidates of the shortlist are refitted
SHORTLIST = 3
RTOL = 1e-6  # local tolerance: far below a record's noise
REFIT_SIMULATIONS = 60  # a wrong candidate need not converge to lose
_TOLD_APART = 11.0  # twice the log likelihood: right in 95 % of cases


@dataclass(frozen=True)
class Step:
    """A rung of the ladder: headline error on the fitted and on the held-out record."""

    label: str
    fitted: float
    held_out: float


@dataclass(frozen=True, eq=False)
class Refit:
    """A candidate that was added and fitted together with the nominal parameters."""

    candidate: Candidate
    fit: Fit
    held_out: float

    @property
    def fitted(self) -> float:
        """Headline error on the record it was fitted to."""
        return self.fit.fitted.error


@dataclass(frozen=True, eq=False)
class Story:
    """What the demo found.

    steps:        nominal, refitted, with the effect
    noise_floor:  headline error that a perfect model would leave on the held-out record
    screening:    every candidate with its score, best first
    refits:       the shortlist after refitting, best held-out error first
    rivals:       labels of refits that the held-out record does not tell from the best
    before, after: comparisons on the held-out record, refitted and improved
    """

    steps: Sequence[Step]
    noise_floor: float
    screening: Sequence[Candidate]
    refits: Sequence[Refit]
    rivals: Sequence[str]
    nominal: Fit
    before: Comparison
    after: Comparison

    @property
    def machine(self) -> Machine:
        """The improved machine."""
        improved: Machine = self.refits[0].fit.machine
        return improved

    @property
    def gap_closed(self) -> float:
        """Share of the held-out error above the noise floor that the effect removes."""
        refitted, best = self.steps[1].held_out, self.steps[-1].held_out
        return (refitted - best) / (refitted - self.noise_floor)

    def figures(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "steps": [vars(step) for step in self.steps],
            "noise_floor": self.noise_floor,
            "gap_closed": self.gap_closed,
            "screening": [
                {"effect": c.effect, "place": c.place, "explained": c.explained}
                for c in self.screening
            ],
            "refits": [
                {
                    "effect": r.candidate.effect,
                    "place": r.candidate.place,
                    "error": r.fitted,
                    "held_out": r.held_out,
                    "parameters": {
                        path: {"value": p.value, "low": p.low, "high": p.high, "unit": p.unit}
                        for path, p in r.fit.parameters.items()
                        if path.startswith(f"{r.candidate.label}.")
                    },
                }
                for r in self.refits
            ],
            "not_told_apart": list(self.rivals),
        }


def sheet() -> Machine:
    """The demo's machine as its data sheet has it."""
    with as_file(files("dualdrive.demo") / "machine.toml") as path:
        return Machine.load(path)


def records() -> tuple[Trace, Trace]:
    """The record to fit and the one held out."""
    found = []
    for name in ("fit.csv", "held_out.csv"):
        with as_file(files("dualdrive.demo") / name) as path:
            found.append(read(path))
    return found[0], found[1]


def tell(progress: Callable[[str], None] = lambda _: None) -> Story:
    """Run the story; about half a minute on two cores.

    progress: told in words what is being done.
    """
    machine, (fitting, held_out) = sheet(), records()
    progress("comparing the data sheet with both records")
    untouched = evaluate(machine, held_out, rtol=RTOL).error
    progress("refitting the data sheet's numbers")
    nominal = fit(machine, fitting, rtol=RTOL)
    refitted = evaluate(nominal.machine, held_out, rtol=RTOL).error
    progress("scoring every effect the library knows")
    screening = screen(nominal.machine, fitting, rtol=RTOL)
    shortlist = [c for c in screening if not c.same_as][:SHORTLIST]
    progress("refitting with " + ", ".join(c.label for c in shortlist))

    def refit(candidate: Candidate) -> Refit | None:
        grown = nominal.machine.copy()
        label = grown.add(candidate.effect, candidate.place)
        for path, size in candidate.expected.items():
            if path.startswith(f"{label}.") and size > 0:
                grown.set(
                    path, size
                )  # where the score expects it: a fit from far off may not arrive
        try:
            found = fit(grown, fitting, max_simulations=REFIT_SIMULATIONS, rtol=RTOL)
            return Refit(candidate, found, evaluate(found.machine, held_out, rtol=RTOL).error)
        except FitError as error:  # a candidate that can't be fitted is out of the race, no more
            progress(f"{candidate.label}: {error}")
            return None

    with ThreadPoolExecutor() as pool:
        fitted = [r for r in pool.map(refit, shortlist) if r is not None]
    if not fitted:
        raise FitError("none of the shortlisted effects can be fitted to the record")
    refits = sorted(fitted, key=lambda r: r.held_out)
    best = refits[0]
    progress("comparing the improved machine with the held-out record")
    before, after = compare(nominal.machine, held_out), compare(best.fit.machine, held_out)
    steps = (
        Step("data sheet", nominal.error["nominal"], untouched),
        Step("refitted", nominal.error["refitted"], refitted),
        Step(f"+ {best.candidate.label}", best.fitted, best.held_out),
    )
    witnesses = _witnesses(after)
    rivals = [
        r.candidate.label
        for r in refits[1:]
        if 2.0 * witnesses * math.log(r.held_out / best.held_out) < _TOLD_APART
    ]
    floor = after.error["noise_floor"]
    return Story(steps, floor, screening, refits, rivals, nominal, before, after)


def _witnesses(comparison: Comparison) -> float:
    """Effective number of samples of the headline channels: those that are alike count once."""
    return sum(
        len(q.t) / (1.0 + 2.0 * correlation_time(q.residual))
        for q in comparison.quantities
        if q.headline
    )

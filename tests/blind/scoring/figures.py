"""Figures of a run: each a plain function of the judged cases."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from tests.blind.scoring import match
from tests.blind.scoring.match import Json

ALARMS = ("effect", "ambiguous", "unknown")
EMPTY = ("empty", "drifted")
HIDING = ("single", "pair", "outside")
#: log-likelihood ratio from which a record tells: chance alone reaches it once in 10^8
TELLS = 16.0
_BINS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.95, 1.0)
_FAMILIES = ("friction", "motors", "gearing", "sensing")


@dataclass(frozen=True)
class Judged:
    """One case beside its answer; a case that failed has an empty one."""

    truth: Json
    answer: Json
    seconds: float
    failed: str = ""

    @property
    def group(self) -> str:
        return str(self.truth["group"])

    @property
    def known(self) -> bool:
        return bool(self.truth["loop"] == "known")

    @property
    def verdict(self) -> str:
        return "failed" if self.failed else str(self.answer["verdict"])

    @property
    def alarmed(self) -> bool:
        return self.verdict in ALARMS

    @property
    def candidates(self) -> list[Json]:
        """Best first; what stands for "none of these" is no candidate."""
        return [
            c for c in self.answer.get("candidates", []) if c.get("effect") not in (None, "none")
        ]

    @property
    def tells(self) -> bool:
        """Whether the records tell the hidden effect from none and from its nearest rival."""
        return float(self.truth.get("told", -math.inf)) >= TELLS

    def top(self, places: int, place: bool = False) -> bool:
        """The hidden effect is among the first candidates; alone, if it is to be the first."""
        if places == 1:
            return bool(self.candidates) and match.exact(self.candidates[0], self.truth, place)
        return all(
            any(match.holds(c, hidden, place) for c in self.candidates[:places])
            for hidden in match.truths(self.truth)
        )


def share(hits: Iterable[bool]) -> dict[str, Any]:
    """Share with its 95 % interval (Wilson), count and total."""
    row = list(hits)
    n, k, z = len(row), sum(row), 1.96
    if n == 0:
        return {"share": None, "hits": 0, "of": 0}
    p, scale = k / n, 1 + z * z / n
    middle = (p + z * z / (2 * n)) / scale
    half = z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / scale
    low, high = max(0.0, middle - half), min(1.0, middle + half)
    return {"share": p, "hits": k, "of": n, "low": low, "high": high}


def spread(values: Iterable[float]) -> dict[str, Any]:
    """Median and 95th percentile."""
    row = [v for v in values if math.isfinite(v)]
    if not row:
        return {"median": None, "p95": None, "of": 0}
    return {
        "median": float(np.median(row)),
        "p95": float(np.percentile(row, 95)),
        "most": max(row),
        "of": len(row),
    }


def of(cases: Sequence[Judged], *groups: str) -> list[Judged]:
    """Cases of those groups."""
    return [c for c in cases if c.group in groups]


def alarms(cases: Sequence[Judged]) -> dict[str, Any]:
    """How often a machine that hides nothing is said to hide something."""
    quiet = of(cases, *EMPTY)
    known = [c for c in quiet if c.known]
    return {
        "false alarms": share(c.alarmed for c in quiet),
        "false alarms, loop known": share(c.alarmed for c in of(known, "empty")),
        "false alarms, drifted numbers": share(c.alarmed for c in of(known, "drifted")),
        "false alarms, loop unknown": share(c.alarmed for c in quiet if not c.known),
    }


def naming(cases: Sequence[Judged]) -> dict[str, Any]:
    """Hits, "none of the above", the equation. Candidates count whatever the verdict."""
    single, pair = of(cases, "single"), of(cases, "pair")
    tells = [c for c in single if c.tells]
    within = [c for c in cases if c.group != "outside"]
    pointed = [c for c in single + pair if (c.answer.get("equation") or {}).get("name")]
    return {
        "top-1": share(c.top(1) for c in single),
        "top-1 where the record tells": share(c.top(1) for c in tells),
        "top-1, loop unknown": share(c.top(1) for c in single if not c.known),
        "top-1 and place": share(c.top(1, place=True) for c in single),
        "top-3": share(c.top(3) for c in single),
        "top-3 where the record tells": share(c.top(3) for c in tells),
        "hidden effect noticed": share(c.alarmed for c in single + pair),
        "unknown, recall": share(c.verdict == "unknown" for c in of(cases, "outside")),
        "unknown, wrongly used": share(c.verdict == "unknown" for c in within),
        "both of two in the first three": share(c.top(3) for c in pair),
        "one of two in the first three": share(_one_of_two(c) for c in pair),
        "right equation": share(
            match.right_equation(c.answer["equation"]["name"], c.truth) for c in pointed
        ),
        "cut": share(c.verdict == "unfinished" for c in cases),
        "failed": share(bool(c.failed) for c in cases),
    }


def _one_of_two(c: Judged) -> bool:
    return any(match.holds(k, t) for k in c.candidates[:3] for t in match.truths(c.truth))


def errors(cases: Sequence[Judged]) -> dict[str, Any]:
    """Held-out error of the best explanation over what the true machine leaves."""
    over = []
    for c in of(cases, "single", "pair", *EMPTY):
        best = (c.answer.get("error") or {}).get("held_out_best")
        if best is not None and c.known:
            over.append(float(best) / float(c.truth["floor"]))
    return {"held-out error over floor": spread(over)}


def coverage(cases: Sequence[Judged]) -> dict[str, Any]:
    """How often 95 % intervals hold the truth, where the effect is right, or none is there."""
    return {
        "effect parameters": share(_effect_intervals(cases)),
        "refitted nominals": share(_nominal_intervals(cases)),
    }


def _effect_intervals(cases: Sequence[Judged]) -> Iterable[bool]:
    for c in of(cases, "single"):
        if not c.top(1, place=True):
            continue
        truth = c.truth["effects"][0]["parameters"]
        for path, interval in c.candidates[0].get("parameters", {}).items():
            name = path.rsplit(".", 1)[-1]
            if name in truth and interval.get("low") is not None:
                yield match.covered(name, interval, truth[name])


def _nominal_intervals(cases: Sequence[Judged]) -> Iterable[bool]:
    for c in of(cases, *EMPTY):
        refitted = c.answer.get("parameters") or {}
        for path, value in match.real_numbers(c.truth, refitted).items():
            if refitted[path].get("low") is not None:
                yield match.covered(path, refitted[path], value)


def trust(cases: Sequence[Judged]) -> dict[str, Any]:
    """Brier score of "the leading candidate is right", and a table of claimed against true."""
    claims = [
        (float(c.candidates[0]["probability"]), c.group != "outside" and c.top(1))
        for c in of(cases, *HIDING)
        if c.candidates and c.candidates[0].get("probability") is not None
    ]
    brier = float(np.mean([(p - right) ** 2 for p, right in claims])) if claims else None
    return {"Brier": brier, "of": len(claims), "reliability": reliability(claims)}


def reliability(claims: Sequence[tuple[float, bool]]) -> list[dict[str, Any]]:
    """Claimed against true, in bins of what was claimed."""
    table = []
    for low, high in pairwise(_BINS):
        last = high == _BINS[-1]
        own = [(p, right) for p, right in claims if low <= p and (p < high or last)]
        if own:
            claimed = float(np.mean([p for p, _ in own]))
            table.append({"from": low, "claimed": claimed, **share(right for _, right in own)})
    return table


def verdicts(cases: Sequence[Judged]) -> dict[str, dict[str, int]]:
    """Group x verdict."""
    return _table(cases, lambda c: [f"{c.group}, loop {c.truth['loop']}"], lambda c: c.verdict)


def confusion(cases: Sequence[Judged]) -> dict[str, dict[str, int]]:
    """True effect x leading candidate, or the verdict where no effect is named."""
    return _table(of(cases, "single", "outside"), lambda c: [match.truths(c.truth)[0][0]], leading)


def split(cases: Sequence[Judged]) -> dict[str, dict[str, dict[str, Any]]]:
    """Right answers by what the cases are: a case with several motions counts for each of them."""
    return {
        "family": _split(of(cases, "single"), lambda c: [c.truth["effects"][0]["family"]]),
        "motion": _split(cases, lambda c: {r["motion"] for r in c.truth["records"].values()}),
        "colour of noise": _split(cases, lambda c: [c.truth["traits"]["colour"]]),
        "drives": _split(cases, lambda c: [c.truth["traits"]["drives"]]),
        "sampling, Hz": _split(cases, lambda c: [c.truth["traits"]["rate"]]),
        "control": _split(
            cases, lambda c: ["sampled" if c.truth["traits"]["sampled"] else "continuous"]
        ),
        "hunting": _split(cases, lambda c: [any(r["hunts"] for r in c.truth["records"].values())]),
        "detectability": _split(of(cases, "single", "pair"), lambda c: [_decade(c)]),
    }


def _decade(c: Judged) -> str:
    return f"1e{math.floor(math.log10(max(float(c.truth['detectability']), 1.0)))}"


def _split(
    cases: Sequence[Judged], kinds: Callable[[Judged], Iterable[Any]]
) -> dict[str, dict[str, Any]]:
    made: dict[str, list[bool]] = {}
    for c in cases:
        for kind in kinds(c):
            made.setdefault(str(kind), []).append(right(c))
    return {kind: share(made[kind]) for kind in sorted(made)}


def leading(c: Judged) -> str:
    """What a case's answer comes down to."""
    if c.verdict in ("effect", "ambiguous") and c.candidates:
        return " + ".join(effect for effect, _ in match.members(c.candidates[0]))
    return f"({c.verdict})"


def _table(
    cases: Sequence[Judged],
    rows: Callable[[Judged], Iterable[str]],
    column: Callable[[Judged], str],
) -> dict[str, dict[str, int]]:
    made: dict[str, Counter[str]] = {}
    for c in cases:
        for row in rows(c):
            made.setdefault(row, Counter())[column(c)] += 1
    return {name: dict(made[name].most_common()) for name in sorted(made)}


def failures(cases: Sequence[Judged]) -> list[dict[str, Any]]:
    """Every case that is not answered as it should be, and how it was answered."""
    return [
        {
            "case": c.truth["case"],
            "group": c.group,
            "loop": c.truth["loop"],
            "hidden": [f"{e}@{p}" for e, p in match.truths(c.truth)],
            "detectability": c.truth.get("detectability"),
            "told": c.truth.get("told"),
            "rival": c.truth.get("rival"),
            "verdict": c.verdict,
            "named": [
                " + ".join(f"{e}@{p}" for e, p in match.members(k))
                + f" {k.get('probability') or 0:.2f}"
                for k in c.candidates[:3]
            ],
            "why": c.failed.strip().splitlines()[-1] if c.failed else "",
        }
        for c in cases
        if not right(c)
    ]


def right(c: Judged) -> bool:
    """What each group asks for."""
    if c.failed:
        return False
    if c.group in EMPTY:
        return c.verdict in ("adequate", "parameters")
    if c.group == "outside":
        return c.verdict == "unknown"
    return c.top(1) if c.group == "single" else c.top(3)


def everything(cases: Sequence[Judged]) -> dict[str, Any]:
    """All figures of a run."""
    return {
        "cases": len(cases),
        "alarms": alarms(cases),
        "naming": naming(cases),
        "errors": errors(cases),
        "coverage of 95 % intervals": coverage(cases),
        "trust": trust(cases),
        "seconds": spread(c.seconds for c in cases),
        "verdicts": verdicts(cases),
        "confusion": confusion(cases),
        "right answers by": split(cases),
        "failures": failures(cases),
    }

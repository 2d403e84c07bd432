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
HIDING = ("single", "two", "outside")
OVER_FLOOR = (0.0, 1.08, 1.15, 1.22, 1.5, 3.0, math.inf)


@dataclass(frozen=True)
class Judged:
    """One case beside its answer; a case that failed has an empty one."""

    label: Json
    answer: Json
    seconds: float
    failed: str = ""

    @property
    def group(self) -> str:
        return str(self.label["group"])

    @property
    def verdict(self) -> str:
        return "failed" if self.failed else str(self.answer["verdict"])

    @property
    def candidates(self) -> list[Json]:
        """Best first; what stands for "none of these" is no candidate."""
        return [
            c for c in self.answer.get("candidates", []) if c.get("effect") not in (None, "none")
        ]

    def top(self, places: int, place: bool = False) -> bool:
        """The hidden effect is among the first candidates; alone, if it is to be the first."""
        if places == 1:
            return bool(self.candidates) and match.exact(self.candidates[0], self.label, place)
        return all(
            any(match.holds(c, truth, place) for c in self.candidates[:places])
            for truth in match.truths(self.label)
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


def naming(cases: Sequence[Judged]) -> dict[str, Any]:
    """Alarms, hits, "none of the above", the equation."""
    quiet, single, two = of(cases, "none", "drifted"), of(cases, "single"), of(cases, "two")
    apart = [c for c in single if c.label.get("delta_lambda", math.inf) >= 33]
    told = [c for c in single if c.label.get("told", -math.inf) >= 33]
    known = [c for c in cases if c.group != "outside"]
    pointed = [c for c in single + two if c.answer.get("equation")]
    return {
        "false alarms": share(c.verdict in ALARMS for c in quiet),
        "false alarms, exact nominals": share(c.verdict in ALARMS for c in of(cases, "none")),
        "false alarms, drifted": share(c.verdict in ALARMS for c in of(cases, "drifted")),
        "top-1, effect": share(c.top(1) for c in single),
        "top-1, effect and place": share(c.top(1, place=True) for c in single),
        "top-1 where delta-lambda >= 33": share(c.top(1) for c in apart),
        "top-1 where the record tells": share(c.top(1) for c in told),
        "top-3, effect": share(c.top(3) for c in single),
        "top-3 where delta-lambda >= 33": share(c.top(3) for c in apart),
        "top-3 where the record tells": share(c.top(3) for c in told),
        "top-3, effect and place": share(c.top(3, place=True) for c in single),
        "hidden effect noticed": share(c.verdict in ALARMS for c in single + two),
        "unknown, recall": share(c.verdict == "unknown" for c in of(cases, "outside")),
        "unknown, wrongly used": share(c.verdict == "unknown" for c in known),
        "both of two in the top 3": share(c.top(3) for c in two),
        "one of two in the top 3": share(
            any(match.holds(k, t) for k in c.candidates[:3] for t in match.truths(c.label))
            for c in two
        ),
        "right equation": share(
            match.right_equation(c.answer["equation"]["name"], c.label) for c in pointed
        ),
        "failed": share(bool(c.failed) for c in cases),
    }


def errors(cases: Sequence[Judged]) -> dict[str, Any]:
    """Held-out error over the known floor, and how much of the gap was closed; closed loop only."""
    over, gap = [], []
    for c in of(cases, "single", "two", "none", "drifted"):
        error = c.answer.get("error", {})
        best, floor = error.get("held_out_best"), c.label["floor"]
        if best is None or c.label["mode"] != "closed_loop":
            continue
        over.append(best / floor)
        before = error.get("held_out_refitted")
        if c.group in HIDING and before is not None and before > 1.05 * floor:
            gap.append((before - best) / (before - floor))
    return {"held-out error over floor": spread(over), "gap closed": spread(gap)}


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
        truth = c.label["effects"][0]["parameters"]
        for path, interval in c.candidates[0].get("parameters", {}).items():
            name = path.rsplit(".", 1)[-1]
            if name in truth:
                yield match.covered(name, interval, truth[name])


def _nominal_intervals(cases: Sequence[Judged]) -> Iterable[bool]:
    for c in of(cases, "none", "drifted"):
        refitted = c.answer.get("parameters", {})
        for path, value in match.real_numbers(c.label, refitted).items():
            yield match.covered(path, refitted[path], value)


def trust(cases: Sequence[Judged]) -> dict[str, Any]:
    """Brier score of "the leading candidate is right", and a table of claimed against true.

    Beside it how often the leader was right, by what it leaves over the floor in its worst series.
    """
    claims = [
        (float(c.candidates[0]["probability"]), c.group != "outside" and c.top(1))
        for c in of(cases, *HIDING)
        if c.candidates
    ]
    table = []
    for low, high in ((0, 0.2), (0.2, 0.4), (0.4, 0.6), (0.6, 0.8), (0.8, 0.95), (0.95, 1.01)):
        own = [(p, right) for p, right in claims if low <= p < high]
        if own:
            claimed, right = (float(np.mean(column)) for column in zip(*own, strict=True))
            table.append({"from": low, "claimed": claimed, "right": right, "of": len(own)})
    over = [
        (float(c.answer["over_floor"]), c.group != "outside" and c.top(1))
        for c in of(cases, *HIDING)
        if c.candidates and c.answer.get("over_floor") and c.label["mode"] == "closed_loop"
    ]
    left = []
    for low, high in pairwise(OVER_FLOOR):
        inside = [right for x, right in over if low <= x < high]
        if inside:
            left.append({"from": low, "right": sum(inside), "of": len(inside)})
    brier = float(np.mean([(p - right) ** 2 for p, right in claims])) if claims else None
    return {"Brier": brier, "of": len(claims), "calibration": table, "by what is left": left}


def verdicts(cases: Sequence[Judged]) -> dict[str, dict[str, int]]:
    """Group x verdict."""
    return _table(cases, lambda c: c.group, lambda c: c.verdict)


def confusion(cases: Sequence[Judged]) -> dict[str, dict[str, int]]:
    """True effect x leading candidate, or the verdict where no effect is named."""
    return _table(of(cases, "single", "outside"), lambda c: match.truths(c.label)[0][0], leading)


def by_kind(cases: Sequence[Judged], *keys: str) -> dict[str, dict[str, int]]:
    """Group and kind of record or machine x right or wrong."""
    return {
        name: row
        for key in keys
        for name, row in _table(
            cases,
            lambda c, key=key: f"{c.group}, {c.label[key]}",  # type: ignore[misc]
            lambda c: "right" if right(c) else "wrong",
        ).items()
    }


def leading(c: Judged) -> str:
    """What a case's answer comes down to."""
    if c.verdict in ("effect", "ambiguous") and c.candidates:
        return " + ".join(effect for effect, _ in match.members(c.candidates[0]))
    return f"({c.verdict})"


def _table(
    cases: Sequence[Judged], row: Callable[[Judged], str], column: Callable[[Judged], str]
) -> dict[str, dict[str, int]]:
    made: dict[str, Counter[str]] = {}
    for c in cases:
        made.setdefault(row(c), Counter())[column(c)] += 1
    return {name: dict(made[name].most_common()) for name in sorted(made)}


def failures(cases: Sequence[Judged]) -> list[dict[str, Any]]:
    """Every case that is not answered as it should be, and how it was answered."""
    return [
        {
            "case": c.label["case"],
            "group": c.group,
            "family": c.label["family"],
            "mode": c.label["mode"],
            "hidden": [f"{e}@{p}" for e, p in match.truths(c.label)],
            "lambdas": c.label.get("lambdas", []),
            "delta_lambda": c.label.get("delta_lambda"),
            "told": c.label.get("told"),
            "verdict": c.verdict,
            "named": [
                " + ".join(f"{e}@{p}" for e, p in match.members(k)) + f" {k['probability']:.2f}"
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
    if c.group in ("none", "drifted"):
        return c.verdict in ("adequate", "parameters")
    if c.group == "outside":
        return c.verdict == "unknown"
    return c.top(1) if c.group == "single" else c.top(3)


def everything(cases: Sequence[Judged]) -> dict[str, Any]:
    """All figures of a run."""
    return {
        "cases": len(cases),
        "naming": naming(cases),
        "errors": errors(cases),
        "coverage of 95 % intervals": coverage(cases),
        "trust": trust(cases),
        "seconds": spread(c.seconds for c in cases),
        "verdicts": verdicts(cases),
        "confusion": confusion(cases),
        "kinds": by_kind(cases, "mode", "family"),
        "failures": failures(cases),
    }

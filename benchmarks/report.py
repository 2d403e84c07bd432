"""The benchmark as tables, and the ratios beside what was asked for."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import dop853
import ours
import plain
import surroundings
from case import SPAN
from measure import Point, at_equal_error

#: reached errors at which engines are compared
TARGETS = (1e-3, 1e-6, 1e-9)
SAME_RTOL = 1e-10  # at which the cvode engine and the plain program take the same steps
PLAIN = f"{plain.OPTIMISED} Adams"


@dataclass(frozen=True)
class Wanted:
    """A figure with its target: `measured` at least, or at most, `limit`."""

    what: str
    measured: float | None
    limit: float | None
    at_least: bool = True
    unit: str = "times"
    goal: float | None = None

    def cells(self) -> tuple[str, str, str, str]:
        sign = "≥" if self.at_least else "≤"
        target = "" if self.limit is None else f"{sign} {self.limit:g}"
        if self.goal is not None:
            target += f" (goal {self.goal:g})"
        if self.measured is None:
            return self.what, "not reached", target, ""
        return self.what, f"{self.measured:.3g} {self.unit}", target, self.verdict()

    def verdict(self) -> str:
        if self.limit is None or self.measured is None:
            return ""
        met = self.measured >= self.limit if self.at_least else self.measured <= self.limit
        return "met" if met else "not met"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table with aligned columns, numbers to the right."""
    cells = [list(head), *map(list, rows)]
    widths = [max(len(row[k]) for row in cells) for k in range(len(head))]

    def line(row: Sequence[str]) -> str:
        first, *others = (
            cell.ljust(w) if k == 0 else cell.rjust(w)
            for k, (cell, w) in enumerate(zip(row, widths, strict=True))
        )
        return "| " + " | ".join([first, *others]) + " |"

    rule = "|" + "|".join("-" * (w + 1) + ("-" if k == 0 else ":") for k, w in enumerate(widths))
    return "\n".join([line(cells[0]), rule + "|", *map(line, cells[1:])])


def surroundings_text(facts: dict[str, Any]) -> str:
    return "Taken with " + "; ".join(f"{name} {value}" for name, value in facts.items()) + "."


def command_line(doc: str) -> argparse.ArgumentParser:
    """What a module's own words say of it."""
    about, _, rest = doc.partition("\n\n")
    return argparse.ArgumentParser(
        description=about, epilog=rest, formatter_class=argparse.RawDescriptionHelpFormatter
    )


def count_asked(doc: str, option: str, default: int) -> int:
    """The one count of a command line; prints with what its figures are taken."""
    parser = command_line(doc)
    parser.add_argument(f"--{option}", type=int, default=default)
    given = parser.parse_args()
    print(surroundings_text(surroundings.describe()), "\n")
    return int(vars(given)[option])


def of(points: Sequence[Point], name: str) -> list[Point]:
    return [p for p in points if p.engine == name]


def names(points: Sequence[Point]) -> list[str]:
    return list(dict.fromkeys(p.engine for p in points))


def points_text(points: Sequence[Point]) -> str:
    head = ("engine", "rtol", "ms per simulated s", "contacts found", "error reached")
    rows = (
        (
            p.engine,
            "–" if np.isnan(p.rtol) else f"{p.rtol:.0e}",
            f"{p.ms / SPAN:.2f}",
            str(p.events) if p.events else "–",
            f"{p.error:.1e}" if np.isfinite(p.error) else f"failed: {p.note}",
        )
        for p in points
    )
    return table(head, rows)


def equal_error_text(points: Sequence[Point]) -> str:
    """Milliseconds per simulated second at each target, and over the fastest exact engine."""
    rows = []
    fastest = min(
        (cost for name in names(points) if name.startswith(ours.NATIVE)
         if (cost := at_equal_error(of(points, name), TARGETS[-1])) is not None),
        default=None,
    )  # fmt: skip
    for name in names(points):
        costs = [at_equal_error(of(points, name), target) for target in TARGETS]
        rows.append((name, *(_cost(ms, fastest) for ms in costs)))
    return table(("engine", *(f"{t:.0e}" for t in TARGETS)), rows)


def _cost(ms: float | None, fastest: float | None) -> str:
    if ms is None:
        return "not reached"
    ratio = "" if fastest is None else f" ({ms / fastest:.3g}x)"
    return f"{ms / SPAN:.3g}{ratio}"


def wanted(points: Sequence[Point]) -> list[Wanted]:
    """Everything that was asked for, and what else belongs beside it."""
    found = []
    for name in names(points):
        if name.startswith(ours.NATIVE):
            found += of_exact(points, name)
    explicit = {e: ratio(points, ours.EXPLICIT, dop853.NAME, e) for e in TARGETS[1:]}
    for error, value in explicit.items():
        what = f"explicit engine against {dop853.NAME}, error {error:.0e}"
        found.append(Wanted(what, value, None, at_least=False))
    for method in ("Adams", "BDF"):
        found += of_path(points, method)
    return found


def of_exact(points: Sequence[Point], name: str) -> list[Wanted]:
    """The run itself, and how many times faster it is than other engines at their error."""
    own = of(points, name)[0]
    limit = 3.0 if name == ours.BASELINE else 1.8
    found = [
        Wanted(f"{name}: {SPAN:g} s with {own.events} contacts", own.ms, limit, False, "ms"),
        Wanted(f"{name}: error", own.error, 1e-9, False, ""),
    ]
    others: tuple[tuple[str, float | None, float | None], ...] = (
        (PLAIN, 25, 40),
        (ours.ADAMS, None, None),
        ("scikit-sundae CVODE Adams", 300, None),
        ("SciPy LSODA", 1000, None),
        (dop853.NAME, None, None),
    )
    for error in TARGETS[1:]:
        for other, least, goal in others:
            if of(points, other):
                asked = (least, goal) if error == 1e-6 else (None, None)
                what = f"{name} against {other}, error {error:.0e}"
                value = ratio(points, other, name, error)
                if value is None and asked[0] is None:
                    continue  # the table at equal error says so
                found.append(Wanted(what, value, asked[0], goal=asked[1]))
    return found


def of_path(points: Sequence[Point], method: str) -> list[Wanted]:
    """The cvode engine over the plain program: what our own machinery costs."""
    mine, theirs = f"dualdrive cvode {method}", f"{plain.OPTIMISED} {method}"
    if not of(points, mine) or not of(points, theirs):
        return []
    same = [next(p.ms for p in of(points, name) if p.rtol == SAME_RTOL) for name in (mine, theirs)]
    what = f"cvode engine over the plain program, {method}"
    at_error = ratio(points, mine, theirs, 1e-6)
    return [
        Wanted(f"{what}, rtol {SAME_RTOL:.0e}", same[0] / same[1], 1.15, at_least=False),
        Wanted(f"{what}, error 1e-06", at_error, 1.15, at_least=False),
    ]


def ratio(points: Sequence[Point], slow: str, fast: str, error: float) -> float | None:
    costs = [at_equal_error(of(points, name), error) for name in (slow, fast)]
    return None if None in costs else costs[0] / costs[1]  # type: ignore[operator]


def wanted_text(figures: Sequence[Wanted]) -> str:
    return table(("", "measured", "asked for", ""), (f.cells() for f in figures))


def presets_text(rows: Sequence[dict[str, Any]]) -> str:
    head = ("preset", "simulated s", "ms per simulated s", "times real time", "events", "engine",
            "error")  # fmt: skip
    cells = (
        (r["preset"], f"{r['simulated_s']:.2f}", f"{r['ms_per_s']:.2f}",
         f"{r['times_real_time']:.0f}", str(r["events"]), r["method"], f"{r['error']:.0e}")
        for r in rows
    )  # fmt: skip
    return table(head, cells)

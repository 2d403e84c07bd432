"""The benchmark as tables and as a picture."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from case import SPAN, VARIANT, Point, at_equal_error

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: reached errors at which engines are compared
TARGETS = (1e-3, 1e-4, 1e-5, 1e-6)
OURS = "dualdrive Adams"


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
    return "\n".join(f"{name}: {value}" for name, value in facts.items())


def equal_error(points: Sequence[Point]) -> dict[str, dict[str, float | None]]:
    """Engine -> error -> ms per simulated second, or None where it does not get there."""
    return {
        name: {
            f"{target:.0e}": at_equal_error([p for p in points if p.engine == name], target)
            for target in TARGETS
        }
        for name in dict.fromkeys(p.engine for p in points)
    }


def engines_text(result: dict[str, Any], points: Sequence[Point]) -> str:
    told = result["case"]
    lines = [
        "",
        f"Variant {VARIANT}: {SPAN:g} s, {told['contacts']} contacts made or lost; a shift of the "
        f"start by 1e-12 of the gap grows to {told['spread']:.1e}",
        "",
        table(
            ("engine", "rtol", "ms per simulated s", "contacts found", "error reached"),
            (
                (
                    p.engine,
                    f"{p.rtol:.0e}",
                    f"{p.ms:.2f}",
                    str(p.events),
                    f"{p.error:.1e}" if np.isfinite(p.error) else f"failed: {p.note}",
                )
                for p in points
            ),
        ),
        "",
        "ms per simulated second at equal error reached, and how many times that of "
        f"{OURS} it is (interpolated between the runs above)",
        "",
        table(("engine", *(f"{t:.0e}" for t in TARGETS)), _ratios(result["at_equal_error"])),
        *(f"left out: {what}" for what in result["missing"]),
    ]
    return "\n".join(lines)


def _ratios(costs: dict[str, dict[str, float | None]]) -> Iterable[Sequence[str]]:
    own = costs[OURS]
    for name, row in costs.items():
        cells = []
        for target, ms in row.items():
            mine = own[target]
            ratio = "" if ms is None or mine is None else f" ({ms / mine:.1f}x)"
            cells.append("not reached" if ms is None else f"{ms:.1f}{ratio}")
        yield (name, *cells)


def presets_text(rows: Sequence[dict[str, Any]]) -> str:
    return "\n".join(
        [
            "",
            "Presets through their default motion, default options, every signal and the energy "
            "balance recorded each ms",
            "",
            table(
                ("preset", "simulated s", "ms per simulated s", "times real time", "events",
                 "steps", "method", "error"),
                (
                    (r["preset"], f"{r['simulated_s']:.2f}", f"{r['ms_per_s']:.2f}",
                     f"{r['times_real_time']:.0f}", str(r["events"]), str(r["steps"]), r["method"],
                     f"{r['error']:.0e}")
                    for r in rows
                ),
            ),
        ]
    )  # fmt: skip


def throughput_text(rows: Sequence[dict[str, Any]]) -> str:
    head = ("runs", "threads", "cores it got", "runs per s", "processor ms per run")
    cells = (
        (
            r["what"],
            str(r["jobs"]),
            f"{r['cores_used']:.2f}",
            f"{r['runs_per_s']:.1f}",
            f"{r['ms_per_run']:.1f}",
        )
        for r in rows
    )
    return "\n".join(["", "Many runs; runs per second are wall clock", "", table(head, cells)])


def draw(points: Sequence[Point], spread: float) -> Figure:
    """Error reached over time spent, both logarithmic: lower left is better."""
    from dualdrive.plots.style import LIMIT, drive_colour, figure_of, picture, single

    @picture
    def drawn() -> Figure:
        axes = single(None, 8.0, 5.0)
        for number, name in enumerate(dict.fromkeys(p.engine for p in points), 1):
            own = [p for p in points if p.engine == name and np.isfinite(p.error)]
            mine = name.startswith("dualdrive")
            axes.loglog(
                [p.ms for p in own],
                [p.error for p in own],
                marker="o" if mine else "s",
                ms=5,
                lw=2.0 if mine else 1.2,
                ls="-" if mine else "--",
                color=drive_colour(number),
                label=name,
            )
        axes.axvline(1e3, color=LIMIT, lw=1.0, ls=":", label="real time")
        axes.margins(0.05)
        axes.set_xlabel("processor time [ms per simulated s]")
        axes.set_ylabel("error reached [worst state over its peak]")
        axes.set_title(f"{SPAN:g} s with many impacts: error against time")
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        return figure_of(axes)

    return drawn()

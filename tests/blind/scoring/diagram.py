"""The reliability diagram: what was claimed against what was right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure


def draw(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Each bin of claimed probability with the Wilson interval of its share of right answers."""
    figure = Figure(figsize=(4.5, 4.5), layout="constrained")
    axes = figure.add_subplot()
    axes.plot([0, 1], [0, 1], color="0.7", linewidth=1)
    claimed = [row["claimed"] for row in rows]
    right = [row["share"] for row in rows]
    low = [row["share"] - row["low"] for row in rows]
    high = [row["high"] - row["share"] for row in rows]
    axes.errorbar(claimed, right, yerr=[low, high], fmt="o", capsize=3)
    for row in rows:
        axes.annotate(
            str(row["of"]), (row["claimed"], row["share"]), (6, -10), textcoords="offset points"
        )
    axes.set(xlim=(0, 1), ylim=(0, 1), xlabel="claimed probability", ylabel="share that was right")
    axes.set_aspect("equal")
    figure.savefig(path, dpi=150)

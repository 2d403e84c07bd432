"""The benchmark as pictures: error against work, cost against length and switches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from case import SPAN
from measure import Point

MARKERS = "osD^v<>"
#: engine of ours -> peers of the same method, drawn in its colour
METHODS = {
    "exponential": (),
    "explicit": ("DOP853 in Numba",),
    "Adams": ("plain C++ CVODE Adams",),
    "BDF": ("plain C++ CVODE BDF",),
    "auto": (),
}

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def accuracy_against_work(points: Sequence[Point]) -> Figure:
    """Error reached over time spent, both logarithmic: lower left is better."""
    from dualdrive.plots.style import LIMIT, drive_colour, figure_of, picture, single

    @picture
    def drawn() -> Figure:
        axes = single(None, 9.0, 5.5)
        families: dict[str, int] = {}  # library -> engines of it so far
        for name in dict.fromkeys(p.engine for p in points):
            own = [p for p in points if p.engine == name and np.isfinite(p.error)]
            family = name.split()[0]
            mark = families[family] = families.get(family, -1) + 1
            mine = family == "dualdrive"
            axes.loglog(
                [p.ms / SPAN for p in own],
                [p.error for p in own],
                marker=MARKERS[mark % len(MARKERS)],
                ms=7 if mine else 5,
                lw=2.0 if mine else 1.2,
                ls="-" if mine else "--",
                color=drive_colour(list(families).index(family) + 1),
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


def work_precision(cases: Mapping[str, tuple[float, Sequence[Point]]]) -> Figure:
    """Error reached over work, a panel a case: lower left is better.

    cases: title -> (ms that are a work of 1, points)
    """
    from dualdrive.plots.style import LIMIT, drive_colour, picture

    @picture
    def drawn() -> Figure:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(10.5, 4.6), layout="constrained")
        panels = figure.subplots(1, len(cases), sharey=True)
        for axes, (title, (unit, points)) in zip(panels, cases.items(), strict=True):
            for name in dict.fromkeys(p.engine for p in points):
                own = [p for p in points if p.engine == name and np.isfinite(p.error)]
                ours = name in METHODS
                k = next(k for k, (e, peers) in enumerate(METHODS.items()) if name in (e, *peers))
                axes.loglog(
                    [p.ms / unit for p in own],
                    [p.error for p in own],
                    marker=MARKERS[k % len(MARKERS)],
                    ms=8 if name == "auto" else 5,
                    mfc="none" if name == "auto" else None,
                    lw=1.6 if ours else 1.1,
                    ls="-" if ours else "--",
                    color=drive_colour(k + 1),
                    label=name,
                )
            axes.axhline(1e-6, color=LIMIT, lw=1.0, ls=":")
            axes.margins(0.05)
            axes.set_title(title)
            axes.set_xlabel("work [processor time / affine run]")
        panels[0].set_ylabel("error reached [worst state / its peak]")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
        return figure

    return drawn()

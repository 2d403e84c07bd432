"""What the exact engine costs as runs get longer and switches more: a straight line each.

    python benchmarks/linear.py           table, and a picture in build/
    python benchmarks/linear.py --quick   up to a hundred seconds
    python benchmarks/linear.py --write   both into docs/

The case with many impacts, for longer or shorter; and, over a span that stays, at rest until
shortly before its end, so that contacts are many or few. Processor time of the best of several
runs.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

import case
import core_machines
import page
from dualdrive import _core
from report import table
from surroundings import ROOT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SPANS = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)  # s
FIXED = 1000.0  # s, of the runs with more and more switches
STEP = 1e-2  # s, their output step
FREQUENCY = 1.5  # Hz, their sine: three times that of the case
SHARES = (0.0, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0)  # of FIXED, during which it moves
LARGE = 0.1  # slopes are those of points above this share of the largest


@dataclass(frozen=True)
class Cost:
    """One run: span s, switches in it, processor time ms."""

    span: float
    switches: int
    ms: float


def cost(span: float, motion: _core.Waveform, step: float) -> Cost:
    """The exact engine's best time over repeats that together take a moment."""
    machine, best, spent, switches = case.core()[0], np.inf, 0.0, 0
    while spent < 0.3:
        begin = time.process_time()
        raw = _core.simulate(
            machine, {"theta_ref": motion}, end=span, output_step=step, engine="exact",
            signals=case.PLANT, energy=False,
        )  # fmt: skip
        used = time.process_time() - begin
        assert raw.status == "success", raw.message
        best, spent = min(best, used), spent + used
        switches = len(core_machines.Run(raw).contacts)
    return Cost(span, switches, 1e3 * best)


def over_time(longest: float = SPANS[-1]) -> list[Cost]:
    motion = _core.sine(case.AMPLITUDE, case.FREQUENCY)
    return [cost(span, motion, 1e-3) for span in SPANS if span <= longest]


def over_switches(span: float = FIXED) -> list[Cost]:
    return [cost(span, late(share, span), STEP) for share in SHARES]


def late(share: float, span: float) -> _core.Waveform:
    """At rest, and then a sine for that share of the span."""
    return _core.sine(case.AMPLITUDE, FREQUENCY, start=(1 - share) * span)


def slope(x: Sequence[float], y: Sequence[float]) -> float:
    """The exponent with which y grows, over the large end of x."""
    x_, y_ = np.array(x), np.array(y)
    keep = x_ >= LARGE * x_.max()
    return float(np.polyfit(np.log(x_[keep]), np.log(y_[keep]), 1)[0])


@dataclass(frozen=True)
class Lines:
    """Cost over time and over switches, and what follows from them."""

    time: list[Cost]
    switches: list[Cost]

    @property
    def time_slope(self) -> float:
        return slope([c.span for c in self.time], [c.ms for c in self.time])

    @property
    def rest(self) -> float:
        """Of a run over FIXED without any switch, ms."""
        return min(c.ms for c in self.switches if c.switches <= self.switches[0].switches)

    @property
    def switch_slope(self) -> float:
        """Of the cost beyond that of a run at rest."""
        beyond = [c for c in self.switches if c.ms > self.rest]
        return slope([c.switches for c in beyond], [c.ms - self.rest for c in beyond])

    @property
    def us_per_switch(self) -> float:
        """With the ringing after it, which takes shorter looks than rest does."""
        most = self.switches[-1]
        return 1e3 * (most.ms - self.rest) / most.switches

    def text(self) -> str:
        rows = [("longer and longer, output each ms", c) for c in self.time]
        rows += [(f"{self.switches[0].span:g} s, moves longer and longer", c)
                 for c in self.switches]  # fmt: skip
        head = ("", "simulated s", "contacts", "ms", "µs per simulated s")
        cells = (
            (what, f"{c.span:g}", str(c.switches), f"{c.ms:.2f}", f"{1e3 * c.ms / c.span:.0f}")
            for what, c in rows
        )
        summary = (
            f"On logarithmic axes the cost grows with the power {self.time_slope:.3f} of the "
            f"simulated time and, beyond that of a run at rest, {self.switch_slope:.3f} of the "
            f"number of contacts: {self.us_per_switch:.1f} µs each."
        )
        return f"{table(head, cells)}\n\n{summary}"


def measure(*, quick: bool = False) -> Lines:
    return (
        Lines(over_time(100.0), over_switches(100.0))
        if quick
        else Lines(over_time(), over_switches())
    )


def draw(lines: Lines) -> Figure:
    from matplotlib.figure import Figure

    from dualdrive.plots.style import drive_colour, picture

    some = lines.switches
    spans, counts = ([c.span for c in lines.time], [float(c.switches) for c in some])
    per_second = lines.time[-1].ms / lines.time[-1].span
    panels = (
        (f"simulated time [s]; slope {lines.time_slope:.3f}", spans, lines.time,
         [per_second * span for span in spans], "in proportion"),
        (f"contacts within {some[0].span:g} s; slope beyond rest {lines.switch_slope:.3f}",
         counts, some, [lines.rest + lines.us_per_switch / 1e3 * n for n in counts],
         "rest, and in proportion"),
    )  # fmt: skip

    @picture
    def drawn() -> Figure:
        figure = Figure(figsize=(10.0, 4.0), layout="constrained")
        axes = figure.subplots(1, 2, sharey=True)
        for ax, (label, x, costs, line, name) in zip(axes, panels, strict=True):
            ax.loglog(x, line, ls=":", color=drive_colour(2), label=name)
            ax.loglog(x, [c.ms for c in costs], "o", color=drive_colour(1), label="measured")
            ax.set_xlabel(label)
            ax.legend()
        axes[0].set_ylabel("processor time [ms]")
        return figure

    return drawn()


def main() -> None:
    parser = page.command_line(str(__doc__))
    parser.add_argument("--quick", action="store_true", help="shorter runs")
    given = parser.parse_args()
    lines = measure(quick=given.quick)
    print(lines.text())
    picture = ROOT / ("docs/performance-linear.svg" if given.write else "build/linear.svg")
    draw(lines).savefig(picture)
    if given.write:
        page.write("linear", lines.text())


if __name__ == "__main__":
    main()

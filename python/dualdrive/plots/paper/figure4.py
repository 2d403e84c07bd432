"""Figure 4: step and sine before tuning, without and with backlash, and the limit cycle's map."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dualdrive.paper.figure4 import GAIN, GAINS, GAPS
from dualdrive.paper.settings import ARCSEC, STEP
from dualdrive.plots.style import COMMAND, FIRST, LIMIT, SECOND, TABLE, picture
from dualdrive.plots.timeline import key_above

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dualdrive.paper.figure4 import Figure4, Swing
    from dualdrive.run import Run

__all__ = ["responses", "untuned"]


@picture
def untuned(data: Figure4) -> Figure:
    """The paper's four panels (a) to (d) at one gain, and the limit cycle against gain and gap."""
    from matplotlib.figure import Figure as Sheet

    sheet = Sheet(figsize=(9.0, 9.0), layout="constrained")
    panels = sheet.subplots(3, 2)
    for one in panels[:2].flat[1:]:  # one range, so that the four can be compared
        one.sharey(panels[0][0])
    sheet.suptitle(f"K = {GAIN:g}/s unless said otherwise", x=0.02, ha="left", fontsize=9)
    for row, play in enumerate((False, True)):
        words = "backlash" if play else "no backlash"
        letters = "cd" if play else "ab"
        responses(panels[row][0], {"": data.steps[play]}, 6.0)
        panels[row][0].set_title(f"({letters[0]}) step, {words}")
        responses(panels[row][1], {"": data.sines[play]}, 25.0)
        panels[row][1].set_title(f"({letters[1]}) sine, {words}")
    _cycle(panels[2][0], {k: data.played[k] for k in GAINS}, "K [1/s]", "against gain")
    gaps = {1e3 * gap: data.gaps[gap] for gap in GAPS}
    _cycle(panels[2][1], gaps, "half gap Δ [mrad]", "against gap")
    return sheet


def responses(axes: Axes, runs: Mapping[str, Run], end: float, origin: float = 0.0) -> None:
    """Table angles and the command they follow; time from `origin`."""
    first = next(iter(runs.values()))
    k = (first.t >= origin) & (first.t <= origin + end)
    axes.plot(first.t[k] - origin, first["theta_ref"][k] / STEP, color=COMMAND, ls="--", lw=0.9,
              label="command")  # fmt: skip
    for colour, (name, run) in zip((TABLE, FIRST), runs.items(), strict=False):
        axes.plot(run.t[k] - origin, run["theta_m"][k] / STEP, color=colour, label=name or "table")
    axes.set(xlabel="time [s]", ylabel="angle [mrad]")
    axes.margins(y=0.08)
    key_above(axes)


def _cycle(axes: Axes, swings: Mapping[float, Swing], label: str, title: str) -> None:
    """Amplitude to the left, frequency to the right."""
    other = axes.twinx()
    x = list(swings)
    amplitude = [swing.left.amplitude / ARCSEC for swing in swings.values()]
    frequency = [swing.left.frequency for swing in swings.values()]
    axes.plot(x, amplitude, "o-", color=FIRST, ms=4)
    other.plot(x, frequency, "s-", color=SECOND, ms=4)
    axes.set(xlabel=label, ylim=(0, 1.1 * max(amplitude)), xlim=(0, 1.05 * max(x)))
    axes.set_ylabel("amplitude [arcsec]", color=FIRST)
    other.set_ylim(0, 1.1 * max(frequency))
    other.set_ylabel("frequency [Hz]", color=SECOND)
    other.grid(visible=False)
    other.spines["right"].set(visible=True, color=LIMIT)
    axes.set_title(f"Limit cycle {title}")

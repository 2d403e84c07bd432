"""Figure 5: step and sine after tuning, with the printed figures marked."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dualdrive.paper.figure5 import PRINTED, READINGS, TENSIONING
from dualdrive.paper.settings import STEP
from dualdrive.plots.paper.figure4 import responses
from dualdrive.plots.style import BAND, COMMAND, FIRST, LIMIT, MEASURED, TABLE, picture
from dualdrive.plots.timeline import key_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dualdrive.paper.figure5 import Figure5

__all__ = ["tuned"]


@picture
def tuned(data: Figure5) -> Figure:
    """(a) the step in both readings of time with the printed figures; (b) the sine."""
    from matplotlib.figure import Figure as Sheet

    sheet = Sheet(figsize=(9.0, 7.0), layout="constrained")
    above, below = sheet.subplots(2, 1, height_ratios=(3, 2))
    _step(above, data)
    sines = {f"table, {r.name}": data.sines[r.name] for r in READINGS}
    responses(below, sines, 25.0, origin=TENSIONING)
    below.set_title("(b) sine, 1 rad/s")
    return sheet


def _step(axes: Axes, data: Figure5) -> None:
    """Time as the paper reads it: the step comes at the lead of each reading."""
    axes.axhspan(0.98, 1.02, color=BAND, lw=0, label="± 2 %")
    for colour, r in zip((TABLE, FIRST), READINGS, strict=True):
        run = data.steps[r.name]
        t = run.t - TENSIONING + r.lead
        k = (t >= 0) & (t <= 5.0)
        axes.plot(t[k], run["theta_m"][k] / STEP, color=colour, label=r.name)
        axes.axvline(r.lead, color=colour, ls=":", lw=0.9, label=f"its step, {r.lead:g} s")
    delay, rise, settling, over, _ = PRINTED.values()
    axes.axhline(1.0, color=LIMIT, lw=0.8)
    points = (
        (delay, 0.5, f"$t_d$ {delay:g} s", (9, -4)),
        (rise, 1.0, f"$t_r$ {rise:g} s", (9, -14)),
        (settling, 0.98, f"$t_s$ {settling:g} s", (-8, -18)),
    )
    for x, y, text, off in points:
        axes.plot(x, y, "o", mfc="none", mec=MEASURED, ms=7)
        axes.annotate(text, (x, y), xytext=off, textcoords="offset points", color=MEASURED)
    axes.axhline(1 + over / 100, color=COMMAND, ls="--", lw=0.9, label="printed overshoot 17 %")
    axes.set(xlabel="time as the paper counts it [s]", ylabel="angle [mrad]", xlim=(0, 5.0))
    axes.set_title("(a) step")
    axes.margins(y=0.08)
    key_above(axes)

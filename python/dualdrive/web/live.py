"""Plots of a page that stands alone: series as text, panels as the modules take them."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualdrive.readable import ladder
from dualdrive.traces import CHANNELS
from dualdrive.web import modules

__all__ = ["Live", "Series", "units"]

#: numbers of all plots of a page; 8 MB of text. Beyond it a plot stays a still picture
MOST: Final = 1_500_000
_MODULES: Final = (
    "dom.js", "plot.js", "readout.js", "reduce.js", "report.js", "shade.js", "source.js",
    "stack.js", "timeline.js", "units.js", "keys.js",
)  # fmt: skip
_START: Final = 'import "dd/report.js";'


class Series(Protocol):
    """A quantity, measured and simulated; arrays of shape (n,), SI."""

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def title(self) -> str: ...  # noqa: D102
    @property
    def unit(self) -> str: ...  # noqa: D102
    @property
    def t(self) -> NDArray[np.float64]: ...  # noqa: D102
    @property
    def measured(self) -> NDArray[np.float64]: ...  # noqa: D102
    @property
    def simulated(self) -> NDArray[np.float64]: ...  # noqa: D102


def units() -> dict[str, list[dict[str, Any]]]:
    """SI unit -> the units in which it is read, each with the peak up to which it is."""
    known = {what.unit for what in CHANNELS.values()} | {"m", "m/s", "N", "s"}
    return {
        unit: [
            {"top": top if np.isfinite(top) else None, "factor": rung.factor, "unit": rung.unit}
            for top, rung in ladder(unit)
        ]
        for unit in sorted(known)
    }


class Live:
    """The plots of one page that move."""

    def __init__(self) -> None:
        self._plots: list[dict[str, Any]] = []
        self._numbers = 0

    def add(self, several: Sequence[Series]) -> str | None:
        """A plot of measured over model; its name on the page, None where it is too long."""
        count = sum(len(q.t) for q in several) * 2 + (len(several[0].t) if several else 0)
        alike = all(np.array_equal(q.t, several[0].t) for q in several)
        if not several or not alike or self._numbers + count > MOST:
            return None
        self._numbers += count
        columns = {
            f"{q.name}.{what}": _packed(values, "<f4")
            for q in several
            for what, values in (("measured", q.measured), ("model", q.simulated))
        }
        panels = [
            {
                "id": q.name,
                "title": q.title,
                "unit": q.unit,
                "peak": float(np.max(np.abs(q.measured), initial=0.0)),
                "name": q.name,
            }
            for q in several
        ]
        told = {"t": _packed(several[0].t, "<f8"), "columns": columns, "panels": panels}
        self._plots.append(told)
        return str(len(self._plots) - 1)

    @property
    def scripts(self) -> list[tuple[str, str]]:
        """Type and text of every script of the page, none where nothing moves."""
        if not self._plots:
            return []
        held = json.dumps({"units": units(), "plots": self._plots}, allow_nan=False)
        return [
            ("importmap", modules.own_imports(_MODULES)),
            ("application/json", held.replace("<", "\\u003c")),
            ("module", _START),
        ]

    @property
    def policy(self) -> str:
        """What a browser may do with the page: its own scripts, and no network at all."""
        runs = [modules.digest(text) for kind, text in self.scripts if kind != "application/json"]
        own = f"script-src {' '.join(runs)} data:; " if runs else ""
        return f"default-src 'none'; {own}style-src 'unsafe-inline'; img-src data: blob:"


def _packed(values: ArrayLike, kind: str) -> str:
    """Numbers as base64 text."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode()

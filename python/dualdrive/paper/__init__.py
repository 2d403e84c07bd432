"""The source paper's figures and tables, computed anew beside what it prints.

No parameter is printed in the paper; every exhibit says what was chosen, and nothing was fitted to
its digits unless the exhibit says so. `dualdrive.plots.paper` draws them, `dualdrive paper` prints.
"""

from __future__ import annotations

import time
from dataclasses import replace
from importlib import import_module
from typing import Final

from dualdrive.paper.exhibit import Claim, Exhibit, Number, Table, shown
from dualdrive.paper.rendering import page

__all__ = ["EXHIBITS", "Claim", "Exhibit", "Number", "Table", "page", "reproduce", "shown"]

#: exhibit -> (module of this package, function)
_WHERE: Final = {
    "fig1": ("figure1", "figure1"),
    "fig2": ("figure2", "figure2"),
    "fig3": ("figure3", "figure3"),
    "fig4": ("figure4", "figure4"),
    "fig5": ("figure5", "figure5"),
    "fig6": ("figure6", "figure6"),
    "table1": ("tables", "table1"),
    "table2": ("tables", "table2"),
}
#: in the order of the paper
EXHIBITS: Final = tuple(_WHERE)


def reproduce(name: str, *, jobs: int = 1) -> Exhibit:
    """One figure or table of the paper: fig1 ... fig6, table1, table2.

    jobs: threads for the tables, whose tests take a minute each on one.

    Raises ValueError for any other name, and where a simulation fails.
    """
    if name not in _WHERE:
        raise ValueError(f"{name!r}: not in the paper; choose one of {', '.join(EXHIBITS)}")
    module, function = _WHERE[name]
    begin = time.perf_counter()
    make = getattr(import_module(f"dualdrive.paper.{module}"), function)
    exhibit: Exhibit = make(jobs) if name.startswith("table") else make()
    return replace(exhibit, seconds=time.perf_counter() - begin)

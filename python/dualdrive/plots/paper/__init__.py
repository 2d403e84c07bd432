"""Pictures of the paper's figures and tables, drawn from `dualdrive.paper`'s exhibits."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from dualdrive.paper import Exhibit

__all__ = ["draw"]

#: exhibit -> (module of this package, function of its data)
_WHERE: Final = {
    "fig1": ("figure1", "transmission"),
    "fig2": ("figure2", "sharing"),
    "fig3": ("figure3", "structure"),
    "fig4": ("figure4", "untuned"),
    "fig5": ("figure5", "tuned"),
    "fig6": ("figure6", "tension"),
    "table1": ("tables", "accuracy"),
    "table2": ("tables", "accuracy"),
}


def draw(exhibit: Exhibit) -> Figure:
    """The picture of an exhibit that `dualdrive.paper.reproduce` made."""
    module, function = _WHERE[exhibit.name]
    drawn: Figure = getattr(import_module(f"dualdrive.plots.paper.{module}"), function)(
        exhibit.data
    )
    return drawn

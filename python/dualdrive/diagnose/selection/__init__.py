"""Which laws the records ask for: refits, forward selection, the noise that each leaves."""

from __future__ import annotations

from dualdrive.diagnose.selection.search import EFFORTS, Effort, Fitted, Selection, select

__all__ = ["EFFORTS", "Effort", "Fitted", "Selection", "select"]

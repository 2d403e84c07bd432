"""Errors of a torque balance as every verb prints them: those of `compare` on the same records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from dualdrive.compare import Comparison, balance_error, compare
from dualdrive.identify import Processing, Standstill
from dualdrive.traces import Trace


@dataclass(frozen=True)
class Printed:
    """Records of a torque balance, and how they are filtered.

    A search weighs what machines leave by its own samples; what a user reads is the comparison's
    error and noise floor, whichever verb was asked.
    """

    traces: Mapping[str, Trace]
    settings: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    processing: Processing | None = None
    standstill: Standstill | None = None

    def error(self, machine: Any) -> float:
        """Headline error of a machine on these records, relative."""
        return balance_error(
            machine,
            self.traces,
            settings=self.settings,
            processing=self.processing,
            standstill=self.standstill,
        )

    def compared(self, machine: Any) -> Comparison:
        """All that `compare` says of it."""
        return compare(
            machine,
            self.traces,
            "balance",
            settings=self.settings,
            processing=self.processing,
            standstill=self.standstill,
        )

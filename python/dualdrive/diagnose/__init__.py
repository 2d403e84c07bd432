"""Where a machine fails, which effect is missing, what can not be told apart, what to do next."""

from __future__ import annotations

from dualdrive.diagnose.result import (
    VERDICTS,
    Candidate,
    Diagnosis,
    EquationAtFault,
    Experiment,
    Interval,
    Shape,
)

__all__ = [
    "VERDICTS",
    "Candidate",
    "Diagnosis",
    "EquationAtFault",
    "Experiment",
    "Interval",
    "Shape",
]

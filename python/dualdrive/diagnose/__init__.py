"""Where a machine fails, which effect is missing, what can not be told apart, what to do next."""

from __future__ import annotations

from dualdrive.compare.equation import EquationAtFault
from dualdrive.diagnose.diagnosis import diagnose
from dualdrive.diagnose.improvement import improve
from dualdrive.diagnose.ladder import Ladder, Step
from dualdrive.diagnose.one_sentence import headline
from dualdrive.diagnose.result import (
    VERDICTS,
    Candidate,
    Diagnosis,
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
    "Ladder",
    "Shape",
    "Step",
    "diagnose",
    "headline",
    "improve",
]

"""What a search allows to be said: verdict, probabilities, what stays unexplained."""

from __future__ import annotations

from dualdrive.diagnose.decision.denials import upheld
from dualdrive.diagnose.decision.sanity import (
    asks_for_torque,
    beside_the_data_sheet,
    change_with_time,
    creeps,
    leaves_too_much,
    objection,
    removed,
    takes_too_little,
    unseen,
)
from dualdrive.diagnose.decision.verdict import Decision, decide, numbers_alone
from dualdrive.diagnose.selection import MissingTorque
from dualdrive.estimation.thresholds import THRESHOLDS

__all__ = [
    "THRESHOLDS",
    "Decision",
    "MissingTorque",
    "asks_for_torque",
    "beside_the_data_sheet",
    "change_with_time",
    "creeps",
    "decide",
    "leaves_too_much",
    "numbers_alone",
    "objection",
    "removed",
    "takes_too_little",
    "unseen",
    "upheld",
]

"""What a search allows to be said: verdict, probabilities, what stays unexplained."""

from __future__ import annotations

from dualdrive.diagnose.decision.sanity import objection
from dualdrive.diagnose.decision.thresholds import THRESHOLDS
from dualdrive.diagnose.decision.verdict import Decision, MissingTorque, decide

__all__ = ["THRESHOLDS", "Decision", "MissingTorque", "decide", "objection"]

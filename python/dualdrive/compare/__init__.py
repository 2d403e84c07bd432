"""A machine held against measured traces: how far off it is, and where."""

from __future__ import annotations

from dualdrive.compare.compare import compare, of_evaluation
from dualdrive.compare.comparison import ChannelError, Comparison, Quantity
from dualdrive.compare.noise import NoiseFloor, noise_floor
from dualdrive.compare.where import Condition, where_it_fails

__all__ = [
    "ChannelError",
    "Comparison",
    "Condition",
    "NoiseFloor",
    "Quantity",
    "compare",
    "noise_floor",
    "of_evaluation",
    "where_it_fails",
]

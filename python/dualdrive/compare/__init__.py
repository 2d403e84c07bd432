"""A machine held against measured traces: how far off it is, and where."""

from __future__ import annotations

from dualdrive.compare.compare import compare, of_evaluation
from dualdrive.compare.comparison import ChannelError, Comparison, Quantity
from dualdrive.compare.equation import EquationAtFault, equation_at_fault
from dualdrive.compare.noise import NoiseFloor, noise_floor
from dualdrive.compare.where import Condition, where_it_fails

__all__ = [
    "ChannelError",
    "Comparison",
    "Condition",
    "EquationAtFault",
    "NoiseFloor",
    "Quantity",
    "compare",
    "equation_at_fault",
    "noise_floor",
    "of_evaluation",
    "where_it_fails",
]

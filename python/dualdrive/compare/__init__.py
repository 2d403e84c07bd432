"""A machine held against measured traces: how far off it is, and where."""

from __future__ import annotations

from dualdrive.compare.checks import RecordWarning, check_records
from dualdrive.compare.clocks import Clock, clock_of, evened
from dualdrive.compare.comparing import balance_error, compare, of_evaluation
from dualdrive.compare.comparison import ChannelError, Comparison, Quantity
from dualdrive.compare.correlation import Correlation, residual_correlations
from dualdrive.compare.equation import EquationAtFault, equation_at_fault
from dualdrive.compare.noise import NoiseFloor, noise_floor
from dualdrive.compare.orders import Order, Ripple, ripples
from dualdrive.compare.stretches import Stretch, failing_stretches, situations_of
from dualdrive.compare.time_skew import Skew, skews
from dualdrive.compare.where import Condition, where_it_fails

__all__ = [
    "ChannelError",
    "Clock",
    "Comparison",
    "Condition",
    "Correlation",
    "EquationAtFault",
    "NoiseFloor",
    "Order",
    "Quantity",
    "RecordWarning",
    "Ripple",
    "Skew",
    "Stretch",
    "balance_error",
    "check_records",
    "clock_of",
    "compare",
    "equation_at_fault",
    "evened",
    "failing_stretches",
    "noise_floor",
    "of_evaluation",
    "residual_correlations",
    "ripples",
    "situations_of",
    "skews",
    "where_it_fails",
]

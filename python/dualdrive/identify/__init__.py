"""Fits of a machine to measured traces."""

from dualdrive.identify.balance import torque_balance
from dualdrive.identify.filtering import Processing
from dualdrive.identify.model import Balance, BalanceModel, Declared
from dualdrive.identify.play import estimate_play
from dualdrive.identify.play_drawing import draw_play
from dualdrive.identify.play_result import PlayEstimate
from dualdrive.identify.result import BalanceFit, Estimate
from dualdrive.identify.standstill import Standstill

__all__ = [
    "Balance",
    "BalanceFit",
    "BalanceModel",
    "Declared",
    "Estimate",
    "PlayEstimate",
    "Processing",
    "Standstill",
    "draw_play",
    "estimate_play",
    "torque_balance",
]

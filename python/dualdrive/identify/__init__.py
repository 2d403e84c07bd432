"""Fits of a machine to measured traces."""

from dualdrive.estimation.unknowns import default_free
from dualdrive.identify.balance import torque_balance
from dualdrive.identify.closed_loop import FitError
from dualdrive.identify.evaluation import Evaluation, evaluate
from dualdrive.identify.filtering import Processing
from dualdrive.identify.fit_result import Direction, Fit, Fitted
from dualdrive.identify.fitting import fit, refuse_filters, which_mode, why_balance, with_torques
from dualdrive.identify.model import Balance, BalanceModel, Declared
from dualdrive.identify.passivity import torque_notes, torque_warnings
from dualdrive.identify.play import estimate_play
from dualdrive.identify.play_result import PlayEstimate
from dualdrive.identify.result import BalanceFit, Estimate
from dualdrive.identify.search import Progress
from dualdrive.identify.standstill import Standstill

__all__ = [
    "Balance",
    "BalanceFit",
    "BalanceModel",
    "Declared",
    "Direction",
    "Estimate",
    "Evaluation",
    "Fit",
    "FitError",
    "Fitted",
    "PlayEstimate",
    "Processing",
    "Progress",
    "Standstill",
    "default_free",
    "estimate_play",
    "evaluate",
    "fit",
    "refuse_filters",
    "torque_balance",
    "torque_notes",
    "torque_warnings",
    "which_mode",
    "why_balance",
    "with_torques",
]

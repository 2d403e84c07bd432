"""Which laws are worth a refit: hypotheses as variants of a machine, and their score tests."""

from __future__ import annotations

from dualdrive.diagnose.screening.likelihood_ratio import loads
from dualdrive.diagnose.screening.orders import strongest_orders
from dualdrive.diagnose.screening.score import Scored, residual_maker, scores
from dualdrive.diagnose.screening.variants import Library, is_part, local_faults, travel

__all__ = [
    "Library",
    "Scored",
    "is_part",
    "loads",
    "local_faults",
    "residual_maker",
    "scores",
    "strongest_orders",
    "travel",
]

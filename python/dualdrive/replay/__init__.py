"""A recorded trace played through a machine's closed loop, channel beside channel."""

from __future__ import annotations

from dualdrive.assembly import core_of
from dualdrive.replay.channels import (
    HEADLINE,
    Compared,
    compared_channels,
    deflections,
    ratio_to_table,
)
from dualdrive.replay.error_measures import best_offsets, errors, headline
from dualdrive.replay.record import Record, ReplayError, named, records
from dualdrive.replay.run import RTOL, Replay, play, play_all

__all__ = [
    "HEADLINE",
    "RTOL",
    "Compared",
    "Record",
    "Replay",
    "ReplayError",
    "best_offsets",
    "compared_channels",
    "core_of",
    "deflections",
    "errors",
    "headline",
    "named",
    "play",
    "play_all",
    "ratio_to_table",
    "records",
]

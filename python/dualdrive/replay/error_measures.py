"""The measure of error: RMS residual over RMS of the measured, mean-free signal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from dualdrive.replay.channels import Compared
from dualdrive.replay.run import Replay

Array = NDArray[np.float64]
#: (record, channel) -> what a sensor adds
Offsets = Mapping[tuple[str, str], float]
OFFSETS = ("all", "encoders", "none")


def best_offsets(replays: Sequence[Replay], which: str = "all") -> dict[tuple[str, str], float]:
    """What each sensor must have added, from its residual's mean.

    which: ``encoders`` whose common zero is unknown, ``all`` headline channels but the following
        error, whose zero the loop itself sets, or ``none``
    """
    return {
        (replay.record.name, c.name): -float(np.mean(replay.residual(c.name)))
        for replay in replays
        for c in replay.record.channels
        if may_be_off(c, which)
    }


def may_be_off(channel: Compared, which: str) -> bool:
    """Whether a channel's sensor is granted a constant; see `best_offsets`."""
    if which not in OFFSETS:
        raise ValueError(f"offsets = {which!r}; choose one of {', '.join(OFFSETS)}")
    if channel.floating or which == "none":
        return channel.floating and which != "none"
    return which == "all" and channel.headline and channel.kind != "following error"


def residuals(replays: Sequence[Replay], offsets: Offsets) -> dict[tuple[str, str], Array]:
    """Simulated plus offset minus measured, by (record, channel)."""
    return {
        (own := (replay.record.name, c.name)): replay.residual(c.name) + offsets.get(own, 0.0)
        for replay in replays
        for c in replay.record.channels
    }


def errors(replays: Sequence[Replay], offsets: Offsets) -> dict[str, float]:
    """Relative error of each channel, all records together."""
    left: dict[str, float] = {}
    whole: dict[str, float] = {}
    for replay in replays:
        for c in replay.record.channels:
            residual = replay.residual(c.name) + offsets.get((replay.record.name, c.name), 0.0)
            left[c.name] = left.get(c.name, 0.0) + float(np.sum(residual**2))
            whole[c.name] = whole.get(c.name, 0.0) + len(residual) * c.spread**2
    return {name: float(np.sqrt(left[name] / whole[name])) for name in left}


def headline(by_channel: Mapping[str, float], channels: Iterable[Compared]) -> float:
    """Mean over following error, currents or torques, and deflections; NaN when there is none.

    Channels of one kind are averaged first, so that two motors do not outvote the table.
    """
    kinds = {c.name: c.kind for c in channels if c.headline}
    sizes = [
        np.mean([by_channel[name] for name in kinds if kinds[name] == kind])
        for kind in dict.fromkeys(kinds.values())
    ]
    return float(np.mean(sizes)) if sizes else float("nan")

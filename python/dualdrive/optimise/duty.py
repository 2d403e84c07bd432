"""A duty cycle for a machine of which nothing more is said."""

from __future__ import annotations

from dualdrive.machine import Machine
from dualdrive.motion import Motion, cycle, default_motion

__all__ = ["duty_cycle"]


def duty_cycle(machine: Machine) -> Motion:
    """There and back by the machine's usual move, with time to settle after each.

    Both senses are in it, and both reversals: a machine that stands on one flank would not show its
    play in a single move.
    """
    usual = default_motion(machine).arguments
    return cycle(
        [usual["distance"], 0.0],
        usual["v"],
        usual["a"],
        usual["j"],
        dwell=usual["settle"],
        start=usual["start"],
    )

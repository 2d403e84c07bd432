"""Two runs of one machine side by side: every switch, then the states between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from core_machines import Array
from dualdrive import _core

Switch = tuple[float, str, str, str]  # time, element, mode before, mode after
TIE = 1e-9  # s: neighbours nearer than that may stand in any order, which is counted
WINDOW = 16  # switches that may lie within a tie


@dataclass
class Agreement:
    """How far two lists of switches are the same."""

    count: int  # switches that agree one to one: element, modes, order
    until: float  # s; the first switch that only one of them has; infinite if there is none
    apart: float  # s, the largest distance of two times
    ties: int  # neighbours in another order
    tie: float  # s, the largest distance of such neighbours


def align(mine: Sequence[Switch], theirs: Sequence[Switch]) -> Agreement:
    """Go through two logs up to the first switch that only one of them has."""
    found = Agreement(0, np.inf, 0.0, 0, 0.0)
    ahead: list[Switch] = []  # of theirs, from here on
    taken = 0
    for switch in mine:
        ahead += theirs[taken : taken + WINDOW - len(ahead)]
        taken = min(len(theirs), found.count + WINDOW)
        at = partner(switch, ahead)
        if at is None:
            found.until = min([switch[0]] + [other[0] for other in ahead[:1]])
            return found
        if at > 0:
            found.ties += 1
            found.tie = max(found.tie, ahead[at][0] - ahead[0][0])
        found.count += 1
        found.apart = max(found.apart, abs(ahead.pop(at)[0] - switch[0]))
    if len(theirs) > len(mine):
        found.until = theirs[len(mine)][0]
    return found


def lasting(switches: Sequence[Switch]) -> list[Switch]:
    """Return a log in which no mode is left at the instant it began: 1-2, 2-3 is 1-3."""
    log: list[Switch] = []
    for t, element, before, after in switches:
        last = next((k for k in range(len(log) - 1, max(-1, len(log) - WINDOW), -1)
                     if log[k][1] == element), None)  # fmt: skip
        if last is not None and t - log[last][0] <= TIE and log[last][3] == before:
            start = log[last]
            del log[last]
            if start[2] != after:
                log.append((start[0], element, start[2], after))
        else:
            log.append((t, element, before, after))
    return log


def without_riding(switches: Sequence[Switch]) -> list[Switch]:
    """Return a log in which a drive that rides its limit is one that stands on it."""
    plain = [
        (t, e, a.removeprefix("riding "), b.removeprefix("riding ")) for t, e, a, b in switches
    ]
    return [switch for switch in plain if switch[2] != switch[3]]


def partner(switch: Switch, ahead: Sequence[Switch]) -> int | None:
    """Return which of the next switches is this one: the next, or one that ties with the next."""
    for k, other in enumerate(ahead):
        if k > 0 and other[0] - ahead[0][0] > TIE:
            return None
        if other[1:] == switch[1:]:
            return k
    return None


def continuous(names: Sequence[str]) -> list[int]:
    """Return the signals that no switch makes jump: angles, speeds, twists and currents."""
    return [
        k for k, name in enumerate(names)
        if name.startswith(("theta_", "omega_", "I_")) or name.endswith(".twist")
        if not name.endswith("_ref")
    ]  # fmt: skip


def states_apart(mine: _core.Trajectory, theirs: _core.Trajectory, until: float) -> float:
    """Return the largest difference of a continuous signal before a time, over its own peak.

    `theirs` may be recorded at more times: every n-th of them is one of `mine`.
    """
    every = round((mine.t[1] - mine.t[0]) / (theirs.t[1] - theirs.t[0]))
    signals = continuous(mine.names)
    a, b = mine.values[:, signals], theirs.values[::every, signals]
    rows = min(len(a), len(b))
    keep = np.flatnonzero(mine.t[:rows] < until)
    peak: Array = np.abs(a).max(axis=0, initial=0.0)
    apart = np.abs(a[keep] - b[keep]).max(axis=0, initial=0.0)
    return float((apart / np.where(peak > 0, peak, 1.0)).max(initial=0.0))


def dwell(switches: Sequence[Switch], until: float) -> float:
    """Return how long the modes of the element last that switches at `until`, s."""
    at = next((s for s in switches if s[0] >= until), None)
    if at is None:
        return float("inf")
    times = [s[0] for s in switches if s[1] == at[1]]
    k = times.index(at[0])
    near = [times[k + j] - at[0] for j in (-1, 1) if 0 <= k + j < len(times)]
    return min((abs(x) for x in near), default=float("inf"))

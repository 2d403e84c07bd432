"""Which flanks a run of two drives goes through, from its located switches."""

from __future__ import annotations

from itertools import groupby

from dualdrive.run import Run

__all__ = ["flank_pairs", "flanks_since"]

_SIDE = {"front": 1, "gap": 0, "back": -1}


def flank_pairs(run: Run) -> list[tuple[float, tuple[int, int]]]:
    """When each pair of flanks (mesh 1, mesh 2) begins: 1 front, 0 in the gap, -1 back."""
    first = [int(run.mode(f"mesh_{n}")[0]) for n in (1, 2)]
    now = [(side > 0) - (side < 0) for side in first]
    pairs = [(float(run.t[0]), (now[0], now[1]))]
    switches = (e for e in run.events if e.element in ("mesh_1", "mesh_2"))
    for t, together in groupby(switches, key=lambda e: e.t):
        for event in together:
            now[int(event.element[-1]) - 1] = _SIDE[event.to.split()[0]]
        if pairs[-1][1] != (now[0], now[1]):
            pairs.append((t, (now[0], now[1])))
    return pairs


def flanks_since(run: Run, t: float) -> list[tuple[int, int]]:
    """The pairs of flanks from a time on, the one that begins it first."""
    pairs = flank_pairs(run)
    before = [pair for begin, pair in pairs if begin <= t]
    return [*before[-1:], *(pair for begin, pair in pairs if begin > t)]

"""Looking before memory is asked for: what a computation would need, and what there is."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

__all__ = ["excess", "free", "in_words", "room"]

#: A result is read, copied and drawn besides being there, and others use the machine too.
_SHARE: Final = 0.5


def free() -> float:
    """Bytes that this process can still get: of the machine, its control group and its limits.

    Infinite where the system doesn't say.
    """
    return max(0.0, min(_of_machine(), _of_control_group(), _of_limits()))


def room() -> float:
    """Bytes that one computation may take."""
    return _SHARE * free()


def excess(needed: float) -> str:
    """Say by how much `needed` bytes are more than may be taken; empty where they fit."""
    there = free()
    if needed <= _SHARE * there:  # as in `room`
        return ""
    return f"takes about {in_words(needed)} of memory, and {in_words(there)} are free"


def in_words(size: float) -> str:
    """A number of bytes as people say it: ``18.8 GB``."""
    for factor, unit in ((1e12, "TB"), (1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if size >= factor:
            return f"{size / factor:.3g} {unit}"
    return f"{size:.0f} B"


def _of_machine() -> float:
    for line in _lines("/proc/meminfo"):
        if line.startswith("MemAvailable:"):
            return 1024.0 * int(line.split()[1])
    return float("inf")


def _of_control_group() -> float:
    """What a container or batch system has left for all its processes together."""
    try:
        limit, used = (
            float(_lines(f"/sys/fs/cgroup/memory.{name}")[0]) for name in ("max", "current")
        )
    except (IndexError, ValueError):  # no such group, or its limit is "max"
        return float("inf")
    return limit - used


def _of_limits() -> float:
    """What `ulimit -v` leaves."""
    if sys.platform == "win32":
        return float("inf")
    import resource

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    pages = _lines("/proc/self/statm")
    if limit == resource.RLIM_INFINITY or not pages:
        return float("inf")
    return limit - float(int(pages[0].split()[0]) * resource.getpagesize())


def _lines(path: str) -> list[str]:
    try:
        return Path(path).read_text("ascii").splitlines()
    except OSError:
        return []

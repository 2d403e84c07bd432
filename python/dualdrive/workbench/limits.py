"""What the workbench takes at most, and why: the one table of its hand-set numbers."""

from __future__ import annotations

from typing import Final

__all__ = [
    "BLOCK",
    "GRACE",
    "MOST_BODY",
    "MOST_EVENTS",
    "MOST_FILES",
    "MOST_JOBS",
    "MOST_KEYS",
    "MOST_MACHINE",
    "MOST_NAME",
    "MOST_STRETCHES",
    "MOST_UPLOAD",
    "MOST_WIDTH",
    "WORKER_MEMORY",
]

#: bytes of an uploaded recording: ten channels of 10^7 samples in HDF5, with room
MOST_UPLOAD: Final = 1_000_000_000
#: bytes of an uploaded machine file or mapping; a long one has some 10^4
MOST_MACHINE: Final = 1_000_000
#: bytes of any other request: a mapping with a few hundred columns
MOST_BODY: Final = 1_000_000
#: characters of a file's name: what every file system takes, with an ending added
MOST_NAME: Final = 120
#: recordings in a project
MOST_FILES: Final = 64
#: results kept in a project; the oldest that nothing rests on go first
MOST_JOBS: Final = 200
#: series in one answer: ten panels of a few models
MOST_KEYS: Final = 120
#: pixels of a plot: an 8k projector, overscanned twice
MOST_WIDTH: Final = 16_384
#: samples of one block of the coarse copy of a long series
BLOCK: Final = 64
#: lines of progress kept of a job
MOST_EVENTS: Final = 2_000
#: intervals of one condition that are shaded; more are finer than a pixel
MOST_STRETCHES: Final = 400
#: s between asking a computation to stop and ending it: with the signal's way it stays below 1 s
GRACE: Final = 0.4
#: bytes a computation may ask the system for, beyond which it is refused and not the computer ill
WORKER_MEMORY: Final = 6_000_000_000

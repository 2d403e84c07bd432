"""A disk without room, played by the system's limit on the size of a file."""

from __future__ import annotations

import os
import resource
from collections.abc import Callable


def full_disk(limit: int) -> Callable[[], None]:
    """Return what a child process does first: no file of its can grow beyond this many bytes."""

    def begin() -> None:
        # A module imported under the limit would leave half of its bytecode behind, for everybody.
        os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    return begin

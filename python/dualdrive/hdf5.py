"""Reading HDF5 files that come from anywhere: damaged, huge, or leading out of themselves.

A file can name other files as the place of its data (external links, external storage, virtual
datasets). Such a reference would make any file of the computer a channel, so it is refused.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dualdrive.files import FileError

if TYPE_CHECKING:
    import h5py

__all__ = ["datasets", "numbers_to_read", "reading"]


@contextmanager
def reading(path: Path, called: str = "") -> Iterator[h5py.File]:
    """Open a file for reading. Whatever the library says of it, then and later, comes as one line.

    called:  its name in errors, the path unless given

    Raises FileError naming file, rule and way out; errors of our own pass through.
    """
    import h5py

    called = called or str(path)
    try:
        with h5py.File(path, "r") as file:
            for name, item in _objects(file):
                _refuse_foreign(called, name, item)
            yield file
    except FileNotFoundError:
        raise FileError(f"{called}: there is no such file; check its name") from None
    except PermissionError:
        raise FileError(f"{called}: no permission to read it; check its rights") from None
    except Exception as error:  # damage makes the library raise nearly anything
        if type(error).__module__.startswith("dualdrive"):
            raise
        reason = " ".join(str(error.args[-1] if error.args else error).split())
        rule = f"not a readable HDF5 file, or a damaged one ({reason})"
        raise FileError(f"{called}: {rule}; export or compute it again") from None


def datasets(group: Any) -> dict[str, Any]:
    """Every dataset in and below a group by its path from there; None for a link into nothing."""
    import h5py

    found = {}
    for name, item in _objects(group):
        if isinstance(item, h5py.SoftLink):
            item = group.get(name)
        if item is None or isinstance(item, h5py.Dataset):
            found[name] = item
    return found


def numbers_to_read(item: Any) -> int:
    """How many numbers reading a dataset unpacks; a chunk is unpacked whole."""
    return max(item.size or 0, math.prod(item.chunks or (0,)))


def _objects(group: Any) -> Iterator[tuple[str, Any]]:
    """(path, object) of all groups and datasets, once each, and of links that are not hard."""
    import h5py

    seen = {h5py.h5o.get_info(group.id).addr}
    waiting = deque([("", group)])
    while waiting:
        above, group = waiting.popleft()
        for name in group:
            path, link = above + name, group.get(name, getlink=True)
            item = group[name] if isinstance(link, h5py.HardLink) else link
            if isinstance(item, h5py.Group):
                place = h5py.h5o.get_info(item.id).addr
                if place in seen:
                    continue
                seen.add(place)
                waiting.append((f"{path}/", item))
            yield path, item


def _refuse_foreign(called: str, name: str, item: Any) -> None:
    import h5py

    where = ""
    if isinstance(item, h5py.ExternalLink):
        where = item.filename
    elif isinstance(item, h5py.Dataset):
        if item.external:
            where = str(item.external[0][0])
        elif item.is_virtual:
            others = {source.file_name for source in item.virtual_sources()} - {"."}
            where = min(others, default="")
    if where:
        rule = f"{name} lies in another file ({where}), which is not followed"
        raise FileError(f"{called}: {rule}; store the data themselves")

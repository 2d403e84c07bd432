"""MAT files: version 5 through SciPy, version 7.3 (which is HDF5) through h5py."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any, Final

import numpy as np

from dualdrive.hdf5 import datasets, numbers_to_read

from .arrays import refuse_excess, table_of
from .hdf5_trace import opened
from .log import Recorder
from .mapping import FileLayout
from .mat_elements import MatError, check_elements
from .table import Table

__all__ = ["read_mat"]

_HEADER: Final = 128  # bytes of text before the first variable of version 5
_COMPRESSED: Final = 15  # the type of a packed variable
_ENOUGH: Final = 4096  # packed bytes that surely hold the first few unpacked ones


def read_mat(path: Path, wanted: FileLayout, recorder: Recorder) -> Table:
    """Read the arrays of a MAT file; structures give dotted names (``run.speed``).

    The one variable named by ``[file] group`` is used alone where the mapping states one.
    """
    with path.open("rb") as file:
        version = 7 if file.read(512)[:10] == b"MATLAB 7.3" else 5
    found = _version_7(path, recorder) if version == 7 else _version_5(path, recorder)
    if wanted.group:
        prefix = wanted.group + "."
        inside = {n.removeprefix(prefix): v for n, v in found.items() if n.startswith(prefix)}
        if not inside and wanted.group not in found:
            known = ", ".join(sorted({name.split(".")[0] for name in found}))
            raise recorder.error("file", f"no variable {wanted.group!r}", f"the file has: {known}")
        found = inside or {wanted.group: found[wanted.group]}
    names = {"5": "mat", "7": "mat 7.3"}
    layout = {"format": names[str(version)], "group": wanted.group}
    return table_of(found, recorder, layout=layout, ignore=wanted.ignore)


def _version_5(path: Path, recorder: Recorder) -> dict[str, Any]:
    from scipy.io import loadmat

    refuse_excess(_unpacked(path) // np.dtype(np.float64).itemsize, recorder)
    try:
        check_elements(path)
        variables = loadmat(path, simplify_cells=True)
    except Exception as error:  # a damaged file makes the library raise nearly anything
        what = f": {error}" if isinstance(error, MatError) else ""  # others speak of their insides
        raise recorder.error("file", f"not a readable MAT file{what}", "export again") from None
    return _flat({n: v for n, v in variables.items() if not n.startswith("__")})


def _unpacked(path: Path) -> int:
    """Bytes of all variables once they are unpacked; a compressed one begins with its size."""
    total = 0
    with path.open("rb") as file:
        mark = file.read(_HEADER)[-2:]
        if mark not in (b"IM", b"MI"):
            return 0  # version 4, which is never packed
        tags = struct.Struct("<II" if mark == b"IM" else ">II")
        while len(tag := file.read(tags.size)) == tags.size:
            kind, size = tags.unpack(tag)
            following = file.tell() + size
            if kind == _COMPRESSED:
                size = _size_inside(file.read(min(size, _ENOUGH)), tags)
            total += size
            file.seek(following)
    return total


def _size_inside(packed: bytes, tags: struct.Struct) -> int:
    try:
        begin = zlib.decompressobj().decompress(packed, tags.size)
    except zlib.error:  # the library says so when it reads
        return 0
    return int(tags.unpack(begin)[1]) if len(begin) == tags.size else 0


def _flat(variables: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Structures as dotted names."""
    flat: dict[str, Any] = {}
    for name, value in variables.items():
        if isinstance(value, dict):
            flat |= _flat(value, f"{prefix}{name}.")
        else:
            flat[prefix + name] = value
    return flat


def _version_7(path: Path, recorder: Recorder) -> dict[str, Any]:
    with opened(path) as file:
        found = {name: item for name, item in datasets(file).items() if not name.startswith("#")}
        refuse_excess(sum(map(numbers_to_read, filter(None, found.values()))), recorder)
        # MATLAB stores by columns, HDF5 by rows
        return {
            name.replace("/", "."): None if item is None else np.asarray(item[()]).T
            for name, item in found.items()
        }

"""MAT files: version 5 through SciPy, version 7.3 (which is HDF5) through h5py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from .arrays import table_of
from .log import Recorder
from .mapping import FileLayout
from .table import Table

__all__ = ["read_mat"]


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
    return table_of(found, recorder, layout={"format": names[str(version)], "group": wanted.group})


def _version_5(path: Path, recorder: Recorder) -> dict[str, Any]:
    from scipy.io import loadmat

    try:
        variables = loadmat(path, simplify_cells=True)
    except Exception as error:  # a damaged file makes the library raise nearly anything
        raise recorder.error("file", f"not a readable MAT file: {error}", "export again") from None
    return _flat({n: v for n, v in variables.items() if not n.startswith("__")})


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
    import h5py

    found: dict[str, Any] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and not name.startswith("#"):
            # MATLAB stores by columns, HDF5 by rows
            found[name.replace("/", ".")] = np.asarray(item[()]).T

    try:
        with h5py.File(path, "r") as file:
            file.visititems(visit)
    except OSError as error:
        raise recorder.error("file", f"not a readable MAT file: {error}", "export again") from None
    return found

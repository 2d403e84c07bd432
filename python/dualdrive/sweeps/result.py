"""A sweep as it lies in its file: axes, figures, what failed."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from dualdrive.ensembles import PENDING
from dualdrive.machine import Machine
from dualdrive.units import human

from .grid_file import attributes_of, axes_of

if TYPE_CHECKING:
    from tempfile import TemporaryDirectory

    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["Sweep", "load_sweep"]


def load_sweep(path: str | Path) -> Sweep:
    """Open the file of a sweep, finished or not. Raises FileError when it is none."""
    return Sweep(Path(path))


class Sweep:
    """A grid of figures in a file; data are read when they are asked for.

    path:        the HDF5 file
    attributes:  machine, motion, command, versions, tolerances: what the figures come from
    """

    def __init__(self, path: Path, _folder: TemporaryDirectory[str] | None = None) -> None:
        self.path = path
        self.attributes: dict[str, Any] = attributes_of(path)
        self._folder = _folder  # of a sweep without a name of its own; goes when this object goes

    @cached_property
    def dataset(self) -> xr.Dataset:
        """Axes as coordinates, figures, status, message and kept signals; read lazily.

        The file stays open until `close`.
        """
        import xarray as xr

        return xr.open_dataset(self.path, engine="h5netcdf")

    @cached_property
    def axes(self) -> dict[str, NDArray[np.float64]]:
        """Parameter path -> its values in SI."""
        return axes_of(self.path)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values on each axis."""
        return tuple(len(values) for values in self.axes.values())

    @property
    def figures(self) -> list[str]:
        """Names of the figures, in the order they are shown."""
        names: list[str] = json.loads(self.attributes["figures"])
        return names

    @property
    def machine(self) -> Machine:
        """The machine before any axis changed it."""
        return Machine.from_toml(self.attributes["machine"], str(self.path))

    @property
    def pending(self) -> int:
        """How many runs are still to be done."""
        return int((self.dataset["status"].values == PENDING).sum())

    @property
    def failed(self) -> list[tuple[dict[str, float], str, str]]:
        """Runs that failed: (axis values, status, message)."""
        status = self.dataset["status"].values
        numbers = np.flatnonzero((status != "success") & (status != PENDING))
        messages = self.dataset["message"].values
        return [(self.point(int(k)), str(status.flat[k]), str(messages.flat[k])) for k in numbers]

    def unit(self, name: str) -> str:
        """The SI unit of an axis, figure or kept signal."""
        return str(self.dataset[name].attrs["unit"])

    def words(self, path: str, value: float) -> str:
        """A value of an axis as people write it; values of one size all in one unit."""
        unit, sizes = self.unit(path), np.abs(self.axes[path])
        shown = human(float(sizes.max()), unit).partition(" ")[2]
        decades = sizes.max() > 1e4 * sizes[sizes > 0].min(initial=np.inf)
        return human(value, unit, prefer=None if decades or not shown else shown)

    def point(self, run: int) -> dict[str, float]:
        """The axis values of a run by its number; the last axis counts fastest."""
        index = np.unravel_index(run, self.shape)
        return {p: float(v[i]) for (p, v), i in zip(self.axes.items(), index, strict=True)}

    def range(self, figure: str) -> tuple[int, int] | None:
        """Numbers of the runs in which a figure is lowest and highest; None if no run has it."""
        values = self.dataset[figure].values
        if not np.isfinite(values).any():
            return None
        return int(np.nanargmin(values)), int(np.nanargmax(values))

    def to_dict(self) -> dict[str, Any]:
        """Axes, figures and one entry per run, fit for JSON: what is not a number is None."""
        data = self.dataset
        names = [*self.figures, "status", "message"]
        columns = {name: data[name].values.ravel().tolist() for name in names}
        return {
            "file": str(self.path),
            "machine": self.attributes["machine_name"],
            "motion": self.attributes["motion"],
            "axes": {
                path: {"unit": self.unit(path), "values": values.tolist()}
                for path, values in self.axes.items()
            },
            "figures": {
                name: {key: data[name].attrs[key] for key in ("unit", "long_name")}
                for name in self.figures
            },
            "runs": [
                self.point(run) | {name: _plain(columns[name][run]) for name in names}
                for run in range(data["status"].size)
            ],
        }

    def to_pandas(self) -> pd.DataFrame:
        """One row per run, indexed by the axes: figures, status, message."""
        return self.dataset[[*self.figures, "status", "message"]].to_dataframe()

    def plot(self, figures: str | Sequence[str] | None = None) -> Figure:
        """Lines over one axis, a map over two; see dualdrive.plots.sweep_figures."""
        from dualdrive.plots.sweep_figures import sweep_figures

        return sweep_figures(self, figures)

    def close(self) -> None:
        """Close the file; what was read stays."""
        if "dataset" in self.__dict__:
            self.dataset.close()
            del self.__dict__["dataset"]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        axes = ", ".join(f"{path}: {len(values)}" for path, values in self.axes.items())
        missing = f", {self.pending} runs pending" if self.pending else ""
        return f"<Sweep {self.path}: {axes}{missing}>"

    def _repr_html_(self) -> str:
        return f"<p>{escape(repr(self))}</p>{self.dataset._repr_html_()}"


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value

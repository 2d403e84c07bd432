"""A finished run: signals over time, events, modes, sensitivities, and how they were computed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualdrive.machine import Machine
from dualdrive.motion import Motion
from dualdrive.units import human

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["Event", "Run", "RunError", "load_run"]

Floats = NDArray[np.float64]


class RunError(ValueError):
    """A run was asked for what it can't give; the message says what and why."""


class Event(NamedTuple):
    """A located switch: element, and the modes before and after."""

    t: float
    element: str
    from_: str
    to: str


def load_run(path: str | Path) -> Run:
    """Read a run that `Run.save` wrote. Raises FileError naming file, rule and way out."""
    from dualdrive.store import read_fields

    return Run(**read_fields(Path(path)))


@dataclass(eq=False, repr=False)
class Run:
    """What a simulation leaves; arrays are views of what the core computed, SI, read-only.

    t:              output times in s, shape (n,)
    values:         signals, shape (n, signals), columns as in `names`
    modes:          of every switching element, int8, shape (n, elements)
    sensitivities:  d signal / d parameter, shape (n, signals, parameters), or empty
    work:           energy put in since the start by each path of work_names, J, (n, paths)
    status:         success, or what stopped the integration; `message` says what to try
    motion:         what was commanded, or None
    gradient_parameters: what `gradient` derives by; empty unless asked for
    """

    t: Floats
    values: Floats
    names: tuple[str, ...]
    units: Mapping[str, str]
    long_names: Mapping[str, str]
    elements: tuple[str, ...]
    modes: NDArray[np.int8]
    events: tuple[Event, ...]
    parameters: tuple[str, ...]
    sensitivities: Floats
    work: Floats
    work_names: tuple[str, ...]
    final_state: Mapping[str, float]
    status: str
    message: str
    statistics: Mapping[str, Any]
    machine: Machine
    motion: Motion | None = None
    gradient_parameters: tuple[str, ...] = ()
    _pull_back: Callable[[Floats], Floats] | None = field(default=None)
    _columns: dict[str, int] = field(init=False)

    def __post_init__(self) -> None:
        self.events = tuple(Event(*event) for event in self.events)
        self._columns = {name: k for k, name in enumerate(self.names)}
        for array in (self.t, self.values, self.modes, self.sensitivities, self.work):
            array.flags.writeable = False

    @classmethod
    def of(cls, trajectory: Any, machine: Machine, motion: Motion | None) -> Self:
        """Wrap what the core returned, without copying its arrays."""
        names = tuple(trajectory.names)
        units = (machine.unit_of(n, u) for n, u in zip(names, trajectory.units, strict=True))
        return cls(
            t=trajectory.t,
            values=trajectory.values,
            names=names,
            units=dict(zip(names, units, strict=True)),
            long_names=dict(zip(names, trajectory.long_names, strict=True)),
            elements=tuple(trajectory.elements),
            modes=trajectory.modes,
            events=tuple(trajectory.events),
            parameters=tuple(trajectory.parameters),
            sensitivities=trajectory.sensitivities,
            work=trajectory.work,
            work_names=tuple(trajectory.work_names),
            final_state=dict(
                zip(trajectory.state_names, trajectory.final_state.tolist(), strict=True)
            ),
            status=trajectory.status,
            message=trajectory.message,
            statistics=dict(trajectory.statistics),
            machine=machine,
            motion=motion,
            gradient_parameters=tuple(trajectory.gradient_parameters),
            _pull_back=trajectory.pull_back,
        )

    # --- reading ----------------------------------------------------------------------------------

    @property
    def ok(self) -> bool:
        """Whether the integration reached its end."""
        return self.status == "success"

    def __getitem__(self, name: str) -> Floats:
        """The signal of this name, shape (n,). Raises KeyError naming near ones."""
        return self.values[:, self._column(name)]

    def __contains__(self, name: object) -> bool:
        return name in self._columns

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def _column(self, name: str) -> int:
        if name in self._columns:
            return self._columns[name]
        near = get_close_matches(name, self.names, 3)
        hint = (
            f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(self.names)}"
        )
        raise KeyError(f"signal {name!r}: not recorded; {hint}")

    def mode(self, element: str) -> NDArray[np.int8]:
        """The mode of a switching element over time, shape (n,). Raises KeyError."""
        if element not in self.elements:
            raise KeyError(f"element {element!r}: unknown; there are {', '.join(self.elements)}")
        return self.modes[:, self.elements.index(element)]

    def sensitivity(self, signal: str, parameter: str) -> Floats:
        """Derivative of a signal by a parameter over time, shape (n,).

        Raises KeyError where the signal wasn't recorded or the parameter not asked for.
        """
        if parameter not in self.parameters:
            known = ", ".join(self.parameters) or "none"
            raise KeyError(f"sensitivity to {parameter!r}: not computed; asked for were {known}")
        return self.sensitivities[:, self._column(signal), self.parameters.index(parameter)]

    def gradient(self, slopes: ArrayLike | Mapping[str, ArrayLike]) -> Floats:
        """Derivatives of a cost of this run by `gradient_parameters`, shape (parameters,).

        slopes:  d cost / d value, as `values`, or the columns of it that aren't 0 by signal

        One walk backwards over the run (the discrete adjoint), whatever the number of parameters.
        Raises KeyError for an unknown signal, RunError (a ValueError) for a wrong shape, a number
        that isn't finite, or a run that was made without `gradient`, failed or has travelled.
        """
        seeds = np.zeros(self.values.shape)
        if isinstance(slopes, Mapping):
            for name, column in slopes.items():
                seeds[:, self._column(name)] = column
        else:
            seeds = np.ascontiguousarray(slopes, float)
        if not np.isfinite(seeds).all():
            raise RunError("gradient: the cost's derivatives are not all finite")
        if self._pull_back is None:
            raise RunError("gradient: a run that was loaded or copied has lost the way back")
        try:
            return self._pull_back(seeds)
        except ValueError as error:
            raise RunError(str(error)) from None

    # --- tables -----------------------------------------------------------------------------------

    def to_pandas(self) -> pd.DataFrame:
        """One row per output time (index t), one column per signal; attrs hold the units."""
        import pandas as pd

        frame = pd.DataFrame(
            self.values, columns=list(self.names), index=pd.Index(self.t, name="t")
        )
        frame.attrs = {"units": dict(self.units), "long_names": dict(self.long_names)}
        return frame

    def to_xarray(self) -> xr.Dataset:
        """One variable per signal over t, each with attributes units and long_name."""
        import xarray as xr

        time = xr.Variable("t", self.t, {"units": "s", "long_name": "time"})
        variables = {
            name: xr.Variable(
                "t", self[name], {"units": self.units[name], "long_name": self.long_names[name]}
            )
            for name in self.names
        }
        return xr.Dataset(
            variables,
            coords={"t": time},
            attrs={"machine": self.machine.name, "status": self.status, "motion": self._words},
        )

    def events_frame(self) -> pd.DataFrame:
        """The event log, one row per switch: t (s), element, from, to."""
        import pandas as pd

        return pd.DataFrame(list(self.events), columns=["t", "element", "from", "to"])

    def save(self, path: str | Path, *, overwrite: bool = False, command: str = "") -> None:
        """Write the run as HDF5, whole or not at all. `command` is kept with it.

        Raises FileError where the file is there already (unless `overwrite`) or can't be written.
        """
        from dualdrive.store import write_run

        write_run(self, Path(path), overwrite=overwrite, command=command)

    # --- words ------------------------------------------------------------------------------------

    def plot(self, *, window: tuple[float, float] | None = None) -> Figure:
        """Motion, error, torques and flanks on one page; see dualdrive.plots.overview."""
        import dualdrive  # its lazy name: the plots themselves know what a run is

        return dualdrive.plots.overview(self, window=window)

    @property
    def _words(self) -> str:
        return self.motion.text if self.motion else ""

    def summary(self) -> dict[str, str]:
        """The run in a few words: what, how long, how it went."""
        seconds = human(float(self.t[-1]), "s") if self.t.size else "nothing"
        lines = {
            "machine": self.machine.name,
            "motion": self._words or "none",
            "time": f"{seconds} in {self.t.size} samples",
            "status": self.status,
            "events": str(len(self.events)),
            "steps": f"{self.statistics['steps']} ({self.statistics['method']})",
        }
        if "energy_error" in self.statistics:
            lines["energy error"] = f"{self.statistics['energy_error']:.1e} of the energy moved"
        if self.message:
            lines["message"] = self.message
        return lines

    def __repr__(self) -> str:
        return f"<Run of {self.machine.name}: {self.summary()['time']}, {self.status}>"

    def _repr_html_(self) -> str:
        from html import escape

        rows = "".join(
            f"<tr><th style='text-align:left'>{escape(key)}</th><td>{escape(value)}</td></tr>"
            for key, value in self.summary().items()
        )
        signals = ", ".join(escape(name) for name in self.names)
        return (
            f"<table>{rows}</table>"
            f"<details><summary>{len(self.names)} signals</summary>{signals}</details>"
        )

    def __getstate__(self) -> dict[str, Any]:
        """Plain copies: what the core owns doesn't travel."""
        state = {**self.__dict__, "_pull_back": None}
        return {k: np.array(v) if isinstance(v, np.ndarray) else v for k, v in state.items()}

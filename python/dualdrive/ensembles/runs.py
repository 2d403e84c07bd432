"""The runs of an ensemble as they finish, and what is kept of all of them."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from types import TracebackType
from typing import TYPE_CHECKING, Final, Self

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.figures import Figure, Reduction, declared
from dualdrive.machine import Machine

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["PENDING", "SPEED", "Ensemble", "Outcome", "cores"]

Floats = NDArray[np.float64]

PENDING: Final = "pending"
REFUSED: Final = "refused"

#: the one figure that is measured, not computed: it differs from computer to computer
SPEED: Final = Figure("speed", "", "simulated seconds per second of computing, this run alone")


def cores() -> int:
    """The number of cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True)
class Outcome:
    """What one run leaves: its number, figures, status, kept signals.

    figures: and measures, by name; NaN unless the run succeeded
    status:  success, refused (such a machine cannot be) or what stopped the integration; `message`
             says what to try
    signals: name -> values at the output times, NaN from where the run failed; no copies. None
             where none are kept or the run was refused
    """

    run: int
    figures: Mapping[str, float]
    status: str
    message: str = ""
    signals: Mapping[str, Floats] | None = None


class Ensemble:
    """Runs under way, and the figures of those that are finished.

    Iterate for an `Outcome` per run, as they finish: each is handed over once, and an iteration
    that was left, by Ctrl-C too, goes on where it stopped. Figures of all runs stay here, kept
    signals with who took them or in `dataset`.

    machine:    as it is before values change it
    parameters: path -> SI values, shape (runs,)
    t:          output times in s, shape (times,)
    """

    def __init__(
        self,
        core: _core.Ensemble,
        machine: Machine,
        parameters: Mapping[str, Floats],
        t: Floats,
        keep: Sequence[str],
        measures: Mapping[str, Reduction],
        summed_up: Sequence[str],
        count: int,
    ) -> None:
        self.machine, self.parameters, self.t = machine, dict(parameters), t
        self._core, self._keep, self._measures = core, tuple(keep), dict(measures)
        self._finished: list[_core.EnsembleRun] = []  # not yet handed over
        self._names = [f.name for f in declared(machine)] + list(measures)
        self._columns = _columns(machine, summed_up, self._names)
        self._seconds = -len(_core.Ensemble.tallies) + _core.Ensemble.tallies.index("seconds")
        self._figures = np.full((count, len(self._names) + 1), np.nan)
        self._status = [PENDING] * count
        self._message = [""] * count
        self._signals: Floats | None = None

    def __len__(self) -> int:
        return len(self._status)

    @property
    def pending(self) -> int:
        """How many runs were not handed over yet."""
        return self._status.count(PENDING)

    @property
    def names(self) -> list[str]:
        """Names of figures and measures, the measured speed last."""
        return [*self._names, SPEED.name]

    # --- handing over -----------------------------------------------------------------------------

    def __iter__(self) -> Iterator[Outcome]:
        while self._more():
            while self._finished:
                outcome = self._outcome(self._finished[0])
                try:
                    yield outcome
                finally:  # not before: what an interrupt kept from being handed over is still there
                    del self._finished[0]

    def batches(self) -> Iterator[list[Outcome]]:
        """Yield runs in lists as they finish; an empty one now and then, to look about.

        Runs begin ahead of those taken, within bounds: for as many as are not taken, others wait.
        """
        while self._more():
            batch = [self._outcome(run) for run in self._finished]
            try:
                yield batch
            finally:
                del self._finished[: len(batch)]

    def _more(self) -> bool:
        """Whether runs are to come, after having waited for some."""
        if not self._finished:
            if self._core.done:
                return False
            self._core.take(self._finished)
        return True

    def stop(self) -> None:
        """Begin no more runs; those under way are finished and handed over."""
        self._core.stop()

    def close(self) -> None:
        """Cut runs under way short; what is finished can still be taken."""
        self._core.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _: type[BaseException] | None, __: BaseException | None, ___: TracebackType | None
    ) -> None:
        self.close()

    def _outcome(self, run: _core.EnsembleRun) -> Outcome:
        k, numbers = run.number, run.numbers
        row = self._figures[k]
        row[:-1] = numbers[self._columns]
        row[-1] = (self.t[-1] - self.t[0]) / numbers[self._seconds]
        self._status[k], self._message[k] = run.status, run.message
        figures = dict(zip(self.names, row.tolist(), strict=True))
        kept = None
        if self._keep and run.status != REFUSED:
            block = run.signals(len(self._keep))
            kept = {name: block[k] for k, name in enumerate(self._keep)}
        return Outcome(k, figures, run.status, run.message, kept)

    # --- all together -----------------------------------------------------------------------------

    def dataset(self) -> xr.Dataset:
        """Take what is left and return all runs: figures, status, kept signals, over `run`.

        Parameters are coordinates along `run`; kept signals have dimensions (run, t), without a
        copy. After Ctrl-C, calling it again goes on. Raises ValueError where signals were kept and
        runs were taken one by one: whoever took them has those signals.
        """
        self._collect()
        import xarray as xr

        described = {f.name: f for f in (*declared(self.machine), *self._described(), SPEED)}
        variables = {
            name: xr.Variable(
                "run",
                self._figures[:, k],
                {"units": described[name].unit, "long_name": described[name].long_name},
            )
            for k, name in enumerate(self.names)
        }
        for name, values in (("status", self._status), ("message", self._message)):
            variables[name] = xr.Variable("run", np.array(values, dtype=str))
        if self._signals is not None:
            known = {name: (unit, text) for name, unit, text in self.machine.core.signals()}
            for k, name in enumerate(self._keep):
                unit, text = known.get(name, ("", name))
                about = {"units": self.machine.unit_of(name, unit), "long_name": text}
                variables[name] = xr.Variable(("run", "t"), self._signals[:, k], about)
        return xr.Dataset(variables, self._coordinates(), {"machine": self.machine.name})

    def _collect(self) -> None:
        if self._keep and self._signals is None:
            if self.pending < len(self):
                raise ValueError("signals of runs taken before are with who took them; keep none")
            self._signals = np.full((len(self), len(self._keep), len(self.t)), np.nan)
        for batch in self.batches():
            for outcome in batch:
                for k, values in enumerate((outcome.signals or {}).values()):
                    assert self._signals is not None
                    self._signals[outcome.run, k] = values

    def _coordinates(self) -> dict[str, xr.Variable]:
        import xarray as xr

        found = {
            "run": xr.Variable("run", np.arange(len(self)), {"long_name": "number of the run"})
        }
        for path, values in self.parameters.items():
            about = {}
            if not path.startswith("initial."):
                parameter = self.machine.parameter(path)
                about = {"units": parameter.unit, "long_name": parameter.doc}
            found[path] = xr.Variable("run", values, about)
        if self._keep:
            found["t"] = xr.Variable("t", self.t, {"units": "s", "long_name": "time"})
        return found

    def _described(self) -> Iterator[Figure]:
        known = {name: (unit, text) for name, unit, text in self.machine.core.signals()}
        for name, (signal, measure, begin, end) in self._measures.items():
            unit, text = known.get(signal, ("", signal))
            window = "" if begin == -end == -np.inf else f" from {begin:g} s to {end:g} s"
            yield Figure(name, self.machine.unit_of(signal, unit), f"{measure} of {text}{window}")

    def _repr_html_(self) -> str:
        return f"<p>{escape(repr(self))}</p>"  # its dataset would wait for what is pending

    def __repr__(self) -> str:
        paths = ", ".join(self.parameters) or "nothing"
        left = f", {self.pending} pending" if self.pending else ""
        return f"<Ensemble of {len(self)} runs of {self.machine.name} over {paths}{left}>"


def _columns(machine: Machine, summed_up: Sequence[str], names: Sequence[str]) -> list[int]:
    """Where each figure stands among the numbers of a run, as the core lays them out."""
    reversals = [f"{connection}.reversals" for connection in machine.core.connections]
    found = [*summed_up, *reversals, *_core.Ensemble.tallies]
    return [found.index(name) for name in names]

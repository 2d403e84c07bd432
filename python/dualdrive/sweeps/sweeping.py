"""Run a sweep on all cores, into a file that any kill leaves whole."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dualdrive.distributed import SchedulerError
from dualdrive.ensembles import Outcome
from dualdrive.files import FileError, refuse_existing
from dualdrive.interrupt import interrupt
from dualdrive.machine import DEFAULT, Machine

from .executors import Executor, executor_for
from .grid import GridError, lay_out
from .grid_file import GridFile, attributes_of, axes_of, refuse_filled
from .layout import lay_file
from .plan import Plan
from .result import Sweep

if TYPE_CHECKING:
    from distributed import Client
    from numpy.typing import ArrayLike

    from dualdrive.motion import Motion

__all__ = ["Progress", "resume", "sweep"]

#: called with the numbers of runs done and of all, and the outcomes that just came in
Progress = Callable[[int, int, list[Outcome]], None]


def sweep(
    machine: Machine | str | Path = DEFAULT,
    axes: Mapping[str, str | ArrayLike] | None = None,
    *,
    motion: Motion | str | None = None,
    load: float = 0.0,
    end: float | None = None,
    output_step: float = 1e-3,
    engine: str = "auto",
    rtol: float = 1e-10,
    method: str = "auto",
    max_steps: int | None = None,
    energy: bool = True,
    jobs: int | None = None,
    scheduler: str | Client | None = None,
    output: str | Path | None = None,
    resume: bool = False,
    overwrite: bool = False,
    keep: Iterable[str] = (),
    progress: Progress | None = None,
    command: str = "dualdrive.sweep",
) -> Sweep:
    """Run the same motion on every machine of a grid; return the grid of figures.

    axes:      parameter path or tie group -> values: numbers in SI, texts with units, or one text
               ``start:stop:count`` (ends included) or ``a,b,c``; several axes make a grid
    motion:    what the table is commanded to do; the default motion without one
    load:      constant torque on the table that opposes positive motion, N·m (N)
    engine, rtol, method: as of `simulate`
    max_steps: integration steps after which a run counts as failed
    energy:    keep the balance of energy, without which there is no energy_error
    jobs:      threads; all cores without it. Results do not depend on it
    scheduler: address of a Dask scheduler (``tcp://HOST:8786``) or a connected distributed.Client,
               whose workers compute in place of this process; they must have the same build
    output:    HDF5 file; without one the grid lives as long as the returned object
    resume:    complete a file that a killed or interrupted sweep of the same things left
    keep:      signals to store whole, beside the figures

    A run that fails carries its status and message and stops no other. After Ctrl-C the runs under
    way are finished and written, then KeyboardInterrupt is raised.

    Raises GridError (axes), MachineError (machine), FileError (file there already, of something
    else, disk refuses), SchedulerError (scheduler or workers lost; the file keeps what was
    finished), each one line naming the way out.
    """
    plan = _plan(
        machine,
        axes or {},
        motion,
        end,
        tuple(keep),
        load=load,
        output_step=output_step,
        engine=engine,
        rtol=rtol,
        method=method,
        max_steps=max_steps,
        energy=energy,
    )
    folder = None
    if output is None:
        folder = tempfile.TemporaryDirectory(prefix="dualdrive-")
        output = Path(folder.name) / "sweep.h5"
    path = Path(output)
    with (
        executor_for(jobs, scheduler) as executor,
        _open(path, plan, resume=resume, overwrite=overwrite, command=command) as file,
    ):
        try:
            _work(plan, file, executor, progress)
        except SchedulerError as lost:
            rest = "what was finished is kept, --resume (resume=True) completes it"
            raise lost if folder else SchedulerError(f"{lost}; {path}: {rest}") from None
    return Sweep(path, folder)


def resume(
    path: str | Path,
    *,
    jobs: int | None = None,
    scheduler: str | Client | None = None,
    progress: Progress | None = None,
) -> Sweep:
    """Complete the sweep that a file holds, with the machine, axes and motion stored there.

    Raises FileError when it is no sweep, GridError when the motion cannot be read from its text:
    then call `sweep` with the motion and ``resume=True``.
    """
    path = Path(path)
    found = attributes_of(path)
    if str(found["motion"]).startswith("sampled"):
        way_out = "give the whole command again with --resume, in Python sweep(..., resume=True)"
        raise GridError(f"{path}: its motion was sampled, and is not in it; {way_out}")
    return sweep(
        Machine.from_toml(found["machine"], str(path)),
        axes_of(path),
        motion=str(found["motion"]),
        load=float(found["load"]),
        end=float(found["end"]),
        output_step=float(found["output_step"]),
        engine=str(found.get("engine", "auto")),
        rtol=float(found["rtol"]),
        method=str(found["method"]),
        max_steps=int(found["max_steps"]) or None,
        energy=bool(found.get("energy", True)),
        keep=json.loads(found["keep"]),
        jobs=jobs,
        scheduler=scheduler,
        output=path,
        resume=True,
        progress=progress,
    )


def _plan(
    machine: Machine | str | Path,
    axes: Mapping[str, str | ArrayLike],
    motion: Motion | str | None,
    end: float | None,
    keep: tuple[str, ...],
    **options: Any,
) -> Plan:
    from dualdrive.motion import default_motion, parse_motion

    if not isinstance(machine, Machine):
        machine = Machine.load(machine)
    grid = lay_out(machine, axes)
    if isinstance(motion, str):
        motion = parse_motion(motion, axis=machine.axis)
    elif motion is None:
        motion = default_motion(machine)
    if keep == ("all",):
        keep = tuple(name for name, _, _ in machine.core.signals())
    end = motion.end if end is None else end
    return Plan(machine, motion, grid, end=end, keep=keep, **options)


def _open(path: Path, plan: Plan, *, resume: bool, overwrite: bool, command: str) -> GridFile:
    """The file to write to: the one to go on with, or a new one."""
    if resume and path.exists():
        differences = plan.differences(attributes_of(path), axes_of(path))
        if differences:
            more = f" (and {len(differences) - 1} more)" if len(differences) > 1 else ""
            raise FileError(
                f"{path}: is a sweep of something else: {differences[0]}{more}; "
                "give the same again, or another file with -o"
            )
    else:
        refuse_existing(path, overwrite=overwrite)
        if path.exists():
            refuse_filled(path)
        attributes = plan.attributes(command)
        lay_file(path, plan.grid, plan.figures, attributes, plan.kept, overwrite=overwrite)
    return GridFile(path)


def _work(plan: Plan, file: GridFile, executor: Executor, progress: Progress | None) -> None:
    pending = file.pending()
    done = plan.grid.size - len(pending)
    if progress is not None:
        progress(done, plan.grid.size, [])
    with interrupt() as stop:
        for outcomes in executor.outcomes(plan, pending, stop):
            file.write(outcomes)
            done += len(outcomes)
            if progress is not None:
                progress(done, plan.grid.size, outcomes)
        if stop.is_set() and done < plan.grid.size:
            raise KeyboardInterrupt

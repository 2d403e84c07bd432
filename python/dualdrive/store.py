"""Results on disk: the one writer of HDF5 files for runs.

A file holds one group ``run``: a dataset per signal with attributes unit and long_name, the time as
their dimension scale, so that any HDF5 tool and xarray open it; modes, events, sensitivities and
work beside them. Root attributes: schema, package version, machine file, command, statistics.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.files import FileError, refuse_existing, write_atomically
from dualdrive.hdf5 import datasets, numbers_to_read, reading
from dualdrive.machine import Machine
from dualdrive.memory import excess
from dualdrive.motion import Motion, parse_motion, sampled

if TYPE_CHECKING:
    import h5py

__all__ = [
    "SCHEMA",
    "fields_of",
    "read_fields",
    "root_attributes",
    "write_column",
    "write_into",
    "write_run",
]

SCHEMA: Final = "dualdrive result 1"
_SLASH: Final = "\N{DIVISION SLASH}"  # HDF5 would take a plain one for a group


# --- writing --------------------------------------------------------------------------------------


def write_run(run: Any, path: Path, *, overwrite: bool = False, command: str = "") -> None:
    """Write a dualdrive.Run, whole or not at all. Raises WriteError naming file and way out.

    The file is composed in memory: HDF5 itself does not fail in one piece when a disk is full.
    """
    import h5py

    refuse_existing(path, overwrite=overwrite)
    image = BytesIO()
    with h5py.File(image, "w") as file:
        root_attributes(file, machine=run.machine, command=command)
        write_into(file.create_group("run"), run)
    with write_atomically(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(image.getbuffer())


def root_attributes(file: h5py.File, *, machine: Machine, command: str) -> None:
    """What every result file says of itself."""
    file.attrs["schema"] = SCHEMA
    file.attrs["version"] = _core.__version__
    file.attrs["machine"] = machine.toml()
    file.attrs["machine_name"] = machine.name
    file.attrs["command"] = command


def write_column(
    group: h5py.Group, name: str, values: Any, unit: str, long_name: str, scale: Any = None
) -> Any:
    """Write one dataset with its unit and long name, along a dimension scale if one is given."""
    item = group.create_dataset(name.replace("/", _SLASH), data=values)
    item.attrs["unit"] = unit
    item.attrs["units"] = unit  # the word that xarray knows
    item.attrs["long_name"] = long_name
    if scale is not None:
        item.dims[0].attach_scale(scale)
    return item


def write_into(group: h5py.Group, run: Any) -> None:
    """Write a dualdrive.Run into an empty group."""
    time = write_column(group, "t", run.t, "s", "time")
    time.make_scale("t")
    for name in run.names:
        write_column(group, name, run[name], run.units[name], run.long_names[name], time)
    _write_tables(group, run, time)
    _write_events(group.create_group("events"), run)
    _write_motion(group, run.motion)
    group.attrs["signals"] = json.dumps(run.names)
    group.attrs["status"] = run.status
    group.attrs["message"] = run.message
    group.attrs["statistics"] = json.dumps(dict(run.statistics))
    group.attrs["final_state"] = json.dumps(dict(run.final_state))


def _write_tables(group: h5py.Group, run: Any, time: Any) -> None:
    """What has more than one dimension; each one labelled."""
    element = _labels(group, "element", run.elements, "switching elements")
    item = write_column(group, "modes", run.modes, "", "modes of the switching elements", time)
    item.dims[1].attach_scale(element)
    if run.work.size:
        path = _labels(group, "path", run.work_names, "paths by which energy goes in")
        item = write_column(group, "work", run.work, "J", "energy put in since the start", time)
        item.dims[1].attach_scale(path)
    if run.parameters:
        text = "derivative of a signal by a parameter, both in SI"
        item = write_column(group, "sensitivities", run.sensitivities, "", text, time)
        item.dims[1].attach_scale(_labels(group, "signal", run.names, "signals"))
        item.dims[2].attach_scale(_labels(group, "parameter", run.parameters, "parameters"))


def _labels(group: h5py.Group, name: str, labels: Sequence[str], long_name: str) -> Any:
    import h5py

    values = np.array(labels, dtype=h5py.string_dtype())
    item = write_column(group, name, values, "", long_name)
    item.make_scale(name)
    return item


def _write_events(group: h5py.Group, run: Any) -> None:
    import h5py

    times = np.array([event[0] for event in run.events], dtype=float)
    scale = write_column(group, "t", times, "s", "time of the switch")
    scale.make_scale("t")
    columns = (("element", "what switched"), ("from", "mode before"), ("to", "mode after"))
    for k, (name, long_name) in enumerate(columns, 1):
        words = np.array([event[k] for event in run.events], dtype=h5py.string_dtype())
        write_column(group, name, words, "", long_name, scale)


def _write_motion(group: h5py.Group, motion: Motion | None) -> None:
    group.attrs["motion"] = motion.text if motion else ""
    if motion is not None and motion.kind == "sampled":
        points = group.create_group("motion")
        points.attrs["interpolation"] = motion.arguments["interpolation"]
        time = write_column(points, "t", motion.arguments["t"], "s", "time")
        time.make_scale("t")
        values = motion.arguments["values"]
        write_column(points, "theta_ref", values, "rad", "commanded angle", time)


# --- reading --------------------------------------------------------------------------------------


def read_fields(path: Path) -> dict[str, Any]:
    """Read what makes a dualdrive.Run. Raises FileError naming file, rule and way out."""
    with reading(path) as file:
        if file.attrs.get("schema") != SCHEMA or "run" not in file:
            rule = f"holds no run of the form {SCHEMA!r}"
            raise FileError(f"{path}: {rule}; name a file that 'dualdrive simulate' wrote")
        numbers = sum(map(numbers_to_read, filter(None, datasets(file["run"]).values())))
        if too_much := excess(np.dtype(np.float64).itemsize * float(numbers)):
            raise FileError(f"{path}: reading it {too_much}; simulate with a larger output step")
        machine = Machine.from_toml(file.attrs["machine"], f"{path}: machine")
        return fields_of(file["run"], machine)


def fields_of(group: h5py.Group, machine: Machine) -> dict[str, Any]:
    """Read the fields of a run from its group."""
    names = tuple(json.loads(group.attrs["signals"]))
    columns = {name: group[name.replace("/", _SLASH)] for name in names}
    values = np.empty((group["t"].shape[0], len(names)))
    for k, item in enumerate(columns.values()):
        values[:, k] = item[()]
    return {
        "t": group["t"][()],
        "values": values,
        "names": names,
        "units": {name: item.attrs["unit"] for name, item in columns.items()},
        "long_names": {name: item.attrs["long_name"] for name, item in columns.items()},
        "elements": _words(group, "element"),
        "modes": group["modes"][()],
        "events": tuple(_events(group["events"])),
        "parameters": _words(group, "parameter"),
        "sensitivities": _table(group, "sensitivities", (0, len(names), 0)),
        "work": _table(group, "work", (0, 0)),
        "work_names": _words(group, "path"),
        "final_state": json.loads(group.attrs["final_state"]),
        "status": group.attrs["status"],
        "message": group.attrs["message"],
        "statistics": json.loads(group.attrs["statistics"]),
        "machine": machine,
        "motion": _read_motion(group, machine),
    }


def _words(group: h5py.Group, name: str) -> tuple[str, ...]:
    return tuple(group[name].asstr()[()].tolist()) if name in group else ()


def _table(group: h5py.Group, name: str, empty: tuple[int, ...]) -> NDArray[np.float64]:
    return np.asarray(group[name][()]) if name in group else np.empty(empty)


def _events(group: h5py.Group) -> Iterator[tuple[float, str, str, str]]:
    words = (_words(group, name) for name in ("element", "from", "to"))
    return zip(group["t"][()].tolist(), *words, strict=True)


def _read_motion(group: h5py.Group, machine: Machine) -> Motion | None:
    text = group.attrs["motion"]
    if "motion" in group:
        points = group["motion"]
        kind = points.attrs["interpolation"]
        return sampled(points["t"][()], points["theta_ref"][()], kind)
    return parse_motion(text, axis=machine.axis) if text else None

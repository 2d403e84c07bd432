"""Results on disk: the one writer of HDF5 files for runs.

A file holds one group ``run``: a dataset per signal with attributes unit and long_name, the time as
their dimension scale, so that any HDF5 tool and xarray open it; modes, events, sensitivities and
work beside them. Root attributes: schema, package version, machine file, command, statistics.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dualdrive import _core
from dualdrive.files import FileError, refuse_existing, write_atomically
from dualdrive.machine import Machine
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
_PARTS: Final = ("t", "modes", "events", "sensitivities", "work", "motion")


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
    with write_atomically(path) as temporary:
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
    modes = write_column(group, "modes", run.modes, "", "modes of the switching elements", time)
    modes.attrs["elements"] = json.dumps(run.elements)
    _write_events(group, run)
    if run.work.size:
        work = write_column(group, "work", run.work, "J", "energy put in since the start", time)
        work.attrs["paths"] = json.dumps(run.work_names)
    if run.parameters:
        item = write_column(
            group, "sensitivities", run.sensitivities, "", "d signal / d parameter", time
        )
        item.attrs["parameters"] = json.dumps(run.parameters)
    _write_motion(group, run.motion)
    group.attrs["signals"] = json.dumps(run.names)
    group.attrs["status"] = run.status
    group.attrs["message"] = run.message
    group.attrs["statistics"] = json.dumps(dict(run.statistics))
    group.attrs["final_state"] = json.dumps(dict(run.final_state))


def _write_events(group: h5py.Group, run: Any) -> None:
    import h5py

    text = h5py.string_dtype()
    kind = np.dtype([("t", "f8"), ("element", text), ("from", text), ("to", text)])
    rows = np.array([tuple(event) for event in run.events], dtype=kind)
    item = group.create_dataset("events", data=rows)
    item.attrs["unit"] = "s"
    item.attrs["long_name"] = "located switches: time, element, mode before and after"


def _write_motion(group: h5py.Group, motion: Motion | None) -> None:
    group.attrs["motion"] = motion.text if motion else ""
    if motion is not None and motion.kind == "sampled":
        points = np.column_stack([motion.arguments["t"], motion.arguments["values"]])
        item = write_column(group, "motion", points, "s, rad", "commanded motion: time and angle")
        item.attrs["interpolation"] = motion.arguments["interpolation"]


# --- reading --------------------------------------------------------------------------------------


def read_fields(path: Path) -> dict[str, Any]:
    """Read what makes a dualdrive.Run. Raises FileError naming file, rule and way out."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            if file.attrs.get("schema") != SCHEMA or "run" not in file:
                rule = f"holds no run of the form {SCHEMA!r}"
                raise FileError(f"{path}: {rule}; name a file that 'dualdrive simulate' wrote")
            machine = Machine.from_toml(file.attrs["machine"], f"{path}: machine")
            return fields_of(file["run"], machine)
    except FileNotFoundError:
        raise FileError(f"{path}: no such file; name a result file") from None
    except OSError as error:
        reason = str(error).splitlines()[0]
        raise FileError(f"{path}: cannot be read as HDF5: {reason}") from None


def fields_of(group: h5py.Group, machine: Machine) -> dict[str, Any]:
    """Read the fields of a run from its group."""
    names = tuple(json.loads(group.attrs["signals"]))
    columns = {name: group[name.replace("/", _SLASH)] for name in names}
    values = np.empty((group["t"].shape[0], len(names)))
    for k, item in enumerate(columns.values()):
        values[:, k] = item[()]
    none = np.empty((0, len(names), 0))
    extra = {part: group[part] for part in ("work", "sensitivities") if part in group}
    return {
        "t": group["t"][()],
        "values": values,
        "names": names,
        "units": {name: item.attrs["unit"] for name, item in columns.items()},
        "long_names": {name: item.attrs["long_name"] for name, item in columns.items()},
        "elements": tuple(json.loads(group["modes"].attrs["elements"])),
        "modes": group["modes"][()],
        "events": tuple(_event(row) for row in group["events"][()]),
        "parameters": _list(extra, "sensitivities", "parameters"),
        "sensitivities": extra["sensitivities"][()] if "sensitivities" in extra else none,
        "work": extra["work"][()] if "work" in extra else np.empty((0, 0)),
        "work_names": _list(extra, "work", "paths"),
        "final_state": json.loads(group.attrs["final_state"]),
        "status": group.attrs["status"],
        "message": group.attrs["message"],
        "statistics": json.loads(group.attrs["statistics"]),
        "machine": machine,
        "motion": _read_motion(group, machine),
    }


def _list(items: Mapping[str, Any], part: str, attribute: str) -> tuple[str, ...]:
    return tuple(json.loads(items[part].attrs[attribute])) if part in items else ()


def _event(row: Any) -> tuple[Any, ...]:
    t, *words = row
    return (float(t), *(w.decode() if isinstance(w, bytes) else w for w in words))


def _read_motion(group: h5py.Group, machine: Machine) -> Motion | None:
    text = group.attrs["motion"]
    if "motion" in group:
        item = group["motion"]
        points = item[()]
        return sampled(points[:, 0], points[:, 1], item.attrs["interpolation"])
    return parse_motion(text, axis=machine.axis) if text else None

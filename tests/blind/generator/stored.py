"""What is handed out of a case: machine file, records with units, how the drive was set."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np
from tests.blind.generator.cases import Case
from tests.blind.generator.engine import Array

_SI = {"t": "s", "theta": "rad", "omega": "rad/s", "I": "A", "T": "N*m"}
#: what some recorders write instead: channel or kind -> unit and how many of it one SI unit is
_OTHER = {
    "t": ("ms", 1e3),
    "theta_m": ("arcsec", 180 * 3600 / np.pi),
    "theta_ref": ("arcsec", 180 * 3600 / np.pi),
    "theta": ("deg", 180 / np.pi),
}


def write(case: Case, folder: Path) -> None:
    """machine.toml, case.json and one file per record, in a new folder."""
    folder.mkdir(parents=True)
    (folder / "machine.toml").write_text(case.machine)
    files: dict[str, str] = {}
    for plan in case.plans:
        columns = case.recorded[plan.name]
        if case.form == "hdf5":
            files[plan.name] = f"{plan.name}.h5"
            _hdf5(folder / files[plan.name], columns)
        else:
            files[plan.name] = f"{plan.name}.csv"
            _csv(folder / files[plan.name], columns, other=case.form == "csv in other units")
    settings = {files[p.name]: {"controller.T_ten": p.T_ten} for p in case.plans}
    known: dict[str, object] = {"machine": "machine.toml", "records": list(files.values())}
    if "[controller]" in case.machine and "T_ten" in case.machine:
        known["settings"] = settings
    (folder / "case.json").write_text(json.dumps(known, indent=1) + "\n")


def _csv(path: Path, columns: Mapping[str, Array], other: bool) -> None:
    units = {name: _unit(name, other) for name in columns}
    header = ",".join(f"{name} [{unit}]" for name, (unit, _) in units.items())
    table = np.stack([columns[name] * size for name, (_, size) in units.items()], axis=1)
    np.savetxt(path, table, fmt="%.10g", delimiter=",", header=header, comments="")


def _unit(name: str, other: bool) -> tuple[str, float]:
    kind = name.split("_")[0]
    if other:
        return _OTHER.get(name) or _OTHER.get(kind) or (_SI[kind], 1.0)
    return _SI[kind], 1.0


def _hdf5(path: Path, columns: Mapping[str, Array]) -> None:
    with h5py.File(path, "w") as file:
        for name, values in columns.items():
            made = file.create_dataset(name, data=values)
            made.attrs["unit"] = _SI[name.split("_")[0]]

"""python -m tests.blind truth DIR [--only develop-0000]

The machine of every case as it truly is, hidden law included, simulated by dualdrive against the
records: what is left of each channel, over the noise of its sensor. About 1, and less where a zero
drifts little; more is a fault of the replay (how a command is read between its samples, how a
record begins) that no search could mend. A loop that was switched on seconds before its record and
had not settled shows in the angles of records that begin `settled`.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dualdrive import Machine
from dualdrive.compare import evened
from dualdrive.replay import core_of, records
from dualdrive.replay.record import with_settings
from dualdrive.replay.run import play
from dualdrive.traces import read

#: real numbers of a case whose names are not those of the product
_NAMES = {
    "mesh_damping": "mesh_damping@meshes.coefficient",
    "dry_table": "coulomb@table.torque",
    "dry_pinions": "coulomb@pinions.torque",
}


def main(arguments: Sequence[str]) -> int:
    """Print a line for every record."""
    parser = argparse.ArgumentParser(prog="tests.blind truth", description=main.__doc__)
    parser.add_argument("folder", type=Path, help="as `generate` wrote it")
    parser.add_argument("--only", default="", help="cases whose name holds this")
    told = parser.parse_args(arguments)
    for case in sorted((told.folder / "cases").iterdir()):
        if told.only in case.name:
            truth = json.loads((told.folder / "truth" / f"{case.name}.json").read_text())
            for line in lines(case, truth):
                print(line, flush=True)
    return 0


def lines(case: Path, truth: Mapping[str, Any]) -> list[str]:
    """What the true machine of a case leaves, a line per record."""
    known = json.loads((case / "case.json").read_text())
    hidden = ", ".join(f"{e['effect']}@{e['place']}" for e in truth["effects"]) or "nothing"
    said = f"{case.name} ({hidden})"
    if truth["loop"] != "known":
        return [f"{said}: the loop is unknown"]
    machine = Machine.load(case / known["machine"])
    try:
        make_true(core_of(machine), truth)
    except ValueError as error:
        return [f"{said}: {error}"]
    traces = {Path(name).stem: evened(read(case / name))[0] for name in known["records"]}
    settings = {Path(name).stem: own for name, own in known.get("settings", {}).items()}
    found = [f"{said}"]
    for record in records(machine, traces, settings=settings):
        run = play(with_settings(core_of(machine), record.settings), record)
        left = []
        for channel in record.channels:
            if channel.name in truth["noise"] and run.ok:
                sensor = truth["noise"][channel.name]
                noise = np.hypot(np.hypot(sensor["rms"], sensor["step"] / 12**0.5), sensor["drift"])
                off = np.std(run.simulated[channel.name] - channel.measured)
                left.append(f"{channel.name} {off / noise:.3g}")
        hunts = ", hunts" if truth["records"].get(record.name, {}).get("hunts") else ""
        found.append(f"    {record.name} ({record.start}{hunts}): {', '.join(left) or run.status}")
    return found


def make_true(core: Any, truth: Mapping[str, Any]) -> None:
    """Put the real numbers and what is hidden into a data sheet's machine.

    Raises:
        ValueError: a law that the library does not have.

    """
    for name, value in truth["real"].items():
        core.set(_NAMES.get(name, name), value)
    for hidden in truth["effects"]:
        label = core.add_effect(hidden["effect"], hidden["place"])
        for name, value in hidden["parameters"].items():
            core.set(f"{label}.{name}", value)

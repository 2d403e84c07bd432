"""dualdrive play: the play of a mesh, read from measured traces."""

from __future__ import annotations

from pathlib import Path

import click

from dualdrive.files import write_atomically
from dualdrive.identify import PlayEstimate, estimate_play, with_torques
from dualdrive.machine import Machine
from dualdrive.traces import Trace
from dualdrive.traces.names import DRIVES
from dualdrive_cli._files import MACHINE, PICTURE
from dualdrive_cli._numbers import Real, Whole
from dualdrive_cli._shared import (
    json_option,
    load,
    overwrite_option,
    verb,
    write_json,
)
from dualdrive_cli._traces import map_option, part_option, read_all, traces_argument


@click.command(
    epilog="Example: dualdrive play fit.csv --machine machine.toml --plot play.png",
)
@traces_argument
@map_option
@part_option
@click.option("--drive", type=Whole(1, DRIVES[-1]), help="Mesh of this drive; of each unless told.")
@click.option(
    "--machine",
    type=MACHINE,
    help="Takes ratios and torque constants from it; its play is not looked at.",
)
@click.option("--mesh-ratio", type=Real(), help="Turns of the pinion per turn of the ring.")
@click.option("--gear-ratio", type=Real(), help="Turns of the motor per turn of the pinion.")
@click.option(
    "--load",
    type=Real(0, min_open=True, unit="N*m"),
    metavar="N*m",
    help="Torque from which a flank counts as closed; 0.3 of the largest unless given.",
)
@click.option(
    "--settle",
    type=Real(0, unit="s"),
    default="0.3s",
    show_default=True,
    help="So long the torque must have had one sign.",
)
@click.option("--confidence", type=Real(0.5, 0.9999), default=0.95, show_default=True)
@click.option("--plot", type=PICTURE, help="Draw the loop in the trace and the interval.")
@json_option
@overwrite_option
@verb
def command(
    traces: tuple[Path, ...],
    mapping: Path | None,
    wanted: tuple[str, ...],
    drive: int | None,
    machine: str | None,
    mesh_ratio: float | None,
    gear_ratio: float | None,
    load: float | None,
    settle: float,
    confidence: float,
    plot: Path | None,
    json_to: str | None,
    overwrite: bool,
) -> None:
    """Estimate the play of a mesh from recorded angles and torques, with an interval.

    A drive under load rests on a flank, and drive minus ring on either flank is the play at the
    pinion. Time skew of the two angles and compliance are fitted with it. A drive that was only
    ever loaded one way gives a lower bound.
    """
    m = _machine(machine)
    recorded = read_all(traces, mapping, wanted)
    if m is None:
        _refuse_currents(recorded)
    else:
        recorded = {name: with_torques(m.core, trace) for name, trace in recorded.items()}
    found = [
        estimate_play(
            recorded,
            n,
            mesh_ratio=_ratio(m, f"mesh_{n}", mesh_ratio),
            gear_ratio=_ratio(m, f"gearbox_{n}", gear_ratio),
            load=load,
            settle=settle,
            confidence=confidence,
        )
        for n in ([drive] if drive else _drives(recorded))
    ]
    if plot:
        _draw(found, plot)
    write_json(json_to, {"records": list(recorded), "meshes": [one.figures() for one in found]})
    if json_to != "-":
        for one in found:
            click.echo(one.table())
        if plot:
            click.echo(f"written: {plot}")


def _machine(name: str | None) -> Machine | None:
    return None if name is None else load(name)


def _refuse_currents(recorded: dict[str, Trace]) -> None:
    """Without a machine nobody knows the torque of a current. Raises ValueError."""
    for name, trace in recorded.items():
        current = next((channel for channel in trace if channel.startswith("I_")), None)
        if current and not any(channel.startswith("T_") for channel in trace):
            rule = f"no channel T{current[1:]}, only the current {current}"
            way_out = "--machine machine.toml tells the constant that makes it a torque"
            raise ValueError(f"{name}: {rule}; {way_out}")


def _ratio(machine: Machine | None, connection: str, given: float | None) -> float:
    """As given, else the machine's, else 1."""
    if given is not None:
        return given
    if machine is None or connection not in machine.core.connections:
        return 1.0
    return float(machine.get(f"{connection}.ratio"))


def _drives(recorded: dict[str, Trace]) -> list[int]:
    """Drives whose torque is in every trace; the first, which says what is missing, if none is."""
    return [n for n in DRIVES if all(f"T_{n}" in t for t in recorded.values())] or [1]


def _draw(found: list[PlayEstimate], path: Path) -> None:
    from dualdrive import plots

    with write_atomically(path) as temporary:
        plots.play(*found).savefig(temporary)

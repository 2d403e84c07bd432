"""dualdrive simulate: one run of a machine through a motion."""

from __future__ import annotations

import math
from pathlib import Path

import click
from rich.table import Table

from dualdrive.files import write_atomically
from dualdrive.machine import Machine
from dualdrive.run import Run
from dualdrive.simulation import simulate
from dualdrive.units import human, parse
from dualdrive_cli._files import OUTPUT, PICTURE
from dualdrive_cli._keys import KEY
from dualdrive_cli._motion import MOTION, motion_of
from dualdrive_cli._shared import (
    FAILED,
    analysis,
    command_line,
    console,
    engine_option,
    give_up,
    load,
    method_option,
    pairs,
    rtol_option,
    write_json,
)


@click.command(
    epilog="Example: dualdrive simulate heavy-table-550t --set controller.T_ten=0 "
    "--motion move:0.02,v=0.03,a=0.01,j=0.05,start=2,end=14 -o run.h5",
)
@click.option(
    "--motion",
    type=MOTION,
    help="KIND:FIRST,name=value,... of move, cycle, shuttle, step, sine, multisine; or a file.",
)
@click.option("--end", help="When to stop, s; else the motion says.")
@click.option("--load", "load_torque", help="Constant load on the table, against positive motion.")
@click.option("--initial", multiple=True, metavar="STATE=VALUE", help="Start value of a state.")
@click.option(
    "--sensitivity", "sensitivities", type=KEY, multiple=True, help="Derivatives by a parameter."
)
@click.option("--signal", "signals", multiple=True, help="Record these signals only.")
@click.option(
    "--output-step",
    help="Time between samples; unless given 1ms, in a long run what makes a million of them.",
)
@rtol_option
@engine_option
@method_option
@click.option("-o", "--output", type=OUTPUT, help="Write the run as HDF5.")
@click.option("--plot", type=PICTURE, help="Draw the run into a picture (png, pdf, svg).")
@analysis
def command(
    machine: str,
    motion: str | None,
    settings: tuple[str, ...],
    end: str | None,
    load_torque: str | None,
    initial: tuple[str, ...],
    sensitivities: tuple[str, ...],
    signals: tuple[str, ...],
    output_step: str | None,
    rtol: float,
    engine: str,
    method: str,
    output: Path | None,
    plot: Path | None,
    json_to: str | None,
    overwrite: bool,
) -> None:
    """Simulate a machine; without --motion it makes a move that suits it.

    Motions: move:DISTANCE,v=,a=,j=,start=  cycle:A;B;C,v=,a=,dwell=,repeats=
    shuttle:DISTANCE,speeds=A;B,a=  step:HEIGHT,at=  sine:AMPLITUDE,f=
    multisine:RMS,f=,lines=,seed=,levels=A;B; each takes end=. Numbers may carry units.
    Or a file (csv, h5, mat) with columns t and theta_ref, such as next-experiment.csv.
    Ends with 1 if the integration failed; what was computed is written and says so.
    """
    m = load(machine, settings)
    with console(err=True).status("simulating"):
        run = simulate(
            m,
            motion_of(motion, m),
            end=parse(end, "s", key="--end") if end is not None else None,
            load=_load(m, load_torque),
            initial=_initial(m, initial),
            sensitivities=sensitivities,
            signals=signals,
            output_step=_step(output_step),
            rtol=rtol,
            engine=engine,
            method=method,
        )
    if output:
        run.save(output, overwrite=overwrite, command=command_line())
    if plot:
        _draw(run, plot)
    _report(run, json_to, (output, plot))
    if not run.ok:
        give_up(f"{m.name}: {run.status}: {run.message}", FAILED)


def _load(m: Machine, text: str | None) -> float | None:
    return parse(text, m.unit_of("T_load", "N*m"), key="--load") if text is not None else None


def _initial(m: Machine, given: tuple[str, ...]) -> dict[str, float]:
    units = {name: m.unit_of(name, unit) for name, unit in m.core.states()}
    return {s: parse(value, units.get(s, ""), key=f"--initial {s}") for s, value in pairs(given)}


def _step(text: str | None) -> float | None:
    return parse(text, "s", key="--output-step") if text is not None else None


def _draw(run: Run, path: Path) -> None:
    from dualdrive.plots import overview

    with write_atomically(path) as temporary:
        overview(run).savefig(temporary)


def _report(run: Run, json_to: str | None, written: tuple[Path | None, ...]) -> None:
    known = _figures(run)
    write_json(
        json_to,
        {
            "machine": run.machine.name,
            "motion": run.motion.text if run.motion else None,
            "status": run.status,
            "message": run.message,
            "figures": {name: {"value": v, "unit": unit} for name, (v, unit) in known.items()},
        },
    )
    if json_to == "-":
        return
    table = Table.grid(padding=(0, 2))
    rows = {name.replace("_", " "): human(value, unit) for name, (value, unit) in known.items()}
    for key, text in (rows | run.summary()).items():
        table.add_row(key, text)
    for path in filter(None, written):
        table.add_row("written", str(path))
    console().print(table)


def _figures(run: Run) -> dict[str, tuple[float, str]]:
    """The figures that this run has, with their units; none if their signals weren't recorded."""
    from dualdrive.figures import declared, figures, signals

    if not all(name in run for name in signals(run.machine)):
        return {}
    values = figures(run)
    units = {figure.name: figure.unit for figure in declared(run.machine)}
    return {name: (v, units[name]) for name, v in values.items() if not math.isnan(v)}

"""dualdrive fit: parameters of a machine from measured traces."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from dualdrive.compare import compare
from dualdrive.identify import Fit, FitError, Progress, fit
from dualdrive.machine import Machine
from dualdrive.traces import Trace
from dualdrive_cli._files import MACHINE, OUTPUT, TRACE
from dualdrive_cli._keys import KEY
from dualdrive_cli._numbers import Real, Whole
from dualdrive_cli._shared import (
    FAILED,
    STOPPED,
    command_line,
    console,
    give_up,
    json_option,
    load,
    overwrite_option,
    scheduler_option,
    set_option,
    verb,
    write_json,
)
from dualdrive_cli._traces import (
    map_option,
    part_option,
    read_apart,
    replay_options,
    replaying,
    settings_for,
    tolerance_of,
    tolerance_option,
    traces_argument,
)


@click.command(
    epilog="Example: dualdrive fit machine.toml fit.csv --held-out held_out.csv "
    "--free table.J,meshes.stiffness,coulomb@table.torque -o fitted.toml",
)
@click.argument("machine", type=MACHINE)
@traces_argument
@click.option(
    "--free", type=KEY, multiple=True, metavar="KEY,KEY", help="What to fit, groups welcome."
)
@tolerance_option
@click.option("--held-out", type=TRACE, multiple=True, help="A trace to test on.")
@click.option("--starts", type=Whole(1), default=1, show_default=True)
@scheduler_option
@click.option("--channel", "channels", multiple=True, help="Fit these channels only.")
@click.option("--confidence", type=Real(0.5, 0.9999), default=0.95, show_default=True)
@map_option
@part_option
@set_option
@replaying
@click.option("-o", "--output", type=OUTPUT, help="The fitted machine file.")
@json_option
@overwrite_option
@verb
def command(
    machine: str,
    traces: tuple[Path, ...],
    free: tuple[str, ...],
    tolerances: tuple[str, ...],
    held_out: tuple[Path, ...],
    starts: int,
    scheduler: str | None,
    channels: tuple[str, ...],
    confidence: float,
    mapping: Path | None,
    wanted: tuple[str, ...],
    settings: tuple[str, ...],
    set_for: tuple[str, ...],
    mode: str,
    output: Path | None,
    json_to: str | None,
    overwrite: bool,
    **replay: Any,
) -> None:
    """Fit a machine to measured traces, with intervals, and test it on others.

    Without --free: inertias, viscous friction, stiffness, play, and every number of its effects.
    Ctrl-C keeps the best point once there is one. Ends with 1 if the fit did not converge.
    """
    m = load(machine, settings)
    recorded, unseen = read_apart(traces, held_out, mapping, wanted)
    options = replay_options(m, {**recorded, **unseen}, **replay)
    own = settings_for(m, set_for, [*recorded, *unseen])
    paths = _paths(free, machine)
    with console(err=True).status("fitting") as status:

        def show(now: Progress) -> None:
            status.update(f"fitting: start {now.start}, {now.simulations} simulations")

        try:
            found = fit(
                m,
                recorded,
                paths,
                mode,
                tolerance=tolerance_of(tolerances),
                channels=channels or None,
                starts=starts,
                scheduler=scheduler,
                confidence=confidence,
                progress=show,
                settings={name: own[name] for name in recorded if name in own},
                **options,
            )
            fitted = found.machine if isinstance(found, Fit) else found.model.machine
            known = {name: own[name] for name in unseen if name in own}
            test = compare(fitted, unseen, mode, settings=known, **options) if unseen else None
            floor = None if isinstance(found, Fit) else _floor(fitted, recorded, own, options)
        except FitError as error:
            give_up(f"{m.name}: {error}", FAILED)
    figures = found.figures()
    if test:
        figures["error"]["held_out"] = test.error["headline"]
    if floor is not None:
        figures["error"]["noise_floor"] = floor
    if output:
        _save(fitted, output, ", ".join(recorded), overwrite=overwrite)
    write_json(json_to, figures)
    if json_to != "-":
        click.echo(found.table())
        if floor is not None:
            click.echo(f"noise floor: {floor:.2%}, what the sensors alone leave")
        if test:
            click.echo(f"held out: {test.error['headline']:.2%} on {', '.join(unseen)}")
        if output:
            click.echo(f"written: {output}")
    if isinstance(found, Fit) and not found.ok:
        give_up(
            f"{found.status}: {found.message}", STOPPED if found.status == "interrupted" else FAILED
        )


def _paths(free: tuple[str, ...], machine: str) -> list[str] | None:
    """What --free names; None where it was not given. Raises click.BadParameter where it is empty.

    machine: as it was typed
    """
    paths = [path for text in free for path in map(str.strip, text.split(",")) if path]
    if free and not paths:
        listed = f"'dualdrive machine show {shlex.quote(machine)}' lists what there is"
        raise click.BadParameter(f"--free names nothing; {listed}, and without it fit chooses")
    return paths or None


def _floor(
    machine: Any,
    traces: Mapping[str, Trace],
    settings: Mapping[str, Mapping[str, float]],
    options: Mapping[str, Any],
) -> float | None:
    """What the sensors alone leave of a torque balance, as `compare` and `diagnose` say it."""
    own = {name: settings[name] for name in traces if name in settings}
    floor = compare(machine, traces, "balance", settings=own, **options).error["noise_floor"]
    return floor if math.isfinite(floor) else None


def _save(machine: Machine, path: Path, records: str, *, overwrite: bool) -> None:
    """Write the machine; the line that the fit has put into its history gets the command."""
    before = machine.history
    if before and before[-1]["change"].startswith("fitted to"):
        machine.history = (*before[:-1], {**before[-1], "command": command_line()})
    else:
        machine.note(f"fitted to {records}", command_line())
    machine.save(path, overwrite=overwrite)

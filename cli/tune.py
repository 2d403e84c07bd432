"""dualdrive tune: the commissioning steps of a master and a slave drive, one after the other."""

from __future__ import annotations

import json
from pathlib import Path

import click
from rich.table import Table

from dualdrive.files import write_atomically
from dualdrive.linear import DriveComparison, differ, read_response
from dualdrive.machine import Machine
from dualdrive.tune import (
    Ask,
    DriveTable,
    Step,
    Tuning,
    drive_parameters,
    read_drive_parameters,
    table_csv,
    table_json,
    table_text,
    tune,
)
from dualdrive.units import human
from dualdrive_cli._files import OUTPUT, PICTURE, Reads, Writes, WritesInto
from dualdrive_cli._motion import MOTION, motion_of
from dualdrive_cli._numbers import Real, Whole
from dualdrive_cli._shared import (
    FAILED,
    STOPPED,
    analysis,
    command_line,
    console,
    give_up,
    load,
    write_json,
)

_GOOD = ("tuned", "in part")


def _picture_of(step: int) -> str:
    return f"step-{step}.png"


@click.command(
    epilog="Example: dualdrive tune heavy-table-550t --set controller.T_ten=0 "
    "-o tuned.toml --table drives.csv --plot tuned.png",
)
@click.option(
    "--motion", type=MOTION, help="Test move that every step is judged by; default: one that suits."
)
@click.option(
    "--parameters",
    type=Reads(),
    metavar="FILE",
    help="Drive parameters as read from the control (.toml, .csv, .json): compared, then set.",
)
@click.option(
    "--measured",
    type=Reads(),
    nargs=2,
    metavar="MASTER SLAVE",
    help="Measured responses of both speed loops; step 3 judges them.",
)
@click.option("--tolerance-db", type=Real(0, min_open=True, unit="dB"), default="1dB",
              show_default=True, help="By how much the drives' responses may part.")  # fmt: skip
@click.option("--tolerance-deg", type=Real(0, min_open=True, unit="deg"), default="5deg",
              show_default=True)  # fmt: skip
@click.option("--until", type=Whole(0, 8), default=8, show_default=True,
              help="Last step to do; 0 sets and writes drive parameters alone.")  # fmt: skip
@click.option("--guided", is_flag=True, help="Ask after each step whether to keep it.")
@click.option("-o", "--output", type=OUTPUT, help="Write the tuned machine, with its history.")
@click.option(
    "--table",
    "table_to",
    type=Writes("table", (".txt", ".csv", ".json")),
    help="Write the drive parameters to type in: .txt, .csv or .json.",
)
@click.option("--plot", type=PICTURE, help="Draw the test move before and after.")
@click.option("--pictures", type=WritesInto(lambda _: map(_picture_of, range(9))), metavar="FOLDER",
              help="Draw every step: step-1.png, ...")  # fmt: skip
@analysis
def command(
    machine: str,
    settings: tuple[str, ...],
    motion: str | None,
    parameters: Path | None,
    measured: tuple[Path, Path] | None,
    tolerance_db: float,
    tolerance_deg: float,
    until: int,
    guided: bool,
    output: Path | None,
    table_to: Path | None,
    plot: Path | None,
    pictures: Path | None,
    json_to: str | None,
    overwrite: bool,
) -> None:
    """Tune a master and a slave drive by steps (1) to (8) of the paper's section 3.3.

    Compares the drives' numbers, sets current and speed loop, compares their responses and
    stops where these differ, raises the position gain to the edge of vibration and sets it back,
    sets tension and torque equaliser until the torques are smooth, then feed-forward, acceleration
    and jerk. Exit code 1 where it stops before its end; it says at which step and why.
    """
    m = load(machine, settings)
    test = motion_of(motion, m)
    given = read_drive_parameters(parameters, m) if parameters else None
    seen = _measured(measured, tolerance_db, tolerance_deg)
    quiet = json_to == "-"
    status = None if guided else console(err=True).status("tuning")

    def begin(number: int, title: str) -> None:
        if status is not None:
            status.update(f"({number}) {title}")

    if status is not None:
        status.start()
    try:
        done = tune(
            m,
            test,
            table=given,
            measured=seen,
            tolerance_db=tolerance_db,
            tolerance_deg=tolerance_deg,
            until=until,
            ask=_asking(m) if guided else None,
            begin=begin,
        )
    finally:
        if status is not None:
            status.stop()
    written = _write(done, output, table_to, plot, pictures, overwrite)
    table = drive_parameters(done.machine, done.limits)
    write_json(json_to, {**done.figures(), "drive_parameters": table_json(table)})
    if not quiet:
        _report(done, table, guided, written)
    if done.status not in _GOOD:
        give_up(f"{m.name}: {done.reason}", FAILED)


def _measured(
    paths: tuple[Path, Path] | None, tolerance_db: float, tolerance_deg: float
) -> DriveComparison | None:
    if not paths:
        return None
    master, slave = (read_response(path) for path in paths)
    return differ(master, slave, tolerance_db=tolerance_db, tolerance_deg=tolerance_deg)


# --- guided ---------------------------------------------------------------------------------------


def _asking(machine: Machine) -> Ask:
    """What shows a step and asks; Ctrl-C or the end of the input stops the procedure."""

    def ask(step: Step) -> bool:
        _show(step, machine)
        if not step.changes:
            return True
        try:
            return click.confirm("keep these settings?", default=True, err=True)
        except click.Abort:
            give_up("stopped; nothing was written", STOPPED)

    return ask


# --- out ------------------------------------------------------------------------------------------


def _write(
    done: Tuning,
    output: Path | None,
    table_to: Path | None,
    plot: Path | None,
    pictures: Path | None,
    overwrite: bool,
) -> list[Path]:
    """Machine and table where nothing was refused; pictures whatever came out."""
    from dualdrive import plots

    written = []
    good = done.status in _GOOD
    if good and output is not None:
        machine = done.machine.copy()
        steps = [str(step.number) for step in done.steps if step.status == "done"]
        words = f"tuned by steps {', '.join(steps)}" if steps else "drive parameters set"
        machine.note(words, command_line())
        machine.save(output, overwrite=overwrite)
        written.append(output)
    if good and table_to is not None:
        with write_atomically(table_to) as temporary:
            temporary.write_text(_as_file(done, table_to.suffix), "utf-8")
        written.append(table_to)
    if plot is not None:
        with write_atomically(plot) as temporary:
            plots.tuning(done).savefig(temporary)
        written.append(plot)
    if pictures is not None:
        for step in done.steps:
            if step.panels:
                path = pictures / _picture_of(step.number)
                with write_atomically(path) as temporary:
                    plots.tuning_step(step).savefig(temporary)
        written.append(pictures)
    return written


def _as_file(done: Tuning, kind: str) -> str:
    table = drive_parameters(done.machine, done.limits)
    if kind == ".csv":
        return table_csv(table)
    if kind == ".json":
        return json.dumps(table_json(table), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    return table_text(table) + "\n"


def _report(done: Tuning, table: DriveTable, guided: bool, written: list[Path]) -> None:
    for step in done.steps:  # guided, they were shown as they came; not the one that ended it
        if not guided or step.status in ("refused", "not run"):
            _show(step, done.machine)
    screen = console()
    shown = Table("figure on the test move", "before", "after", box=None, pad_edge=False)
    for row in done.rows():
        shown.add_row(*row)
    screen.print()
    screen.print(shown)
    if done.status in _GOOD:
        click.echo(f"\n{table_text(table)}")
    for path in written:
        click.echo(f"written: {path}")


def _show(step: Step, machine: Machine) -> None:
    """A step in words: what was done, what changed, what it gave."""
    click.echo(f"({step.number}) {step.title}: {step.status}")
    for line in step.done:
        click.echo(f"      {line}")
    for path, (before, after) in step.changes.items():
        unit = machine.parameter(path).unit
        click.echo(f"      {path}: {human(before, unit)} -> {human(after, unit)}")
    if step.changes and step.status == "done":
        names = ("following error, largest", "hunting", "torque ripple 1")
        gave = (f"{n} {step.before.spoken(n)} -> {step.after.spoken(n)}" for n in names)
        click.echo(f"      {'; '.join(gave)}")
    if step.reason:
        click.echo(f"      ends here: {step.reason}")

"""dualdrive demo: the whole story on a shipped trace with a hidden effect."""

from __future__ import annotations

import time
from pathlib import Path

import click
from rich.table import Table

from dualdrive.demo import Story, tell
from dualdrive.files import make_folder, write_atomically
from dualdrive.units import human
from dualdrive_cli._shared import console, json_option, verb, write_json

PICTURES = ("ladder", "refitted", "improved", "where_it_fails")


@click.command(epilog="Example: dualdrive demo -o demo --json demo/figures.json")
@click.option(
    "-o",
    "--output",
    type=Path,
    default=Path("dualdrive-demo"),
    show_default=True,
    help="Folder for pictures and the improved machine file.",
)
@click.option("--no-pictures", is_flag=True, help="Tables only.")
@json_option
@verb
def command(output: Path, no_pictures: bool, json_to: str | None) -> None:
    """Compare a machine with its trace, find the missing effect, add it, watch the error fall.

    A heavy table was recorded; its data sheet is a few per cent off and one effect is missing. The
    record was made by a program of its own, so nothing here knows the answer.
    """
    screen, began = console(), time.monotonic()
    make_folder(output)
    with console(err=True).status("starting") as status:
        story = tell(lambda what: status.update(what))
        if not no_pictures:
            status.update("drawing")
            _draw(story, output)
    machine = output / "improved.toml"
    story.machine.save(machine, overwrite=True)
    write_json(json_to, story.figures())
    if json_to == "-":
        return
    screen.print(_candidates(story))
    screen.print(_ladder(story))
    for line in _words(story):
        screen.print(line)
    kept = [machine.name] if no_pictures else [machine.name, *(f"{p}.png" for p in PICTURES)]
    screen.print(f"\nIn {output}/: {', '.join(kept)}   ({time.monotonic() - began:.0f} s)")


def _candidates(story: Story) -> Table:
    table = Table(title="Which missing effect would help?", title_justify="left")
    for head, side in (
        ("effect", "left"),
        ("explains", "right"),
        ("refitted error", "right"),
        ("held out", "right"),
        ("size found", "left"),
    ):
        table.add_column(head, justify=side)  # type: ignore[arg-type]
    refits = {r.candidate.label: r for r in story.refits}
    for c in story.screening:
        if (r := refits.get(c.label)) is None:
            twin = f"here the same as {c.same_as}" if c.same_as else ""
            table.add_row(c.label, f"{c.explained:.1%}", "", "", twin)
            continue
        first = next(p for p in r.fit.parameters if p.startswith(f"{c.label}."))
        p = r.fit.parameters[first]
        size = f"{human(p.value, p.unit)}  [{human(p.low, p.unit)} .. {human(p.high, p.unit)}]"
        table.add_row(c.label, f"{c.explained:.1%}", f"{r.fitted:.2%}", f"{r.held_out:.2%}", size)
    return table


def _ladder(story: Story) -> Table:
    table = Table(title="Error (RMS residual / RMS signal)", title_justify="left")
    table.add_column("model")
    table.add_column("fitted record", justify="right")
    table.add_column("held-out record", justify="right")
    for step in story.steps:
        table.add_row(step.label, f"{step.fitted:.2%}", f"{step.held_out:.2%}")
    table.add_row("noise floor", "", f"{story.noise_floor:.2%}")
    return table


def _words(story: Story) -> list[str]:
    best = story.refits[0].candidate
    lines = [
        f"Refitting the data sheet alone leaves {story.steps[1].held_out:.1%} on the held-out "
        "record.",
        f"{best.label} is missing: it closes {story.gap_closed:.0%} of the gap to the noise floor.",
    ]
    if story.rivals:
        lines.append(f"This record can't tell it from {', '.join(story.rivals)}.")
    lines.append(
        f"By hand: dualdrive add MACHINE {best.label} -o machine2.toml, then dualdrive fit."
    )
    return lines


def _draw(story: Story, folder: Path) -> None:
    from dualdrive.plots import Step, ladder, measured_vs_model, residuals

    steps = [Step(s.label, s.fitted, s.held_out) for s in story.steps]
    figures = {
        "ladder": ladder(steps, noise_floor=story.noise_floor),
        "refitted": measured_vs_model(story.before),
        "improved": measured_vs_model(story.after),
        "where_it_fails": residuals(story.before),
    }
    for name in PICTURES:
        with write_atomically(folder / f"{name}.png") as temporary:
            figures[name].savefig(temporary)

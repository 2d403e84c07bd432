"""The command `dualdrive`: finds its verbs, loads the one that is asked for."""

from __future__ import annotations

import io
import sys
from difflib import get_close_matches
from importlib import import_module
from pkgutil import iter_modules

import click

import dualdrive
import dualdrive_cli
from dualdrive.echo import shorten
from dualdrive_cli._stop import guard

#: what the verbs are for -> their names, in the order in which they are used
TASKS = {
    "Model a machine": ("machine", "effects", "add", "simulate", "sweep", "bode", "cycles"),
    "Measure": ("map", "compare", "fit", "play", "indexing"),
    "Diagnose": ("demo", "workbench", "diagnose", "improve", "report"),
    "Commission": ("tune", "optimise"),
    "Reproduce the source paper": ("paper",),
}


class Verbs(click.Group):
    """Every module of this package is a verb, and only the one used is imported."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the verbs, sorted."""
        modules = (module.name for module in iter_modules(dualdrive_cli.__path__))
        return sorted(name for name in modules if name != "main" and not name.startswith("_"))

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """The verb of this name, or None."""
        if name not in self.list_commands(ctx):
            return None
        command: click.Command = import_module(f"dualdrive_cli.{name}").command
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The verb that is asked for; one that does not exist is told with the nearest."""
        name = click.utils.make_str(args[0])
        verbs = self.list_commands(ctx)
        if name in verbs or name.startswith("-"):
            return super().resolve_command(ctx, args)
        near = get_close_matches(name, verbs, 3, 0.5)
        hint = f"did you mean {' or '.join(near)}?" if near else "dualdrive --help lists all verbs"
        click.echo(f"dualdrive: {name}: no such verb; {hint}", err=True)
        raise SystemExit(2)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The verbs by task, each with its whole first sentence."""
        for task, names in TASKS.items():
            commands = ((name, self.get_command(ctx, name)) for name in names)
            with formatter.section(task):
                formatter.write_dl([(n, first_sentence(c.help)) for n, c in commands if c])

    def invoke(self, ctx: click.Context) -> object:
        """The verb; what it says of a command line repeats no more of it than a line holds.

        A Ctrl-C that comes while another one is answered ends no differently.
        """
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):  # a name may be any bytes, a terminal old
                stream.reconfigure(errors="backslashreplace")
        try:
            return super().invoke(ctx)
        except click.ClickException as error:
            object.__setattr__(error, "message", shorten(error.message))
            raise
        except KeyboardInterrupt:
            guard.running = False
            click.echo("dualdrive: stopped", err=True)
            raise SystemExit(guard.code) from None


def first_sentence(text: str | None) -> str:
    """Of a help text; the whole of its first paragraph where no sentence ends in it."""
    paragraph = " ".join((text or "").split("\n\n")[0].split())
    return paragraph.split(". ")[0].rstrip(".") + "."


@click.command(cls=Verbs, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(dualdrive.__version__, prog_name="dualdrive")
def main() -> None:
    """Simulate dual-drive machines, compare them with measurements, find what is missing."""


if __name__ == "__main__":  # as python -m dualdrive_cli
    from dualdrive_cli.__main__ import main as run

    run()

"""The command `dualdrive`: finds its verbs, loads the one that is asked for."""

from __future__ import annotations

import io
import sys
from importlib import import_module
from pkgutil import iter_modules

import click

import dualdrive
import dualdrive_cli
from dualdrive.echo import shorten


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

    def invoke(self, ctx: click.Context) -> object:
        """The verb; what it says of a command line repeats no more of it than a line holds."""
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):  # a name may be any bytes, a terminal old
                stream.reconfigure(errors="backslashreplace")
        try:
            return super().invoke(ctx)
        except click.ClickException as error:
            error.message = shorten(error.message)
            raise


@click.command(cls=Verbs, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(dualdrive.__version__, prog_name="dualdrive")
def main() -> None:
    """Simulate dual-drive machines, compare them with measurements, find what is missing."""


if __name__ == "__main__":
    main()

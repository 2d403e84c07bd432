"""Keys of a machine on the command line: the shell completes them."""

from __future__ import annotations

import click
from click.shell_completion import CompletionItem

from dualdrive.machine import DEFAULT, Machine


def keys(ctx: click.Context) -> list[str]:
    """Parameters, groups and choices of the machine that the command line names."""
    from dualdrive import describe

    try:
        m = Machine.load(ctx.params.get("machine") or ctx.params.get("preset") or DEFAULT)
    except ValueError:
        return []
    paths = {p.path for p in (*m.parameters(), *describe.tied(m))}
    return sorted(paths | {f"controller.{choice}" for choice in m.core.controller_options})


class Key(click.ParamType):  # type: ignore[type-arg]  # generic in new click only
    """Text that begins with a key of the machine, or holds several between commas.

    behind:  what stands behind a key, such as "="
    """

    name = "text"

    def __init__(self, behind: str = "") -> None:
        self.behind = behind

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """The keys that begin like the last word."""
        before, comma, begun = incomplete.rpartition(",")
        found = (key for key in keys(ctx) if key.startswith(begun))
        return [CompletionItem(f"{before}{comma}{key}{self.behind}") for key in found]


KEY = Key()
SETTING = Key("=")

"""What was given, as an error repeats it: recognisable, no longer than a line, and told once."""

from __future__ import annotations

import re
import reprlib
from collections.abc import Iterable
from typing import Final

__all__ = ["InputError", "once", "shorten", "shown"]

_LONGEST: Final = 100  # characters of one value; more tells nobody more
_LINE: Final = 1000  # characters of a whole message

_REPR: Final = reprlib.Repr()
_REPR.maxstring = _REPR.maxother = _LONGEST
_REPR.maxlong = 40
_LISTED: Final = 3  # names of those that are alike
_NUMBER: Final = re.compile(r"(?<![\w.])[-+]?\d[\d.]*(?:e[-+]?\d+)?")
_WORD: Final = re.compile(rf"[^\s/]{{{_LONGEST + 1},}}")


class InputError(ValueError):
    """An input that can't be. The message is one line of at most a thousand characters."""

    def __init__(self, message: object = "") -> None:
        super().__init__(shorten(str(message)))


def shown(value: object) -> str:
    """`repr` of a value, the middle left out where it is long."""
    return _REPR.repr(value)


def shorten(message: str) -> str:
    """One line, in which words and the whole are cut where they are long."""
    line = _WORD.sub(lambda word: f"{word[0][:60]}...{word[0][-30:]}", " ".join(message.split()))
    return line if len(line) <= _LINE else f"{line[: _LINE - 300]} ... {line[-290:]}"


def once(lines: Iterable[str], names: Iterable[str]) -> list[str]:
    """Lines that differ in a name at their beginning and in numbers alone, as one.

    The first is kept in full; behind it stand the names of the others.

    Args:
        lines: one sentence each, ``NAME: what is the matter`` where it is about something named.
        names: what lines may begin with; others stay as they are.

    """
    known = sorted(names, key=len, reverse=True)
    kinds: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for line in lines:
        mark = "warning: " if line.startswith("warning: ") else ""
        rest = line.removeprefix(mark)
        name = next((n for n in known if rest.startswith(f"{n}: ")), "")
        own = _NUMBER.sub("#", _without(rest, name)) if name else rest
        kinds.setdefault((mark, own), []).append((name, line))
    return [_joined([line for _, line in kind], [n for n, _ in kind]) for kind in kinds.values()]


def _without(text: str, name: str) -> str:
    return re.sub(rf"(?<!\w){re.escape(name)}(?!\w)", "#", text)


def _joined(lines: list[str], names: list[str]) -> str:
    others = list(dict.fromkeys(names[1:]))
    if not others or not names[0]:
        return lines[0]
    more = len(others) - _LISTED
    listed = ", ".join(others[:_LISTED]) + (f" and {more} more" if more > 0 else "")
    return f"{lines[0].rstrip('.')}. The same, with numbers of their own, in {listed}"

"""What was given, as an error repeats it: recognisable, and no longer than a line."""

from __future__ import annotations

import re
import reprlib
from typing import Final

__all__ = ["shorten", "shown"]

_LONGEST: Final = 100  # characters of one value; more tells nobody more
_LINE: Final = 1000  # characters of a whole message

_REPR: Final = reprlib.Repr()
_REPR.maxstring = _REPR.maxother = _LONGEST
_REPR.maxlong = 40
_WORD: Final = re.compile(rf"[^\s/]{{{_LONGEST + 1},}}")


def shown(value: object) -> str:
    """`repr` of a value, the middle left out where it is long."""
    return _REPR.repr(value)


def shorten(message: str) -> str:
    """One line, in which words and the whole are cut where they are long."""
    line = _WORD.sub(lambda word: f"{word[0][:60]}...{word[0][-30:]}", " ".join(message.split()))
    return line if len(line) <= _LINE else f"{line[: _LINE - 300]} ... {line[-290:]}"

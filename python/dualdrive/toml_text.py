"""TOML as others write it: what the standard library reads, within bounds that it doesn't set."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from typing import Any, Final

from dualdrive.echo import InputError

__all__ = ["TomlError", "parse_toml"]

_DEEPEST: Final = 20  # tables and lists within each other; a machine file has four
_LONG_KEY: Final = re.compile(rf"(?<![\w-])(?:[\w-]++\s*+\.\s*+){{{_DEEPEST + 1}}}")
_INTEGERS: Final = range(-(2**63), 2**63)  # what TOML itself asks a reader to keep exactly


class TomlError(InputError):
    """A text that is no TOML, or more than a file of ours can mean. The message is one line."""


def parse_toml(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text. Raises TomlError: place, rule and way out."""
    if _LONG_KEY.search(text):  # the library's time and memory go with the square of its length
        raise TomlError(f"a key of more than {_DEEPEST} names; write it flatter")
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise TomlError(f"not valid TOML: {error}; correct that line") from None
    except RecursionError:
        raise TomlError(f"nested deeper than {_DEEPEST} levels; write it flatter") from None
    except ValueError:  # Python's own limit, 4300 digits
        raise TomlError("an integer of thousands of digits; write it as 1e20") from None
    for key, value, depth in _items(content):
        if depth > _DEEPEST:
            raise TomlError(f"{key}: nested deeper than {_DEEPEST} levels; write it flatter")
        if isinstance(value, int) and value not in _INTEGERS:
            rule = f"an integer of {len(str(abs(value)))} digits, at most 19 can be meant"
            raise TomlError(f"{key}: {rule}; write it as 1e20")
    return content


def _items(content: dict[str, Any]) -> Iterator[tuple[str, Any, int]]:
    """(dotted key, value, depth) of everything in the tables, without recursion."""
    waiting: list[tuple[str, Any, int]] = [("", content, 0)]
    while waiting:
        key, value, depth = waiting.pop()
        yield key, value, depth
        if depth > _DEEPEST:
            continue
        if isinstance(value, dict):
            inner = ((f"{key}.{name}" if key else name, v) for name, v in value.items())
        elif isinstance(value, list):
            inner = ((f"{key}[{k}]", v) for k, v in enumerate(value))
        else:
            continue
        waiting += [(name, v, depth + 1) for name, v in inner]

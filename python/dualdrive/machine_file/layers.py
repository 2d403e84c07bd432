"""Reading: the text of a machine file and of what it rests on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

from dualdrive.echo import InputError
from dualdrive.files import FileError, read_text
from dualdrive.toml_text import TomlError, parse_toml

__all__ = [
    "DEFAULT",
    "SCHEMA",
    "Layer",
    "MachineError",
    "expect",
    "parse_layer",
    "preset_names",
    "read_layers",
]

SCHEMA: Final = 1
DEFAULT: Final = "heavy-table-100t"


class MachineError(InputError):
    """A machine, file or value that can't be. The message is one line."""


@dataclass(frozen=True)
class Layer:
    """One file's worth of a machine: where it comes from, its text, what the text says."""

    where: str
    text: str
    data: Mapping[str, Any]


def preset_names() -> list[str]:
    """Names of the machines that come with dualdrive, the default first."""
    folder = files("dualdrive") / "presets"
    names = [item.name[:-5] for item in folder.iterdir() if item.name.endswith(".toml")]
    return sorted(names, key=lambda name: (name != DEFAULT, name))


def read_layers(source: str | Path, folder: Path = Path()) -> list[Layer]:
    """Read a file or preset and what it rests on, base first.

    Raises MachineError or FileError: one line naming file, rule and way out.
    """
    layers: list[Layer] = []
    while True:
        where, text = _text(source, folder)
        if any(layer.where == where for layer in layers):
            raise MachineError(f"{where}: base = {str(source)!r}: rests on itself; name another")
        layers.insert(0, parse_layer(where, text))
        if "base" not in layers[0].data:
            return layers
        source, folder = str(layers[0].data["base"]), Path(where).parent


def parse_layer(where: str, text: str) -> Layer:
    """Read TOML text and check what stands at its top. Raises MachineError."""
    try:
        data = parse_toml(text)
    except TomlError as error:
        raise MachineError(f"{where}: {error}") from None
    schema = data.get("schema")
    if schema is None:
        raise MachineError(f"{where}: schema is missing; begin the file with schema = {SCHEMA}")
    if schema != SCHEMA or isinstance(schema, bool):
        rule = f"this version reads schema {SCHEMA}"
        raise MachineError(f"{where}: schema = {schema!r}: {rule}; write the file in that form")
    for key in ("name", "title", "base"):
        expect(data.get(key, ""), str, where, key, "text")
    return Layer(where, text, data)


def _text(source: str | Path, folder: Path) -> tuple[str, str]:
    name = str(source)
    if name in preset_names() and not isinstance(source, Path):
        return name, (files("dualdrive") / "presets" / f"{name}.toml").read_text("utf-8")
    path = folder / name
    try:
        return str(path), read_text(path)
    except FileNotFoundError:
        near = get_close_matches(name, preset_names(), 3, 0.5)
        hint = f"did you mean {' or '.join(near)}?" if near else f"presets: {_some_presets()}"
        raise FileError(f"{path}: no such file, and no preset of that name; {hint}") from None
    except FileError as error:
        raise FileError(f"{error}; name a machine file") from None


def _some_presets() -> str:
    return ", ".join(preset_names())


def expect(value: Any, kind: type, where: str, key: str, rule: str) -> Any:
    """Return the value if it is of this kind; raise MachineError naming the rule if not."""
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise MachineError(f"{where}: {key} = {value!r}: must be {rule}")
    return value

"""Machine files: TOML read in layers, checked, and turned into an assembled core machine.

A file may rest on another one (`base`); layers are applied from the base outward. Within a layer a
group (`[meshes]`) comes before its members (`[mesh_1]`). No list of parameters stands here: what a
key means, its unit and its bounds are the core's declarations.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

from dualdrive import _core
from dualdrive.assembly import GROUPS, TRAINS, Structure, assemble, group_of
from dualdrive.files import FileError
from dualdrive.frames import half_gap_at_pinion, unit_on_axis
from dualdrive.units import UnitError, parse

__all__ = ["DEFAULT", "SCHEMA", "Layer", "MachineError", "build", "preset_names", "read_layers"]

SCHEMA: Final = 1
DEFAULT: Final = "heavy-table-100t"
AXES: Final = ("rotary", "linear")
HEADER: Final = ("schema", "name", "title", "base", "axis", "drive_train", "drives")
_HISTORY_KEYS: Final = ("date", "command", "change")


class MachineError(ValueError):
    """A machine, file or value that can't be. The message is one line."""


@dataclass(frozen=True)
class Layer:
    """One file's worth of a machine: where it comes from, its text, what the text says."""

    where: str
    text: str
    data: Mapping[str, Any]


# --- reading --------------------------------------------------------------------------------------


def preset_names() -> list[str]:
    """Names of the machines that come with dualdrive, the default first."""
    folder = files("dualdrive") / "presets"
    names = [item.name[:-5] for item in folder.iterdir() if item.name.endswith(".toml")]
    return sorted(names, key=lambda name: (name != DEFAULT, name))


def read_layers(source: str | Path) -> list[Layer]:
    """Read a file or preset and what it rests on, base first.

    Raises MachineError or FileError naming file and way out.
    """
    layers: list[Layer] = []
    seen: list[str] = []
    folder = Path()
    while True:
        where, text = _text(source, folder)
        if where in seen:
            raise MachineError(f"{where}: base = {source!r}: rests on itself; name another base")
        seen.append(where)
        layer = parse_layer(where, text)
        layers.insert(0, layer)
        if "base" not in layer.data:
            return layers
        folder = Path(where).parent
        source = _expect(layer.data["base"], str, where, "base", "a preset or a file")


def parse_layer(where: str, text: str) -> Layer:
    """Read TOML text and check what stands at its top."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise MachineError(f"{where}: not valid TOML: {error}; correct that line") from None
    schema = data.get("schema")
    if schema is None:
        raise MachineError(f"{where}: schema is missing; begin the file with schema = {SCHEMA}")
    if schema != SCHEMA or isinstance(schema, bool):
        rule = f"this version reads schema {SCHEMA}"
        raise MachineError(f"{where}: schema = {schema!r}: {rule}; write the file in that form")
    return Layer(where, text, data)


def _text(source: str | Path, folder: Path) -> tuple[str, str]:
    name = str(source)
    if name in preset_names() and not isinstance(source, Path):
        return name, (files("dualdrive") / "presets" / f"{name}.toml").read_text("utf-8")
    path = folder / name
    try:
        return str(path), path.read_text("utf-8")
    except UnicodeDecodeError:
        raise MachineError(f"{path}: not a text file in UTF-8; name a machine file") from None
    except FileNotFoundError:
        near = get_close_matches(name, preset_names(), 3, 0.5)
        hint = (
            f"did you mean {' or '.join(near)}?" if near else "'dualdrive machine list' shows them"
        )
        raise FileError(f"{path}: no such file, and no preset of that name; {hint}") from None
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror}; name a machine file") from None


# --- what is a choice -----------------------------------------------------------------------------


def structure_of(layers: list[Layer]) -> Structure:
    """Collect the choices of all layers. Raises MachineError naming file, key, value, rule."""
    s = Structure()
    for layer in layers:
        where, data = layer.where, layer.data
        for key in ("name", "title"):
            _expect(data.get(key, ""), str, where, key, "text")
        s.axis = _choice(data.get("axis", s.axis), AXES, where, "axis")
        if "drive_train" in data:
            s.drive_train = _choice(data["drive_train"], tuple(TRAINS), where, "drive_train")
        if "drives" in data:
            s.drives = _expect(data["drives"], int, where, "drives", "a whole number")
        for name, section in _sections(layer):
            _section_choices(s, name, section, where)
    where = layers[-1].where
    if not s.drive_train:
        ways = ", ".join(TRAINS)
        raise MachineError(f"{where}: drive_train is missing; choose one of {ways}, or name a base")
    allowed = TRAINS[s.drive_train][1]
    if s.drives is not None and s.drives not in allowed:
        rule = f"a {s.drive_train} has {allowed[0]}" + (
            f" to {allowed[-1]} drives" if len(allowed) > 1 else " drive; leave the key out"
        )
        raise MachineError(f"{where}: drives = {s.drives}: {rule}")
    return s


def _sections(layer: Layer) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """The tables of numbers, groups before members."""
    names = [n for n in layer.data if n not in (*HEADER, "effects", "history")]
    for name in sorted(names, key=lambda n: n not in GROUPS):
        section = layer.data[name]
        if not isinstance(section, Mapping):
            near = get_close_matches(name, [*HEADER, "effects", "history"], 1)
            hint = f"did you mean {near[0]}?" if near else f"'{name}' could only be a [table]"
            raise MachineError(f"{layer.where}: {name} = {section!r}: unknown key; {hint}")
        yield name, section


def _section_choices(s: Structure, name: str, section: Mapping[str, Any], where: str) -> None:
    for key in _choice_keys(name):
        if key not in section:
            continue
        value, path = section[key], f"{name}.{key}"
        if key == "locked":
            _set_for(s.locked, name, _expect(value, bool, where, path, "true or false"))
        elif key == "speed_samples":
            s.controller[key] = _expect(value, int, where, path, "a whole number")
        elif name == "controller":
            s.controller[key] = _choice(value, _core.Machine.choices()[path], where, path)
        else:
            what = "motor" if name.startswith("motor") else "connection"
            kinds = _core.Machine.choices()[f"{what}.kind"]
            _set_for(s.kinds, name, _choice(value, kinds, where, path))


def _set_for(choices: dict[str, Any], part: str, value: Any) -> None:
    """A group named in a later layer holds for all its members."""
    if part in GROUPS:
        for member in [m for m in choices if group_of(m) == part]:
            del choices[member]
    choices[part] = value


def _choice_keys(section: str) -> tuple[str, ...]:
    if section == "controller":
        return tuple(_core.Machine().controller_options)
    if section == "table" or section.startswith("pinion"):
        return ("locked",)
    return ("kind", "locked") if section.startswith("motor") else ("kind",)


def _choice(value: Any, choices: tuple[str, ...] | list[str], where: str, key: str) -> str:
    if value not in choices:
        ways = ", ".join(choices)
        raise MachineError(f"{where}: {key} = {value!r}: unknown; choose one of {ways}")
    return str(value)


def _expect(value: Any, kind: type, where: str, key: str, rule: str) -> Any:
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise MachineError(f"{where}: {key} = {value!r}: must be {rule}")
    return value


# --- numbers --------------------------------------------------------------------------------------


def build(layers: list[Layer]) -> tuple[_core.Machine, Structure]:
    """Assemble the machine that the layers describe.

    Raises MachineError naming file, key, value, rule and way out.
    """
    structure = structure_of(layers)
    where = layers[-1].where
    core = _assemble(structure, where)
    for layer in layers:
        _add_effects(core, structure, layer)
    for layer in layers:
        _apply_numbers(core, structure, layer)
    core.name = str(layers[-1].data.get("name", Path(where).stem))
    try:
        core.validate()
        core.signals()  # compiles the layout, which finds loops and places that don't exist
    except ValueError as error:
        raise MachineError(f"{where}: {error}") from None
    return core, structure


def _assemble(structure: Structure, where: str) -> _core.Machine:
    try:
        return assemble(structure)
    except ValueError as error:
        raise MachineError(f"{where}: {error}") from None


def _apply_numbers(core: _core.Machine, s: Structure, layer: Layer) -> None:
    """Set plain values first: percentages and play in other frames lean on ratings and ratios."""
    later: list[tuple[str, Any]] = []
    for name, section in _sections(layer):
        _check_section(core, name, layer.where)
        for key, value in section.items():
            if key in _choice_keys(name):
                continue
            leaning = isinstance(value, Mapping) or (isinstance(value, str) and "%" in value)
            if leaning:
                later.append((f"{name}.{key}", value))
            else:
                set_value(core, s, f"{name}.{key}", value, layer.where)
    for path, value in later:
        set_value(core, s, path, value, layer.where)


def _check_section(core: _core.Machine, name: str, where: str) -> None:
    parts = {p.path.rpartition(".")[0] for p in core.parameters() if "@" not in p.path}
    known = sorted(parts | {group for part in parts if (group := group_of(part))})
    if name not in known:
        near = get_close_matches(name, known, 3)
        hint = f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(known)}"
        raise MachineError(f"{where}: [{name}]: no such part in this machine; {hint}")


def set_value(core: _core.Machine, s: Structure, path: str, value: Any, where: str) -> None:
    """Set one number: SI, text with a unit, or a table for a gap in another frame.

    Raises MachineError naming file, key, value and rule.
    """
    try:
        number = _number(core, s, path, value)
    except UnitError as error:
        raise MachineError(f"{where}: {error}") from None
    except ValueError as error:
        rule = str(error).partition(": ")[2]
        raise MachineError(f"{where}: {path} = {value!r}: {rule}") from None
    try:
        core.set(path, number)
    except ValueError as error:
        rule = str(error).partition(": ")[2]
        raise MachineError(f"{where}: {path} = {value!r}: {rule}") from None


def _number(core: _core.Machine, s: Structure, path: str, value: Any) -> float:
    declared = core.parameter(path)
    if isinstance(value, Mapping) and path.endswith(".gap"):
        return half_gap_at_pinion(
            value, key=path, axis=s.axis, ratio=lambda what: _ratio_beside(core, path, what)
        )
    if isinstance(value, float) and math.isinf(value):
        return value  # "no limit"; the core knows where that makes sense
    if not isinstance(value, int | float | str):
        raise UnitError(f"{path} = {value!r}: must be a number or text with a unit")
    unit = unit_on_axis(path, declared.unit, axis=s.axis, rigid=s.drive_train == "rigid")
    return parse(value, unit, key=path, reference=_full_scale(core, path, value))


def _ratio_beside(core: _core.Machine, gap_path: str, what: str) -> float:
    """The ratio of the gearbox or mesh on the chain that a gap sits in."""
    part = gap_path.rpartition(".")[0]
    if part in GROUPS:
        return core.get({"gearbox": "gearboxes.ratio", "mesh": "meshes.ratio"}[what])
    return core.get(f"{what}_{part.rpartition('_')[2]}.ratio")


def _full_scale(core: _core.Machine, path: str, value: Any) -> float | None:
    """What 100 % stands for, as drives have it: rated torque, or the largest pinion speed."""
    if not (isinstance(value, str) and "%" in value):
        return None
    if path in ("controller.T_ten", "controller.T_off"):
        scale = core.get("motor_1.T_rated")
    elif path.startswith("motor") and path.endswith(".T_max"):
        scale = core.get(path.replace("T_max", "T_rated"))
    elif path == "controller.Omega_E":
        scale = core.get("motor_1.omega_max") / core.get("gearbox_1.ratio")
    else:
        return None
    return scale if math.isfinite(scale) else None


# --- effects --------------------------------------------------------------------------------------


def _add_effects(core: _core.Machine, s: Structure, layer: Layer) -> None:
    entries = layer.data.get("effects", [])
    if not isinstance(entries, list) or not all(isinstance(e, Mapping) for e in entries):
        raise MachineError(f"{layer.where}: effects: write each one under its own [[effects]]")
    inherited = {e["label"] for e in core.effects}
    for row, entry in enumerate(entries, 1):
        where, label = (
            f"{layer.where}: effects {row}",
            f"{entry.get('effect')}@{entry.get('place')}",
        )
        if label in inherited and entry["effect"] != "expression":
            set_effect_values(core, s, label, entry, where)
        else:
            add_effect(core, s, entry, where)


def add_effect(core: _core.Machine, s: Structure, entry: Mapping[str, Any], where: str) -> str:
    """Add one effect, as a machine file states it; returns its label.

    entry:  effect, place and its parameters; for an expression formula and parameters
            {name = number or {value, unit}}

    Raises MachineError naming file, key, value and rule.
    """
    for key in ("effect", "place"):
        if key not in entry:
            raise MachineError(f"{where}: {key} is missing")
        _expect(entry[key], str, where, key, "text")
    try:
        if entry["effect"] == "expression":
            label = _add_expression(core, entry, where)
        else:
            label = core.add_effect(entry["effect"], entry["place"])
    except ValueError as error:
        if isinstance(error, MachineError):
            raise
        raise MachineError(f"{where}: {error}") from None
    try:
        set_effect_values(core, s, label, entry, where)
    except MachineError:
        core.remove_effect(label)
        raise
    return label


def set_effect_values(
    core: _core.Machine, s: Structure, label: str, entry: Mapping[str, Any], where: str
) -> None:
    """Set the parameters that an entry of a machine file gives for an effect."""
    own = {"effect", "place"} | (
        {"formula", "parameters"} if entry["effect"] == "expression" else set()
    )
    for key, value in entry.items():
        if key not in own:
            set_value(core, s, f"{label}.{key}", value, where)


def _add_expression(core: _core.Machine, entry: Mapping[str, Any], where: str) -> str:
    formula = _expect(entry.get("formula"), str, where, "formula", "text, e.g. 'c*omega_m'")
    return core.add_expression(entry["place"], formula, _formula_parameters(entry, where))


def _formula_parameters(entry: Mapping[str, Any], where: str) -> list[tuple[str, str, float]]:
    table = _expect(entry.get("parameters", {}), Mapping, where, "parameters", "a table")
    found = []
    for name, value in table.items():
        item = value if isinstance(value, Mapping) else {"value": value}
        for key in item:
            if key not in ("value", "unit"):
                raise MachineError(
                    f"{where}: parameters.{name}.{key}: unknown; give value and unit"
                )
        unit = _expect(item.get("unit", ""), str, where, f"parameters.{name}.unit", "text")
        try:
            number = parse(item.get("value", "missing"), unit, key=f"parameters.{name}")
        except UnitError as error:
            raise MachineError(f"{where}: {error}") from None
        found.append((name, unit, number))
    return found


def history_of(layer: Layer) -> tuple[dict[str, str], ...]:
    """The history entries of a file. Raises MachineError."""
    entries = layer.data.get("history", [])
    if not isinstance(entries, list) or not all(isinstance(e, Mapping) for e in entries):
        raise MachineError(f"{layer.where}: history: write each entry under its own [[history]]")
    for row, entry in enumerate(entries, 1):
        for key, value in entry.items():
            if key not in _HISTORY_KEYS:
                ways = ", ".join(_HISTORY_KEYS)
                raise MachineError(f"{layer.where}: history {row}: {key}: unknown; use {ways}")
            if key != "date":
                _expect(value, str, layer.where, f"history {row}: {key}", "text")
    return tuple({key: str(value) for key, value in entry.items()} for entry in entries)

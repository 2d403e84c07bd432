"""What a machine file chooses, as against the numbers it gives: axis, train, kinds, controller."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from typing import Any, Final

from dualdrive import _core

from .layers import Layer, MachineError, expect
from .trains import GROUPS, TRAINS, Structure, group_of

__all__ = ["choice_keys", "is_choice", "sections", "spoken_choice", "structure_of"]

AXES: Final = ("rotary", "linear")
TOP: Final = ("schema", "name", "title", "base", "axis", "drive_train", "drives")
LISTS: Final = ("effects", "history")
_COUNTED: Final = 10**6


def structure_of(layers: Sequence[Layer]) -> Structure:
    """Collect the choices of all layers. Raises MachineError naming file, key, value, rule."""
    s = Structure()
    for layer in layers:
        where, data = layer.where, layer.data
        s.axis = _choice(data.get("axis", s.axis), AXES, where, "axis")
        if "drive_train" in data:
            s.drive_train = _choice(data["drive_train"], tuple(TRAINS), where, "drive_train")
        if "drives" in data:
            s.drives = expect(data["drives"], int, where, "drives", "a whole number")
        for name, section in sections(layer):
            _read_section(s, name, section, where)
    _check_train(s, layers[-1].where)
    return s


def _check_train(s: Structure, where: str) -> None:
    if not s.drive_train:
        ways = ", ".join(TRAINS)
        raise MachineError(f"{where}: drive_train is missing; choose one of {ways}, or name a base")
    _, allowed = TRAINS[s.drive_train]
    if s.drives is None or s.drives in allowed:
        return
    rule = f"a {s.drive_train} has one drive; leave the key out"
    if len(allowed) > 1:
        rule = f"a {s.drive_train} has {allowed[0]} to {allowed[-1]} drives"
    raise MachineError(f"{where}: drives = {s.drives}: {rule}")


def sections(layer: Layer) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """The tables of a file in the order they count: groups before members.

    Raises MachineError where something else stands at the top of the file.
    """
    names = [name for name in layer.data if name not in (*TOP, *LISTS)]
    for name in sorted(names, key=lambda n: n not in GROUPS):
        section = layer.data[name]
        if not isinstance(section, Mapping):
            near = get_close_matches(name, [*TOP, *LISTS], 1)
            hint = f"did you mean {near[0]}?" if near else f"at the top stand {', '.join(TOP)}"
            raise MachineError(f"{layer.where}: {name} = {section!r}: unknown key; {hint}")
        yield name, section


def choice_keys(section: str) -> tuple[str, ...]:
    """The keys of a section that are choices, not parameters."""
    if section == "controller":
        return tuple(_core.Machine().controller_options)
    if section == "table" or section.startswith("pinion"):
        return ("locked",)
    return ("kind", "locked") if section.startswith("motor") else ("kind",)


def is_choice(path: str) -> bool:
    """Whether a path names a choice: ``drives``, ``meshes.kind``, ``controller.equaliser``."""
    section, _, key = path.rpartition(".")
    if not section:
        return key in ("axis", "drive_train", "drives")
    return "@" not in section and key in choice_keys(section)


def spoken_choice(value: str | bool | int) -> str | bool | int:
    """What a choice written as text means: true, false, a whole number, or a word."""
    if not isinstance(value, str):
        return value
    if value in ("true", "false"):
        return value == "true"
    return int(value) if re.fullmatch("[0-9]{1,9}", value) else value


def _read_section(s: Structure, name: str, section: Mapping[str, Any], where: str) -> None:
    if name == "controller":
        s.controller.setdefault("kind", "master_slave")
    for key in choice_keys(name):
        if key not in section:
            continue
        value, path = section[key], f"{name}.{key}"
        if key == "locked":
            _set_for(s.locked, name, expect(value, bool, where, path, "true or false"))
        elif key == "speed_samples":
            count = expect(value, int, where, path, "a whole number")
            if abs(count) > _COUNTED:  # the core has its own, narrower rule, in numbers it can hold
                raise MachineError(f"{where}: {path} = {count}: too large; write 0 to 100")
            s.controller[key] = count
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


def _choice(value: Any, choices: Sequence[str], where: str, key: str) -> str:
    if value not in choices:
        ways = ", ".join(choices)
        raise MachineError(f"{where}: {key} = {value!r}: unknown; choose one of {ways}")
    return str(value)

"""A machine as the text of a file that stands on its own and reads back to the same bits.

The text begins as the files the machine was read from, laid over each other, with their comments;
then every number that differs from what that text says is written into it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import tomlkit
from tomlkit.items import AoT

from dualdrive import _core

from .construction import build
from .layers import SCHEMA, Layer, parse_layer
from .trains import GROUPS, group_of
from .user_laws import USER_LAWS, curve_entry

__all__ = ["choose", "compose"]


def compose(
    layers: Sequence[Layer],
    core: _core.Machine,
    *,
    name: str,
    title: str,
    history: Iterable[Mapping[str, str]],
) -> str:
    """Return the TOML text of a machine that was read from `layers` and may have changed since."""
    document = _overlay(layers)
    document = _with_header(document, {"schema": SCHEMA, "name": name, "title": title})
    _write_effects(document, core)
    _write_changed(document, core)
    document.pop("history", None)
    entries = [_table(entry) for entry in history]
    if entries:
        document["history"] = _tables(entries)
    return tomlkit.dumps(document)


def choose(text: str, path: str, value: str | bool | int) -> str:
    """Return the text with one choice changed: ``meshes.kind``, ``controller.equaliser``."""
    document = tomlkit.parse(text)
    section, _, key = path.rpartition(".")
    if not section:
        _replace(document, key, value)
        return tomlkit.dumps(document)
    _put(document, section, key, value)
    _drop_member_values(document, section, key)
    return tomlkit.dumps(document)


def _overlay(layers: Sequence[Layer]) -> tomlkit.TOMLDocument:
    document = tomlkit.parse(layers[0].text)
    for layer in layers[1:]:
        for key, item in tomlkit.parse(layer.text).items():
            if key == "effects" and key in document:
                for entry in item:
                    _merge_effect(document, entry)
            elif isinstance(item, dict) and key in document:
                for name, value in item.items():
                    document[key][name] = value
                    _drop_member_values(document, key, name)
            else:
                document[key] = item
                if isinstance(item, dict):
                    for name in item:
                        _drop_member_values(document, key, name)
        document.pop("base", None)
    return document


def _drop_member_values(document: tomlkit.TOMLDocument, section: str, key: str) -> None:
    """A group's value in a later layer holds for members that an earlier one had set apart."""
    if section in GROUPS:
        for member in [m for m in document if group_of(m) == section]:
            document[member].pop(key, None)


def _merge_effect(document: tomlkit.TOMLDocument, entry: Mapping[str, Any]) -> None:
    for known in document["effects"]:
        same = known["effect"] == entry["effect"] and known["place"] == entry["place"]
        if same and entry["effect"] not in USER_LAWS:
            known.update(entry)
            return
    document["effects"].append(entry)


def _with_header(document: tomlkit.TOMLDocument, header: Mapping[str, Any]) -> tomlkit.TOMLDocument:
    """The header goes first; what is there already stays where it is."""
    missing = [key for key in header if key not in document]
    for key in header:
        if key in document and document[key] != header[key]:
            _replace(document, key, header[key])
    if not missing:
        return document
    lines = "".join(f"{key} = {tomlkit.item(header[key]).as_string()}\n" for key in missing)
    return tomlkit.parse(lines + tomlkit.dumps(document))


def _table(entry: Mapping[str, Any]) -> tomlkit.items.Table:
    table = tomlkit.table()
    table.update(entry)
    return table


def _tables(entries: Iterable[Any]) -> AoT:
    array = tomlkit.aot()
    for entry in entries:
        array.append(entry)
    return array


# --- effects --------------------------------------------------------------------------------------


def _write_effects(document: tomlkit.TOMLDocument, core: _core.Machine) -> None:
    """Bring the entries into step with the machine's effects; those that stay keep their text."""
    old = list(document.get("effects", []))
    new = []
    for effect in core.effects:
        match = next((e for e in old if _states(e, effect)), None)
        if match is not None:
            old.remove(match)
        new.append(match if match is not None else _table(_entry(core, effect)))
    if len(new) == len(document.get("effects", [])) and not old:
        return
    document.pop("effects", None)
    if new:
        document["effects"] = _tables(new)


def _states(entry: Mapping[str, Any], effect: Mapping[str, Any]) -> bool:
    known = (entry["effect"], entry["place"], entry.get("formula", ""))
    if known != (effect["effect"], effect["place"], effect["formula"]):
        return False
    return not effect["axes"] or _is_plain_curve(entry, effect)


def _is_plain_curve(entry: Mapping[str, Any], effect: Mapping[str, Any]) -> bool:
    """Whether a spline's text has the machine's axes in plain numbers; others are rewritten."""
    wanted = curve_entry(effect["axes"])
    return all(entry.get(key, False) == wanted[key] for key in wanted) and "values" in entry


def _entry(core: _core.Machine, effect: Mapping[str, Any]) -> dict[str, Any]:
    entry: dict[str, Any] = {"effect": effect["effect"], "place": effect["place"]}
    own = [p for p in core.parameters() if p.path.rpartition(".")[0] == effect["label"]]
    if effect["structural"]:
        return entry | _lent(core, effect)
    if effect["formula"]:
        entry["formula"] = effect["formula"]
        entry["parameters"] = {
            p.path.rpartition(".")[2]: _inline({"value": p.value, "unit": p.unit}) for p in own
        }
        return entry | _columns(effect)
    if effect["axes"]:
        values = _by_row([p.value for p in own], effect["axes"])
        curve = {**curve_entry(effect["axes"]), "values": values, "size": own[0].typical}
        return entry | curve | _columns(effect)
    return entry | {p.path.rpartition(".")[2]: p.value for p in own}


def _lent(core: _core.Machine, effect: Mapping[str, Any]) -> dict[str, float]:
    """What a structural effect can say of its parts: numbers that they agree on, and not "off"."""
    found = {}
    for name in effect["parameters"]:
        members = [core.parameter(m) for m in core.members(f"{effect['label']}.{name}")]
        if len({p.value for p in members}) == 1 and math.isfinite(members[0].value):
            found[name] = members[0].value
    return found


def _columns(effect: Mapping[str, Any]) -> dict[str, Any]:
    return {"columns": _inline(dict(effect["columns"]))} if effect["columns"] else {}


def _by_row(values: list[float], axes: Sequence[Any]) -> list[Any]:
    if len(axes) == 1:
        return values
    width = axes[1][3]
    return [values[k : k + width] for k in range(0, len(values), width)]


def _inline(values: Mapping[str, Any]) -> tomlkit.items.InlineTable:
    table = tomlkit.inline_table()
    table.update(values)
    return table


# --- numbers --------------------------------------------------------------------------------------


def _write_changed(document: tomlkit.TOMLDocument, core: _core.Machine) -> None:
    """Write every value that the text as it stands would not give.

    A ratio or rating written so moves play or percentages that lean on it; they come out next.
    """
    now = {p.path: p.value for p in core.parameters()}
    while True:
        written, _ = build([parse_layer("machine", tomlkit.dumps(document))])
        was = {p.path: p.value for p in written.parameters()}
        changed = [path for path in now if was[path] != now[path]]
        if not changed:
            return
        for path in changed:
            _write_value(document, core, path, now)


def _write_value(
    document: tomlkit.TOMLDocument, core: _core.Machine, path: str, values: Mapping[str, float]
) -> None:
    """Write one value, under its group where the members agree."""
    part, _, key = path.rpartition(".")
    if _write_lent_value(document, core, path, key):
        return
    if "@" in part:
        _write_effect_value(document, core, part, key, values[path])
        return
    group = group_of(part)
    members = [
        p for p in values if p.endswith(f".{key}") and group_of(p.rpartition(".")[0]) == group
    ]
    if group and len({values[p] for p in members}) == 1:
        _put(document, group, key, values[path])
        _drop_member_values(document, group, key)
    else:
        _put(document, part, key, values[path])


def _write_lent_value(
    document: tomlkit.TOMLDocument, core: _core.Machine, path: str, key: str
) -> bool:
    """Write a part's value into the effects that lend it, which are read last.

    False where none states it, or where the members differ, which only the parts can say.
    """
    written = False
    for row, effect in enumerate(core.effects):
        if not effect["structural"] or key not in effect["parameters"]:
            continue
        members = core.members(f"{effect['label']}.{key}")
        if path not in members:
            continue
        values = {core.get(member) for member in members}
        if len(values) == 1 and math.isfinite(core.get(path)):
            _replace(document["effects"][row], key, core.get(path))
            written = True
        else:
            document["effects"][row].pop(key, None)
    return written


def _write_effect_value(
    document: tomlkit.TOMLDocument, core: _core.Machine, label: str, key: str, value: float
) -> None:
    row = [e["label"] for e in core.effects].index(label)
    entry = document["effects"][row]
    if core.effects[row]["axes"]:
        *rows, last = (int(k) for k in key.split("_")[1:])
        values = entry["values"][rows[0]] if rows else entry["values"]
        values[last] = value
    elif "formula" in entry:
        unit = core.parameter(f"{label}.{key}").unit
        entry["parameters"][key] = _inline({"value": value, "unit": unit})
    else:
        _replace(entry, key, value)


def _put(document: tomlkit.TOMLDocument, section: str, key: str, value: Any) -> None:
    if section not in document:
        document[section] = tomlkit.table()
    _replace(document[section], key, value)


def _replace(table: Any, key: str, value: Any) -> None:
    """Set a value; a comment on the old one no longer holds."""
    table[key] = ""  # a truth value, read back, is a bare one that has no comment to take away
    table[key].trivia.comment_ws = table[key].trivia.comment = ""
    table[key] = value

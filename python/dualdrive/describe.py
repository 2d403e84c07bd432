"""Machines and effects in rows: what a table on the screen or a JSON file shows of them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from html import escape
from typing import Any

from numpy.typing import ArrayLike

from dualdrive import _core
from dualdrive.assembly import core_of
from dualdrive.machine import Machine, MachineError, Parameter
from dualdrive.machine_file import LAW_KEYS, group_of
from dualdrive.machine_file.frames import linear_unit
from dualdrive.readable import Scale, scale
from dualdrive.traces.names import CHANNELS, is_canonical
from dualdrive.units import human

__all__ = [
    "bounds",
    "effect",
    "effects",
    "html",
    "linear_words",
    "machine",
    "meaning",
    "reading",
    "scale_on",
    "spoken_on",
    "tied",
    "unit_on",
    "value_and_unit",
]

# What the words of a rotary declaration are where it counts in m, N and kg.
_LINEAR_WORDS = (("moment of inertia", "mass"), ("torque", "force"), ("angle", "position"))


# --- units of a machine's own axis ----------------------------------------------------------------


def unit_on(machine: Any, what: str, unit: str | None = None) -> str:
    """The SI unit in which `what` is shown of this machine: on a linear axis N of a torque.

    machine: a machine; a bare core counts as a rotary axis
    what:    path of a parameter or tie group, a signal, a channel of a trace; or else a rotary SI
             unit ("N*m"), which is then one of the table's side
    unit:    the declared rotary unit, of a path that this machine doesn't have: a candidate's
    """
    unit = unit or _declared_unit(machine, what)
    if unit is None:
        return linear_unit(what) if getattr(machine, "axis", "rotary") == "linear" else what
    return str(machine.unit_of(what, unit)) if hasattr(machine, "unit_of") else unit


def scale_on(machine: Any, what: str, values: ArrayLike = (), unit: str | None = None) -> Scale:
    """The unit to print, and its size, for a column of values of one kind: mm/s, arcsec, kN."""
    return scale(unit_on(machine, what, unit), values)


def spoken_on(
    machine: Any, value: float, what: str, unit: str | None = None, *, digits: int = 4
) -> str:
    """One value as people read it on this axis: ``20.13 N``, ``5 mm/s``, ``22.69 arcsec``."""
    return human(value, unit_on(machine, what, unit), digits=digits)


def _declared_unit(machine: Any, what: str) -> str | None:
    """What the core or the list of channels declares; None where `what` is no name there."""
    core = core_of(machine)
    if is_canonical(what):
        return CHANNELS[what].unit
    try:
        return str(core.parameter(what).unit)
    except ValueError:
        signals = core.signals() if core.bodies else ()
        return next((unit for name, unit, _ in signals if name == what), None)


# --- rows -----------------------------------------------------------------------------------------


def tied(machine: Machine) -> Iterator[Parameter]:
    """Every parameter once: members of a group that agree are one row under the group's path.

    What a rigid connection doesn't use (its stiffness, its play) is left out.
    """
    parameters = [p for p in machine.parameters() if not _idle(machine, p)]
    shown: set[str] = set()
    for p in parameters:
        part, _, key = p.path.rpartition(".")
        group = group_of(part)
        if group is None or "@" in part:
            yield p
            continue
        path = f"{group}.{key}"
        members = [q for q in parameters if _member(q, group, key)]
        if len(members) < 2 or len({q.value for q in members}) > 1:
            yield p
        elif path not in shown:
            shown.add(path)
            yield replace(p, path=path)


def _idle(machine: Machine, p: Parameter) -> bool:
    part, _, key = p.path.rpartition(".")
    core = machine.core
    return part in core.connections and core.kind(part) == "rigid" and key != "ratio"


def _member(p: Parameter, group: str, key: str) -> bool:
    part, _, own = p.path.rpartition(".")
    return own == key and group_of(part) == group


def reading(p: Parameter) -> str:
    """The value as people read it: ``1.1 mrad``; no limit is said in words."""
    return "no limit" if math.isinf(p.value) else human(p.value, p.unit)


def meaning(m: Machine, p: Parameter) -> str:
    """What the declaration says of a number, in the words of this axis: mass for kg."""
    member = m.core.members(p.path)[0]
    return p.doc if m.core.parameter(member).unit == p.unit else linear_words(p.doc)


def linear_words(text: str) -> str:
    """What a rotary declaration says, in the words of a linear axis: force for torque."""
    for rotary, linear in _LINEAR_WORDS:
        text = text.replace(rotary, linear)
    return text


def bounds(p: Parameter) -> str:
    """The declared bounds in words: ``> 0``, ``>= 0``, ``0 to 1``, or nothing."""
    if math.isfinite(p.low) and math.isfinite(p.high):
        return f"{p.low:g} to {p.high:g}"
    if math.isfinite(p.low):
        return f"{'>' if p.low_excluded else '>='} {p.low:g}"
    return f"<= {p.high:g}" if math.isfinite(p.high) else ""


def value_and_unit(p: Parameter) -> dict[str, Any]:
    """For JSON: a value that is no limit is None."""
    return {"value": p.value if math.isfinite(p.value) else None, "unit": p.unit}


def machine(m: Machine) -> dict[str, Any]:
    """A machine for JSON: header, parts and their kinds, parameters with units, effects."""
    parts = [*m.core.connections, *m.core.motors]
    return {
        "name": m.name,
        "title": m.title,
        "axis": m.axis,
        "drive_train": m.drive_train,
        "bodies": list(m.core.bodies),
        "kinds": {part: m.core.kind(part) for part in parts},
        "controller": dict(m.core.controller_options),
        "effects": [dict(effect) for effect in m.core.effects],
        "parameters": {p.path: value_and_unit(p) | {"doc": p.doc} for p in m.parameters()},
        "history": list(m.history),
    }


def html(m: Machine) -> str:
    """A machine as a notebook shows it: what it is made of, and its numbers with their units."""
    choices = ", ".join(f"{key} {value}" for key, value in m.core.controller_options.items())
    head = {
        "axis": f"{m.axis}, {m.drive_train}",
        "controller": choices,
        "effects": ", ".join(m.effects) or "none",
    }
    about = "".join(f"<tr><th>{key}</th><td>{escape(text)}</td></tr>" for key, text in head.items())
    cells = ((p.path, reading(p), bounds(p), p.doc) for p in tied(m))
    rows = "".join(f"<tr><td>{'</td><td>'.join(map(escape, row))}</td></tr>" for row in cells)
    titles = "".join(f"<th>{title}</th>" for title in ("parameter", "value", "bounds", "meaning"))
    return (
        f"<p><b>{escape(m.name)}</b>: {escape(m.title)}</p><table>{about}</table>"
        f"<details><summary>parameters</summary><table><tr>{titles}</tr>{rows}</table></details>"
    )


def effects() -> list[dict[str, Any]]:
    """Every effect of the registry, and the laws that users write, as `effect` has them."""
    return [_of(kind) for kind in (*_core.effect_types(), *_core.user_laws())]


def effect(name: str) -> dict[str, Any]:
    """One effect: equation, places, parameters with units and bounds, source, validity, rivals.

    Of a law that its user writes, `keys` says what an entry of a machine file takes.

    Raises MachineError naming the nearest effects.
    """
    try:
        return _of(_core.effect_type(name))
    except ValueError as error:
        raise MachineError(str(error)) from None


def _of(kind: Any) -> dict[str, Any]:
    return {
        "name": kind.name,
        "equation": kind.equation,
        "acts_on": kind.acts_on,
        "places": kind.places.split(","),
        "parameters": [_declared(p) for p in kind.parameters],
        "keys": LAW_KEYS.get(kind.name, {}),
        "source": kind.source,
        "validity": kind.validity,
        "confused_with": [name.strip() for name in kind.confused_with.split(",") if name.strip()],
    }


def _declared(p: Any) -> dict[str, Any]:
    def finite(value: float) -> float | None:
        return value if math.isfinite(value) else None

    return {
        "name": p.path,
        "unit": p.unit,
        "low": finite(p.low),
        "high": finite(p.high),
        "low_excluded": p.low_excluded,
        "default": finite(p.standard),
        "typical": finite(p.typical),
        "doc": p.doc,
    }

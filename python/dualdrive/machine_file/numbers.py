"""The numbers of a machine file: SI, text with a unit, a percentage, play in another frame.

No list of parameters stands here: what a key means, its unit and its bounds are the declarations
of the core.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from typing import Any, SupportsFloat

from dualdrive import _core
from dualdrive.units import UnitError, parse

from .choices import choice_keys, sections
from .frames import half_gap_at_pinion, unit_on_axis
from .layers import Layer, MachineError
from .trains import Structure, group_of

__all__ = ["apply_numbers", "check_complete", "set_value"]


def apply_numbers(core: _core.Machine, s: Structure, layer: Layer) -> None:
    """Set plain values first: percentages and play in other frames lean on ratings and ratios.

    Raises MachineError naming file, key, value, rule and way out.
    """
    later: list[tuple[str, Any]] = []
    for name, section in sections(layer):
        _check_section(core, name, layer.where)
        for key, value in section.items():
            if key in choice_keys(name):
                continue
            if isinstance(value, Mapping) or (isinstance(value, str) and "%" in value):
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

    Raises MachineError naming file, key, value and rule; nothing is changed then.
    """
    try:
        core.set(path, _number(core, s, path, value))
    except UnitError as error:
        raise MachineError(f"{where}: {error}") from None
    except ValueError as error:  # the core's own: "parameter PATH: rule"
        rule = str(error).partition(": ")[2]
        raise MachineError(f"{where}: {path} = {value!r}: {rule}") from None


def _number(core: _core.Machine, s: Structure, path: str, value: Any) -> float:
    declared = core.parameter(path)
    if isinstance(value, Mapping) and path.endswith(".gap"):
        return half_gap_at_pinion(
            value, key=path, axis=s.axis, ratio=lambda what: _ratio_beside(core, path, what)
        )
    if not isinstance(value, bool) and isinstance(value, SupportsFloat):
        number = value = parse(value, key=path) if isinstance(value, int) else float(value)
        if math.isinf(number):
            return number  # "no limit"; the core knows where that makes sense
    if not isinstance(value, bool | float | str):
        raise UnitError(f"{path} = {value!r}: must be a number or text with a unit")
    unit = unit_on_axis(path, declared.unit, axis=s.axis, rigid=s.drive_train == "rigid")
    return parse(value, unit, key=path, reference=_full_scale(core, path, value))


def _ratio_beside(core: _core.Machine, gap_path: str, what: str) -> float:
    """The ratio of the gearbox or mesh on the chain that a gap sits in."""
    members = core.members(gap_path)
    if len(members) > 1:
        return core.get({"gearbox": "gearboxes.ratio", "mesh": "meshes.ratio"}[what])
    part = members[0].rpartition(".")[0]
    return core.get(f"{what}_{part.rpartition('_')[2]}.ratio")


def _full_scale(core: _core.Machine, path: str, value: Any) -> float | None:
    """What 100 % stands for, as drives have it: rated torque, or the largest pinion speed."""
    if not (isinstance(value, str) and "%" in value):
        return None
    if "@" in path:
        path = core.members(path)[0]  # of a structural effect: the part's own number
    if path in ("controller.T_ten", "controller.T_off"):
        scale = core.get("motor_1.T_rated")
    elif path.startswith("motor") and path.endswith(".T_max"):
        scale = core.get(path.replace("T_max", "T_rated"))
    elif path == "controller.Omega_E":
        scale = core.get("motor_1.omega_max") / core.get("gearbox_1.ratio")
    else:
        return None
    return scale if math.isfinite(scale) else None


def check_complete(core: _core.Machine, layers: Sequence[Layer]) -> None:
    """Refuse a machine that leaves out what has no natural default.

    A declared default of 0 (no friction, no play) or infinity (no limit) means "none of it", and a
    controller's are usual settings; any other default of a body, connection or motor only holds
    the place of a number that the file must give. Raises MachineError naming the key.
    """
    given: set[str] = set()
    for layer in layers:
        for name, section in sections(layer):
            keys = [key for key in section if key not in choice_keys(name)]
            given.update(path for key in keys for path in core.members(f"{name}.{key}"))
    for p in core.parameters():
        if (
            p.path not in given
            and p.standard != 0
            and math.isfinite(p.standard)
            and _counts(core, p)
        ):
            part, _, key = p.path.rpartition(".")
            unit = f" in {p.unit}" if p.unit else ""
            raise MachineError(
                f"{layers[-1].where}: {p.path} is missing ({p.doc}{unit}); "
                f"give {key} under [{group_of(part) or part}] or name a base"
            )


def _counts(core: _core.Machine, p: _core.Parameter) -> bool:
    """Whether a number has a say in this machine, and is no setting of a drive or of an effect."""
    part, _, key = p.path.rpartition(".")
    if "@" in part or part == "controller" or key.startswith("filter_"):
        return False
    if part in core.connections:
        return core.kind(part) != "rigid" or key == "ratio"
    of_every_body = key in {q.path.rpartition(".")[2] for q in _one_body().parameters()}
    return of_every_body or core.kind(part) != "direct"


def _one_body() -> _core.Machine:
    core = _core.Machine()
    core.add_body("body")
    return core

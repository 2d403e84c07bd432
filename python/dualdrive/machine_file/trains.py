"""Drive trains: which bodies, connections and motors a machine is put together from.

A train is a function that fills an empty core machine; the numbers come later. Frames: the twist,
stiffness and gap of every connection are given at the pinion, which is the driven side of a gearbox
and the driving side of a mesh.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from dualdrive import _core

__all__ = ["GROUPS", "TRAINS", "Structure", "assemble", "group_of"]

#: tie group -> prefix of its members
GROUPS: Final = {
    "motors": "motor_",
    "gearboxes": "gearbox_",
    "pinions": "pinion_",
    "meshes": "mesh_",
}


def group_of(part: str) -> str | None:
    """The tie group of a part: ``meshes`` for ``mesh_2``; None for the table."""
    for group, prefix in GROUPS.items():
        if part.startswith(prefix) and part.removeprefix(prefix).isdigit():
            return group
    return None


@dataclass
class Structure:
    """What is a choice, not a number.

    kinds:       part or group -> rigid, compliant, gap (connections); armature, direct (motors)
    locked:      bodies or groups that are held fast
    controller:  arguments of the core's set_controller; empty without a controller
    """

    axis: str = "rotary"
    drive_train: str = ""
    drives: int | None = None
    kinds: dict[str, str] = field(default_factory=dict)
    locked: dict[str, bool] = field(default_factory=dict)
    controller: dict[str, Any] = field(default_factory=dict)

    def kind(self, part: str, default: str) -> str:
        """The kind of a part: its own, its group's, or the default."""
        return self.kinds.get(part, self.kinds.get(group_of(part) or "", default))

    def is_locked(self, body: str) -> bool:
        """Whether a body is held fast."""
        return self.locked.get(body, self.locked.get(group_of(body) or "", False))


def _bodies(core: _core.Machine, structure: Structure, *names: str) -> None:
    for name in names:
        core.add_body(name, structure.is_locked(name))


def _gearbox(core: _core.Machine, s: Structure, n: int) -> None:
    name = f"gearbox_{n}"
    core.connect(name, f"motor_{n}", f"pinion_{n}", s.kind(name, "rigid"), "driven")


def _mesh(core: _core.Machine, s: Structure, n: int) -> None:
    core.connect(f"mesh_{n}", f"pinion_{n}", "table", s.kind(f"mesh_{n}", "gap"), "driver")


def _motor(core: _core.Machine, s: Structure, n: int) -> None:
    core.add_motor(f"motor_{n}", "", s.kind(f"motor_{n}", "armature"))


def _dual_servo(core: _core.Machine, s: Structure) -> None:
    """`drives` whole chains on one ring: motor - gearbox - pinion - mesh - table."""
    drives = range(1, (2 if s.drives is None else s.drives) + 1)
    for n in drives:
        _bodies(core, s, f"motor_{n}", f"pinion_{n}")
    _bodies(core, s, "table")
    for n in drives:
        _gearbox(core, s, n)
        _mesh(core, s, n)
    for n in drives:
        _motor(core, s, n)


def _single_motor(core: _core.Machine, s: Structure) -> None:
    """One chain: motor - gearbox - shaft with pinion - mesh - table."""
    _bodies(core, s, "motor_1", "pinion_1", "table")
    _gearbox(core, s, 1)
    _mesh(core, s, 1)
    _motor(core, s, 1)


def _double_pinion(core: _core.Machine, s: Structure) -> None:
    """One motor, a split shaft: pinion 1 sits on it, pinion 2 behind a preloaded spring.

    The spring's torque is preload + stiffness * (shaft angle - pinion 2 angle).
    """
    _bodies(core, s, "motor_1", "pinion_1", "pinion_2", "table")
    _gearbox(core, s, 1)
    _mesh(core, s, 1)
    _mesh(core, s, 2)
    core.connect("split_shaft", "pinion_1", "pinion_2", s.kind("split_shaft", "compliant"))
    _motor(core, s, 1)


def _rigid(core: _core.Machine, s: Structure) -> None:
    """One body: a motor joined to the table without any give (a linear motor, a stiff axis)."""
    _bodies(core, s, "motor_1", "table")
    core.connect("mesh_1", "motor_1", "table", s.kind("mesh_1", "rigid"), "driver")
    _motor(core, s, 1)


#: drive_train -> (builder, the numbers of drives it can have)
TRAINS: Final[Mapping[str, tuple[Callable[[_core.Machine, Structure], None], range]]] = {
    "dual_servo": (_dual_servo, range(1, 9)),
    "single_motor": (_single_motor, range(1, 2)),
    "double_pinion": (_double_pinion, range(1, 2)),
    "rigid": (_rigid, range(1, 2)),
}


def assemble(structure: Structure) -> _core.Machine:
    """Put an empty machine together; every number has its default.

    Raises ValueError naming part, value and rule.
    """
    core = _core.Machine()
    build, _ = TRAINS[structure.drive_train]
    build(core, structure)
    if structure.controller:
        # a controller that is switched off keeps its numbers, for a file that rests on another
        core.set_controller("master_slave")
        core.set_controller(**structure.controller)
    return core

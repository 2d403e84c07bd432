"""What could be missing: every effect of the library at every place this machine has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from dualdrive import _core
from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.diagnose.laws import is_late, shown_by_balance

#: a group of parts -> what its single parts are called
_ONE = {
    "motors": "motor",
    "pinions": "pinion",
    "meshes": "mesh",
    "gearboxes": "gearbox",
    "drives": "drive",
}


def tried_with(c: TorqueBalance, core: Any) -> list[Hypothesis]:
    """What a machine that meets these records may lack."""
    return candidates(core, c.channels, balance=True, one_clock=c.one_clock)


def candidates(
    core: Any, channels: Sequence[str] = (), *, balance: bool = False, one_clock: bool = False
) -> list[Hypothesis]:
    """Every effect at every usual place or group of this machine that does not carry it there.

    channels: recorded channels at which a recorder's effects are tried, too
    balance:  only what a torque balance shows; a loose joint hides a motion that it would need
    one_clock: whether no two angles can be held against each other. A drive computes its torque and
        holds it for a sample or two, and a loop that is not known answers the noise of its own
        encoder: either way torque and motion are apart in time, and no late sensor need be blamed
    """
    found = []
    for kind in _core.effect_types():
        if kind.hypothesis.untried or (balance and not shown_by_balance(kind)):
            continue
        if one_clock and is_late(kind):
            continue
        usual = (kind.hypothesis.places or kind.places).split(",")
        places = [p for p in usual if not _is_twin(core, kind, p)]
        if balance and kind.invertible:
            places += _single(core, places)  # one late encoder shows where all of them do not
        if {"sensor reading", "sensor delay"} & set(kind.acts_on.split(", ")):
            places += channels
        here = [h for p in places if (h := possible(core, kind.name, p)) is not None]
        found += [one for h in here for one in _apart(core, h)]
    return found


def _apart(core: Any, h: Hypothesis) -> list[Hypothesis]:
    """One hypothesis for each number of a law whose numbers are causes of their own.

    A number that the machine has already is one of its settings, and no cause.
    """
    if not _core.effect_type(h.effects[-1][0]).hypothesis.causes:
        return [h]
    grown, free = h.put_in(core)
    held = {path: float(grown.get(path)) for path in free}
    return [
        replace(h, fixed={p: x for p, x in held.items() if p != own}, searched={h.label: len(free)})
        for own in free
        if held[own] == 0.0
    ]


def members(core: Any, group: Hypothesis) -> list[Hypothesis]:
    """The same effect at each single part of a group; none where the place is a part itself."""
    [(effect, place)] = group.effects
    several = (possible(core, effect, part) for part in parts_of(core, place))
    return [h for h in several if h is not None]


def parts_of(core: Any, place: str) -> list[str]:
    """The single parts of a group: motors -> motor_1, motor_2; none where it is a part itself."""
    one = _ONE.get(place, "")
    every = dict.fromkeys((*core.motors, *core.bodies, *core.connections))
    return [part for part in every if one and part.startswith(f"{one}_")]


def group_of(core: Any, parts: Sequence[str]) -> str:
    """The group that consists of these parts, in whatever order; empty where there is none."""
    return next((group for group in _ONE if sorted(parts_of(core, group)) == sorted(parts)), "")


def _single(core: Any, places: Sequence[str]) -> list[str]:
    """The single parts of the groups that have several."""
    groups = [parts_of(core, place) for place in places]
    return [part for parts in groups if len(parts) > 1 for part in parts]


def akin(first: str, second: str) -> bool:
    """Whether the library says that one effect is confused with the other, or both are one."""
    return first == second or any(
        b in _core.effect_type(a).confused_with.split(",")
        for a, b in ((first, second), (second, first))
    )


def station(place: str) -> str:
    """Which drive train a place is in, whatever part of it: ``drives``, a number, or itself."""
    if place in _ONE:
        return "drives"
    part, _, number = place.rpartition("_")
    return number if part in _ONE.values() else place


def possible(core: Any, effect: str, place: str) -> Hypothesis | None:
    """The effect at the place; None where there is no such part, or it carries it already."""
    hypothesis = Hypothesis(((effect, place),))
    if _carried(core, effect, place):
        return None
    try:
        grown, _ = hypothesis.put_in(core)
    except ValueError:
        return None  # no such part here
    joints = [j for j in grown.effects[-1]["members"] if j in core.connections]
    if _core.effect_type(effect).structural and joints:
        if any(core.kind(joint) == grown.kind(joint) for joint in joints):
            return None  # such a joint it is already
        if _stands(core) and not _stands(grown):
            return None  # a joint without inertia on one side
    return hypothesis


def _stands(core: Any) -> bool:
    """Whether the machine's laws can be evaluated without any inputs."""
    try:
        _core.linearise(core)
    except ValueError:
        return False
    return True


def _is_twin(core: Any, kind: Any, place: str) -> bool:
    """Whether the same law at another place of the list is the very same thing here.

    A mesh turns with its pinion: what goes with its angle is called the pinions'. Friction at both
    ends of a rigid gearbox is on one body: it is called the motors', but for a loss that needs the
    torque of a mesh: the pinions'.
    """
    places = kind.places.split(",")
    if place == "meshes" and "pinions" in places:
        return True
    if not {"motors", "pinions"} <= set(places) or any("phase" in p.path for p in kind.parameters):
        return False
    gears = [c for c in core.connections if c.startswith("gearbox")]
    one_body = bool(gears) and all(core.kind(g) == "rigid" for g in gears)
    return one_body and place == ("motors" if kind.by_load else "pinions")


def _carried(core: Any, effect: str, place: str) -> bool:
    """Whether the machine has this effect at this place, or at a group that includes it."""
    for own in core.effects:
        if own["effect"] == effect and (own["place"] == place or place in own["members"]):
            return True
        one = _ONE.get(place, "")
        if own["effect"] == effect and one and own["place"].startswith(f"{one}_"):
            return True
    return False

"""What could be missing from a machine, and how each candidate is probed.

Most effects are put in at zero strength, where the slope tells. A delay and a part of the machine
(a limit, a joint that gives) are off or another machine there: they are probed at a size.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from dualdrive import _core
from dualdrive.identify.parts import sizes_of_part
from dualdrive.identify.unknowns import Unknown
from dualdrive.replay import Record

#: laws that take the place of a simpler one already scored: no signature of their own at zero
_WHOLE_LAWS = ("stribeck", "lugre")
_DELAY_PROBE = 2e-3  # s
_SOFTER = 0.1  # of its nearly rigid stiffness: where a joint that gives is probed


def candidates_of(core: _core.Machine) -> list[tuple[str, str]]:
    """Every effect at every usual place this machine has and does not carry it at yet."""
    there = {(e["effect"], e["place"]) for e in core.effects}
    whole = _stands(core)
    found = []
    for kind in _core.effect_types():
        if kind.name in _WHOLE_LAWS:
            continue
        for place in kind.places.split(","):
            if (kind.name, place) in there:
                continue
            trial = core.copy()
            try:
                label = trial.add_effect(kind.name, place)
                trial.signals()  # compiles the machine, which knows the rest of the rules
            except ValueError:
                continue  # no such part here, or none that the effect can act on
            if kind.structural and _is_on(core, trial, label):
                continue  # a limit or lag that the machine has, whatever it is called
            if whole and not _stands(trial):
                continue  # a joint without inertia on one side
            found.append((kind.name, place))
    return found


def _stands(core: _core.Machine) -> bool:
    """Whether the machine's laws can be evaluated without any inputs."""
    try:
        _core.linearise(core)
    except ValueError:
        return False
    return True


def _is_on(core: _core.Machine, trial: _core.Machine, label: str) -> bool:
    """Whether the part that a structural effect names works in this machine already."""
    members = trial.members(
        f"{label}.{_core.effect_type(label.partition('@')[0]).parameters[0].path}"
    )
    joint = members[0].rpartition(".")[0]
    if joint in core.connections:
        return core.kind(joint) != "rigid"
    return any(core.get(path) != core.parameter(path).standard for path in members)


@dataclass(frozen=True)
class Probe:
    """One strength of a candidate: a second one where a phase is unknown, a quarter turn later.

    size:  where it is probed in a machine of its own, for what is off at zero altogether (a delay)
           or changes the machine (a joint that gives); 0 where the slope at zero tells
    """

    effect: str
    place: str
    path: str
    unknown: Unknown
    size: float = 0.0

    @property
    def key(self) -> str:
        """What its signature is found under."""
        return self.path

    @property
    def apart(self) -> bool:
        """Whether it takes a machine of its own."""
        return self.size > 0.0

    def expected(self, strength: float) -> float:
        """The number it would have, SI, from the strength that the residual asks for."""
        if not self.apart:
            return strength * self.unknown.scale
        if self.path.endswith(".stiffness"):  # what bends is its inverse
            return self.size / strength if strength > 0 else math.inf
        if self.path.endswith((".T_max", ".U_max")):
            return self.size  # a limit is met or not; nothing grows with it
        return strength * self.size


def put_in(core: _core.Machine, effect: str, place: str, played: Sequence[Record]) -> list[Probe]:
    """Put a candidate into the machine at zero, as often as it takes to tell its strength."""
    kind = _core.effect_type(effect)
    if kind.structural:
        return _part_probe(core, kind, place, played)
    names = [p.path for p in kind.parameters]
    size = _DELAY_PROBE if "delay" in kind.acts_on else 0.0
    probes = []
    for phase in (0.0, 0.5 * math.pi) if "phase" in names else (0.0,):
        label = core.add_effect(effect, place)
        if "phase" in names:
            core.set(f"{label}.phase", phase)
        strength = kind.parameters[0]
        path = f"{label}.{names[0]}"
        free = Unknown(
            path,
            strength.unit,
            0.0,
            -math.inf,
            math.inf,
            strength.typical,
            False,
            0.0,
            0.0,
            math.inf,
        )
        probes.append(Probe(effect, place, path, free, size))
    return probes


def _part_probe(
    core: _core.Machine, kind: _core.EffectType, place: str, played: Sequence[Record]
) -> list[Probe]:
    """How a part of the machine is probed; not at all where no record says what a limit limits."""
    trial = core.copy()
    label = trial.add_effect(kind.name, place)
    (effect,) = (e for e in trial.effects if e["label"] == label)
    name, declared = kind.parameters[0].path, kind.parameters[0]
    path = f"{label}.{name}"
    if name == "stiffness":
        size = _SOFTER * trial.get(path)
    elif math.isinf(declared.standard):
        size = sizes_of_part(trial, effect, played).get(path, 0.0)
    else:
        size = declared.typical if declared.unit != "s" else _DELAY_PROBE
        size = sizes_of_part(trial, effect, played).get(path, size)
    if not size > 0.0:
        return []
    free = Unknown(path, declared.unit, 0.0, -math.inf, math.inf, size, False, 0.0, 0.0, math.inf)
    return [Probe(kind.name, place, path, free, size)]

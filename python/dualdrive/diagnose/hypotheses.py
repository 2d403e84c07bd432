"""A hypothesis, effects that may be missing: put into a machine, made free, probed.

An effect is put in at a usual size for these records and the machine confronted again; the change
is its signature. That needs no derivative, so limits, delays, play and sticking are tried like all
else, and contact changes that a small effect causes are in it.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from dualdrive.estimation.unknowns import Unknown, unknowns
from dualdrive.replay import ratio_to_table

_SOFTER = 0.1  # of the stiffness that a compliant shaft is added with: nearly rigid
#: numbers that move a signature about as much as its strength does: the others are left to a refit
_LINEAR = ("phase", "centre", "asymmetry")
_SHAPES = ("phase", "asymmetry", "centre", "spacing", "start")
_ASYMMETRY = 0.3  # probe of a number without a usual size of its own
#: a limit shows in what was recorded; one that is hardly reached lies just above most of it
_LIMITS, _ABOUT = ("T_max", "U_max"), (0.96, 1.01, 1.03)
_PUT_IN = ("stiffness", "gap")  # a part's
_RIGID = 1e3  # times that: stiffer is as good as rigid
_PRESLIDING = 1e-4  # rad at the table

#: path -> SI value of an effect's numbers
Setting = dict[str, float]


@dataclass(frozen=True)
class Hypothesis:
    """Effects that may be missing, with their counted numbers; empty: nothing is missing.

    fixed: parameter path -> value of what is counted, where a scan found one, or held
    searched: label -> among how many values its own were found
    begins: parameter path -> value from which a fit begins, where a scan found one; such a number
        is free, even one that is held otherwise
    """

    effects: tuple[tuple[str, str], ...] = ()
    fixed: Mapping[str, float] = field(default_factory=dict)
    searched: Mapping[str, int] = field(default_factory=dict)
    begins: Mapping[str, float] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """``coulomb@table``, two joined by `` + ``, or ``nothing``."""
        return " + ".join(f"{e}@{p}" for e, p in self.effects) or "nothing"

    def __add__(self, other: Hypothesis) -> Hypothesis:
        return Hypothesis(
            self.effects + other.effects,
            {**self.fixed, **other.fixed},
            {**self.searched, **other.searched},
            {**self.begins, **other.begins},
        )

    @property
    def looked_at(self) -> int:
        """Among how many values all of them were found."""
        return math.prod(self.searched.values())

    def only(self, numbers: Collection[int]) -> Hypothesis:
        """Some of its effects, by their places in the list, with all that is theirs."""
        effects = tuple(e for k, e in enumerate(self.effects) if k in numbers)
        labels = {f"{effect}@{place}" for effect, place in effects}

        def own(known: Mapping[str, float]) -> dict[str, float]:
            return {p: x for p, x in known.items() if p.rpartition(".")[0] in labels}

        searched = {label: n for label, n in self.searched.items() if label in labels}
        return Hypothesis(effects, own(self.fixed), searched, own(self.begins))

    def instead(self, number: int, other: Hypothesis) -> Hypothesis:
        """Another in the place of one of its effects."""
        count = len(self.effects)
        before, after = self.only(range(number)), self.only(range(number + 1, count))
        return before + other + after

    def put_in(
        self,
        core: Any,
        sizes: Mapping[str, float] | None = None,
        parts: Mapping[str, Mapping[str, float]] | None = None,
    ) -> tuple[Any, list[str]]:
        """A copy of the core's machine with the effects at zero, and the paths that are free.

        sizes: usual sizes on the records at hand, which speeds and bristle stiffnesses of an effect
            begin from
        parts: label -> path -> where limits and play that are off begin

        Raises:
            ValueError: the machine has no such part, or carries the effect already.

        """
        grown, free, usual = core.copy(), list[str](), dict[str, float]()
        for effect, place in self.effects:
            label = grown.add_effect(effect, place)
            [own] = [e for e in grown.effects if e["label"] == label]
            paths = [f"{label}.{name}" for name in own["parameters"]]
            several = [p for p in paths if p not in self.fixed]
            free += [p for p in several if p in self.begins or _is_free(grown, p)]
            usual.update({**_joined(grown, own), **(parts or {}).get(label, {})})
        for path in free:
            if sizes and not is_strength(grown, path) and path not in usual:
                usual[path] = _scaled(grown, path, sizes)
        for path, size in usual.items():
            if size:
                grown.set(path, size)
        for path, value in {**self.fixed, **self.begins}.items():
            grown.set(path, value)
        return grown, free

    def unknowns(
        self, grown: Any, free: Sequence[str], sizes: Mapping[str, float]
    ) -> list[Unknown]:
        """What is free of the effects in a machine they were put in, scaled for the records."""
        usual = {
            path: float(grown.get(path))
            if path.endswith(_LIMITS)
            else _scaled(grown, path, sizes) or _typical(grown, path)
            for path in free
        }
        found = [_compliant(grown, _weakly_believed(p)) for p in unknowns(grown, free, None, usual)]
        late = [p.unit == "s" and is_strength(grown, p.path) for p in found]
        return [
            replace(p, low=max(p.low, sizes.get("delay", 0.0))) if own else p
            for p, own in zip(found, late, strict=True)
        ]


def distinct(hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
    """No hypothesis twice, by its effects, counted numbers and where its refit begins."""
    own = {(h.effects, *h.fixed.items(), *h.begins.items()): h for h in hypotheses}
    return list(own.values())


def _is_free(grown: Any, path: str) -> bool:
    """Whether a number of an effect is fitted here."""
    declared = grown.parameter(grown.members(path)[0])
    name = path.rpartition(".")[2]
    if name == "spacing":  # of a wheel that meets two pinions
        return bool(path.partition("@")[2].startswith(("table", "ring")))
    return not declared.counted


def _joined(grown: Any, effect: Mapping[str, Any]) -> dict[str, float]:
    """Where the stiffness of a part begins: a shaft soft enough to show, behind play as added."""
    path = f"{effect['label']}.stiffness"
    if not effect["structural"] or "stiffness" not in effect["parameters"]:
        return {}
    alone = list(effect["parameters"]) == ["stiffness"]
    return {path: (_SOFTER if alone else 1.0) * grown.get(path)}


def _weakly_believed(p: Unknown) -> Unknown:
    """Of a law under trial, a number that is positive is believed to be what records suggest.

    Within its own size, as one of a law that is there. A Stribeck speed at which nothing moves has
    no slope, and would lead no fit back.
    """
    return p if p.logarithmic else replace(p, sigma=math.inf)


def _compliant(grown: Any, p: Unknown) -> Unknown:
    """A stiffness that is put in, fitted as the compliance that it adds."""
    effect = next(e for e in grown.effects if p.path.startswith(f"{e['label']}."))
    if not effect["structural"] or not p.path.endswith(".stiffness"):
        return p
    scale = float(grown.get(p.path))
    high = min(p.high, _RIGID * scale)
    return replace(
        p, high=high, scale=scale, centre=1.0, start=1.0, sigma=math.inf,
        logarithmic=False, reciprocal=True,
    )  # fmt: skip


def _typical(core: Any, path: str) -> float:
    return float(core.parameter(core.members(path)[0]).typical)


def _scaled(core: Any, path: str, sizes: Mapping[str, float]) -> float:
    """Size of a number that depends on the machine's torques and speeds; 0 where none is known.

    Torques: a tenth of what the drives needed, carried to the place; what grows with speed, that
    over the speed there; currents, half of theirs; Stribeck speeds, a twentieth of the speed;
    bristles give way within 1e-4 rad of the table.
    """
    declared = core.parameter(core.members(path)[0])
    effect = next(e for e in core.effects if path.startswith(f"{e['label']}."))
    ratio = ratio_to_table(core, effect["members"][0]) if effect["members"] else 1.0
    torque, speed = sizes.get("torque", 0.0), sizes.get("speed", 0.0)
    name = path.rpartition(".")[2]
    if name in ("centre", "width"):  # of a local fault
        return 0.25 * sizes.get("travel", 0.0) * ratio
    if torque <= 0.0 or speed <= 0.0:
        return 0.0
    return {
        "A": 0.5 * sizes.get("current", 0.0),
        "N*m": 0.1 * torque / ratio,
        "N*m*s/rad": 0.1 * torque / speed / ratio**2,
        "N*m*s^2/rad^2": 0.1 * torque / speed**2 / ratio**3,
        "rad/s": 0.05 * speed * ratio,
        "N*m/rad": 0.1 * torque / _PRESLIDING / ratio**2,
    }.get(declared.unit, 0.0)


def is_strength(core: Any, path: str) -> bool:
    """Whether zero of it switches the effect off; a part without play is still put in."""
    declared = core.parameter(core.members(path)[0])
    name = path.rpartition(".")[2]
    return bool(declared.standard == 0.0 and name not in (*_SHAPES, *_PUT_IN))


def probes(core: Any, free: Sequence[Unknown], travel: Sequence[float] = ()) -> list[Setting]:
    """Settings to try an effect at: its first strength, where it sits, and other strengths.

    travel: angles along which a local fault may sit, rad
    """
    strengths = [p for p in free if is_strength(core, p.path)]
    shapes = [p for p in free if p not in strengths]
    off = {p.path: 0.0 for p in strengths} | {p.path: float(core.get(p.path)) for p in shapes}
    base = {**off, **({strengths[0].path: strengths[0].scale} if strengths else {})}
    found = [base]
    for p in shapes:
        if not strengths or p.path.endswith(_LINEAR):
            found += [{**base, p.path: x} for x in _moved(p, base[p.path], travel)]
    found += [{**off, p.path: p.scale} for p in strengths[1:]]
    return found


def _moved(p: Unknown, value: float, travel: Sequence[float]) -> list[float]:
    """Other values of a number that shapes an effect."""
    name = p.path.rpartition(".")[2]
    if name == "centre" and travel:
        return [float(x) for x in travel]
    if name in _LIMITS:
        return [factor * value for factor in _ABOUT]
    step = 0.5 * value
    if p.unit == "rad" and name.endswith("phase"):
        step = 0.5 * math.pi
    elif value == 0.0:
        step = _ASYMMETRY
    other = min(max(value + step, p.low), p.high)
    return [other] if other != value and math.isfinite(other) else []

"""Every effect of the library at every place, as variants of a machine that can be fitted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dualdrive import _core
from dualdrive.diagnose.candidates import candidates, parts_of
from dualdrive.diagnose.hypotheses import Hypothesis, is_strength
from dualdrive.diagnose.laws import carrier, is_late, lowest_order
from dualdrive.diagnose.orders import LOW
from dualdrive.diagnose.screening.orders import strongest_orders
from dualdrive.estimation.unknowns import Unknown, unknowns
from dualdrive.identify.parts import sizes_of_part
from dualdrive.innovations import GreyBox, Point, Variant
from dualdrive.replay import ratio_to_table

_ORDERS = 2  # that an effect with an order is tried at, beside its usual one and the low ones
_DAMPING_RATIO = 0.05  # with which a part that is put in begins to ring
_WIDTHS = (0.2, 0.06)  # of what a wheel turns through: ranges that a local fault is tried over
#: times its usual size: where flanks part elsewhere with a local fault, no other size tells of one
LARGER = (2.0, 4.0, 8.0)
_DELAY = 5e-5  # s: a delay below that shows in no record


class Library:
    """What may be missing of a machine, sized for its records."""

    def __init__(self, core: Any, grey: GreyBox) -> None:
        self.core, self.grey = core, grey
        channels = [c for r in grey.records for c in r.channels]
        self.hypotheses = candidates(core, list(dict.fromkeys(channels)))
        self.sizes = usual_sizes(core, grey)

    def variants(
        self, base: Variant, point: Point, more: Sequence[Hypothesis] = ()
    ) -> list[Variant]:
        """Every law beside those of a variant, orders as its innovations show them.

        more: other hypotheses, which these records suggest.
        """
        known: dict[tuple[str, str], list[int]] = {}
        found = []
        for h in [*self.hypotheses, *more]:
            [(effect, place)] = h.effects
            if any(effect == e and place == p for e, p in base.effects):
                continue
            for order in self._orders(h, point, known):
                variant = self._beside(base, h, order)
                if variant is not None:
                    found.append(variant)
        return found

    def without(self, variant: Variant, effect: tuple[str, str]) -> Variant | None:
        """A variant without one of its effects; None where the others can't be put in alone."""
        found: Variant | None = Variant(self.core)
        for own in variant.effects:
            if own == effect or found is None:
                continue
            known = (
                h
                for h in self.hypotheses
                if h.effects == (own,) and h.fixed.items() <= variant.fixed.items()
            )
            found = self._beside(found, next(known, Hypothesis((own,))), self._order(variant, own))
        return found

    def at_one(self, variant: Variant, effect: tuple[str, str], member: str) -> Variant | None:
        """A variant with an effect of a group at one member only, last; None where it can't be."""
        rest = self.without(variant, effect)
        alone = Hypothesis(((effect[0], member),))
        return None if rest is None else self._beside(rest, alone, self._order(variant, effect))

    def _order(self, variant: Variant, own: tuple[str, str]) -> float | None:
        """What is counted of an effect of a variant; None where nothing is."""
        counted = _counted(own[0])
        members = {own[1], *parts_of(self.core, own[1])}
        paths = [path for path in variant.fixed if path.endswith(f".{counted}")]
        orders = (variant.fixed[path] for path in paths if _place(path, own[0]) in members)
        return next(orders, None) if counted else None

    def _orders(
        self, h: Hypothesis, point: Point, known: dict[tuple[str, str], list[int]]
    ) -> list[float | None]:
        [(effect, place)] = h.effects
        counted = _counted(effect)
        if not counted:
            return [None]
        part = (parts_of(self.core, place) or [place])[0]
        by = carrier(effect)
        if (by, part) not in known:
            own = strongest_orders(self.core, self.grey.records, point, part, by, _ORDERS)
            known[by, part] = own
        usual = int(_declared(effect, counted).standard)
        low = LOW if counted == "order" else ()
        every = dict.fromkeys([*known[by, part], usual, *low])
        return [float(n) for n in every if n >= lowest_order(effect)]

    def _beside(self, base: Variant, h: Hypothesis, order: float | None) -> Variant | None:
        [(effect, place)] = h.effects
        members = parts_of(self.core, place)
        phased = any(p.path == "phase" for p in _core.effect_type(effect).parameters)
        # what turns with a part has a phase of its own at each
        places = members if phased and len(members) > 1 else [place]
        counted = _counted(effect)
        fixed = dict(h.fixed)
        if order is not None:
            fixed.update({f"{effect}@{p}.{counted}": order for p in places})
        own = Hypothesis(tuple((effect, p) for p in places), fixed, h.searched, h.begins)
        try:
            parts = {}
            for e, p in own.effects:
                if _core.effect_type(e).structural:
                    trial = base.grown.copy()
                    label = trial.add_effect(e, p)
                    [row] = [x for x in trial.effects if x["label"] == label]
                    parts[label] = sizes_of_part(trial, row, [r.record for r in self.grey.records])
            grown, free = own.put_in(base.grown, self.sizes, parts)
            losses = [u for e, p in own.effects for u in _losses(grown, e, p)]
            extra = [*own.unknowns(grown, free, self.sizes), *losses]
            grown.states()
        except ValueError:
            # the machine has no such part, nothing of it was recorded, or a number is missing that
            # its law is measured by
            return None
        looks = base.looks * own.looked_at * (100.0 if order is not None else 1.0)
        for e, p in own.effects:
            looks *= max(1, len(spots(grown, f"{e}@{p}", extra, travel(self.grey))))
        return Variant(
            grown,
            (*base.extra, *extra),
            (*base.effects, (effect, place)),
            {**base.fixed, **fixed},
            looks,
        )


def travel(grey: GreyBox) -> tuple[float, float]:
    """Between which angles the table turns, as commanded, over all records, rad."""
    angles = [r.record.reference for r in grey.records]
    return min(float(np.min(a)) for a in angles), max(float(np.max(a)) for a in angles)


def spots(
    core: Any, label: str, free: Sequence[Unknown], way: tuple[float, float]
) -> list[dict[str, float]]:
    """Where a local fault may sit and how far it may reach; empty for what is none.

    Args:
        core: the core's machine.
        label: of the effect.
        free: its unknowns.
        way: between which angles the table turns, rad: a fault elsewhere shows nowhere.

    """
    centre, width = f"{label}.centre", f"{label}.width"
    if not {centre, width} <= {p.path for p in free}:
        return []
    period, place = 2.0 * math.pi / periods(core, label), label.partition("@")[2]
    times = ratio_to_table(core, (parts_of(core, place) or [place])[0])
    low, high = sorted(times * angle for angle in way)
    if not 0.0 < high - low < period:
        low, high = -0.5 * period, 0.5 * period
    return [
        {
            centre: 0.5 * (low + high) + (high - low) * ((0.5 + k * share) % 1.0 - 0.5),
            width: (high - low) * share,
        }
        for share in _WIDTHS
        for k in range(round(1.0 / share))
    ]


def local_faults(
    core: Any, free: Sequence[Unknown], way: tuple[float, float]
) -> list[dict[str, float]]:
    """A local fault wherever it may sit, at several sizes; empty for what is none.

    Args:
        core: the core's machine.
        free: unknowns of one law.
        way: between which angles the table turns, rad.

    """
    return [
        {**spot, p.path: times * p.scale}
        for p in free
        if is_strength(core, p.path)
        for spot in spots(core, p.path.rpartition(".")[0], free, way)
        for times in (1.0, *LARGER)
    ]


def periods(core: Any, label: str) -> float:
    """Of a law, per turn of its wheel."""
    [own] = [e for e in core.effects if e["label"] == label]
    counted = [name for name in ("order", "places") if name in own["parameters"]]
    return float(core.get(f"{label}.{counted[0]}")) if counted else 1.0


def _losses(grown: Any, effect: str, place: str) -> list[Unknown]:
    """What comes with a part that is put in, added to the machine: no joint gives without loss."""
    brought = _core.effect_type(effect).brings
    if not brought or any(e["label"] == f"{brought}@{place}" for e in grown.effects):
        return []
    # two bodies that ring against each other, the smaller inertia before all
    stiffness = grown.get(f"{effect}@{place}.stiffness")
    smaller = min(_inertia(grown, joint) for joint in parts_of(grown, place))
    path = f"{grown.add_effect(brought, place)}.coefficient"
    coefficient = 2.0 * _DAMPING_RATIO * math.sqrt(stiffness * smaller)
    grown.set(path, coefficient)
    free = unknowns(grown, [path], None, {path: coefficient})
    return [replace(u, start=1.0, sigma=math.inf) for u in free]


def _inertia(core: Any, gearbox: str) -> float:
    """Of motor and pinion against each other, kg*m^2 in the pinion's frame."""
    n = gearbox.rpartition("_")[2]
    motor = core.get(f"motor_{n}.J") * core.get(f"{gearbox}.ratio") ** 2
    pinion = core.get(f"pinion_{n}.J")
    return float(motor * pinion / (motor + pinion)) if motor > 0.0 and pinion > 0.0 else motor


def usual_sizes(core: Any, grey: GreyBox) -> dict[str, float]:
    """Spread of the drives' torque at the table, N*m, of its speed, its travel; of a current, A."""
    torque = current = 0.0
    for r in grey.records:
        for motor in core.motors:
            n, constant = motor.rpartition("_")[2], core.get(f"{motor}.K_d")
            for name, factor in ((f"T_{n}", 1.0), (f"I_{n}", constant)):
                if name in r.record.trace:
                    spread = factor * float(np.std(r.record.trace[name]))
                    torque = max(torque, ratio_to_table(core, motor) * spread)
                    current = max(current, spread / constant)
    references = [(r.record.reference, r.record.t) for r in grey.records]
    speed = max(float(np.std(np.gradient(x, t))) for x, t in references)
    travel = max(float(np.ptp(x)) for x, _ in references)
    known = {"torque": torque, "speed": speed, "travel": travel, "current": current}
    return {**known, "delay": _DELAY}


def is_part(variant: Variant) -> bool:
    """Whether its last effect is a part of the machine with states of its own.

    One that is put in, a law with a memory, or a signal that its loop has late.
    """
    effect, place = variant.effects[-1]
    own = _core.effect_type(effect)
    looped = is_late(own) and place not in _core.recorded_channels(variant.grown)
    return bool(own.structural or own.memory or looped)


def _counted(effect: str) -> str:
    """The number of an effect that is an order or a count of teeth; empty: it has none."""
    names = [p.path for p in _core.effect_type(effect).parameters]
    return next((n for n in ("order", "teeth") if n in names), "")


def _place(path: str, effect: str) -> str:
    """Where an effect's number stands, empty for another effect's."""
    label = path.rpartition(".")[0]
    return label.removeprefix(f"{effect}@") if label.startswith(f"{effect}@") else ""


def _declared(effect: str, name: str) -> Any:
    return next(p for p in _core.effect_type(effect).parameters if p.path == name)

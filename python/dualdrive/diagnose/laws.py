"""What effects mean as hypotheses, read off their declarations: no effect is known by its name.

What a law is called, contains, is carried by and is tried at is declared beside it, in
``cpp/include/dualdrive/effects/<name>.hpp``.
"""

from __future__ import annotations

from typing import Any, Final

from dualdrive import _core


def _listed(names: str) -> tuple[str, ...]:
    return tuple(names.split(",")) if names else ()


def _by_what_they_contain() -> dict[str, tuple[str, ...]]:
    every = ((kind.name, _listed(kind.hypothesis.contains)) for kind in _core.effect_types())
    return dict(sorted(((n, c) for n, c in every if c), key=lambda law: len(law[1])))


#: whole laws -> the simpler ones that they contain, the nearest first; each after those it contains
CONTAINS: Final = _by_what_they_contain()
#: the simplest of them
CONTAINED: Final = frozenset(chain[-1] for chain in CONTAINS.values())


def carrier(effect: str) -> str:
    """What an effect's harmonics are multiplied by: ``torque``, ``direction``, or nothing."""
    return str(_core.effect_type(effect).hypothesis.carrier)


def lowest_order(effect: str) -> float:
    """The order below which a harmonic is another law's."""
    return float(_core.effect_type(effect).hypothesis.lowest_order)


def called(effect: str) -> str:
    """As engineers call an effect: ``Coulomb friction``, ``torque ripple``."""
    return str(_core.effect_type(effect).hypothesis.called) or effect.replace("_", " ")


def rubs(effect: str) -> bool:
    """Whether it is a law of friction."""
    kind = _core.effect_type(effect)
    return bool(kind.hypothesis.friction or "dry friction" in kind.acts_on)


def clips(effect: str) -> bool:
    """Whether a current or voltage that stands at an extreme may be its doing."""
    return bool(_core.effect_type(effect).hypothesis.clips)


def is_late(kind: Any) -> bool:
    """Whether a type of effect makes readings late."""
    return "sensor delay" in kind.acts_on.split(", ")


def shown_by_balance(kind: Any) -> bool:
    """Whether a torque balance shows a type of effect, or its readings can be taken back."""
    if kind.invertible:
        return True
    return bool(kind.in_balance and not kind.structural and not kind.hypothesis.scales)

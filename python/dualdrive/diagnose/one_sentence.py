"""The finding in one sentence, as one engineer would say it to another."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from dualdrive.diagnose.laws import called
from dualdrive.diagnose.phrases import beyond_noise, none_missing, percent
from dualdrive.diagnose.result import Candidate, Diagnosis
from dualdrive.units import human

__all__ = ["headline", "spoken"]

_AT_FLOOR: Final = 1.2  # times the noise floor: nothing is left that one would look for
_INSIDE: Final = ("meshes", "mesh", "gearboxes", "gearbox", "controller")


def headline(d: Diagnosis) -> str:
    """What was found, and how far the error falls by it.

    Effects are called as engineers call them, not by their labels in machine files.
    """
    e = d.error
    if not d.judged:
        why = f": {d.warnings[0].rstrip('.')}" if d.warnings else ""
        return f"The records can't be judged{why}."
    if d.verdict == "adequate":
        reached = _reached(d, e.get("nominal"))
        if beyond_noise(e, "nominal"):
            return f"The model leaves more than noise, but nothing can be named: error {reached}."
        return f"The model meets what was recorded: its error is {reached}."
    if d.verdict == "parameters":
        falls = _falls(d, e.get("nominal"), e.get("refitted"))
        none = none_missing(e)
        return f"{none}, but numbers of the data sheet are off: refitted, {falls}."
    if d.verdict == "unknown":
        left = f"{percent(e.get('refitted'))} of error is left with every number refitted"
        return f"Something is missing that no effect of the library explains: {left}{_floor(d)}."
    if d.verdict == "unfinished":
        return f"The search was stopped before every effect had its turn: {_leads(d)}."
    best = d.candidates[0]
    falls = _falls(d, e.get("refitted"), e.get("best"))
    if d.verdict == "effect":
        is_, it = ("are", "them") if len(best.effects) > 1 else ("is", "it")
        return f"{_capital(_sized(best))} {is_} missing from the model: with {it} {falls}."
    alike = next((group for group in d.groups if best.label in group), (best.label,))
    rivals = [c for c in d.candidates if c.label in alike]
    any_of = {1: "it", 2: "either"}.get(len(rivals), "any of them")
    which = f"{_either(rivals)}, which the records can't tell"
    return f"An effect is missing from the model, {which}: with {any_of} {falls}."


def _leads(d: Diagnosis) -> str:
    """What a search that was stopped would have gone on with."""
    if first := next((c for c in d.candidates if c.resolved), None):
        return f"{spoken(first)} leads so far"
    gaining = max((c for c in d.candidates if c.gain > 0.0), key=lambda c: c.gain, default=None)
    return f"{spoken(gaining)} gains most so far" if gaining else "nothing can be said yet"


def spoken(c: Candidate) -> str:
    """A candidate in words: ``Coulomb friction at the table``; several are joined by *and*."""
    return " and ".join(f"{called(effect)} {_where(place)}" for effect, place in c.effects)


def _either(rivals: Sequence[Candidate]) -> str:
    """Rivals joined by *or*; a place that all of them share is said once."""
    places = {place for c in rivals for _, place in c.effects}
    if len(places) == 1 and all(len(c.effects) == 1 for c in rivals):
        names = [called(c.effects[0][0]) for c in rivals]
        names[-1] += f" {_where(places.pop())}"
    else:
        names = [spoken(c) for c in rivals]
    *others, last = names
    return f"{', '.join(others)} or {last}" if others else last


def _sized(c: Candidate) -> str:
    """The same with the number that says how much there is of it, where one does."""
    if len(c.effects) > 1:
        return spoken(c)
    [(effect, place)] = c.effects
    told = (p for p in c.parameters.values() if p.unit not in ("", "1") and p.low < p.high)
    size = next((f" of {human(p.value, p.unit, digits=3)}" for p in told), "")
    return f"{called(effect)}{size} {_where(place)}"


def _where(place: str) -> str:
    kind, _, number = place.rpartition("_")
    if number.isdecimal():
        return f"{'in' if kind in _INSIDE else 'at'} {kind.replace('_', ' ')} {number}"
    return f"{'in' if place in _INSIDE else 'at'} the {place.replace('_', ' ')}"


def _falls(d: Diagnosis, before: float | None, after: float | None) -> str:
    return f"the error falls from {percent(before)} to {_reached(d, after)}"


def _reached(d: Diagnosis, error: float | None) -> str:
    """An error beside that of a model that lacks nothing."""
    floor = d.error.get("noise_floor", math.nan)
    if error is not None and error < _AT_FLOOR * floor:
        return f"{percent(error)}, which is the noise of the sensors"
    return f"{percent(error)}{_floor(d)}"


def _floor(d: Diagnosis) -> str:
    floor = d.error.get("noise_floor", math.nan)
    return f", where the sensors alone leave {percent(floor)}" if math.isfinite(floor) else ""


def _capital(words: str) -> str:
    return f"{words[:1].upper()}{words[1:]}"

"""What the name of a column says: quantity, place, number, unit; in English and German."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from dualdrive.units import UnitError, conversion

from .names import is_canonical

__all__ = ["Meaning", "meaning", "words_of"]

# Words of headers, lower case.
_QUANTITY: Final = {
    "theta": "position pos angle theta phi lage winkel istlage sollage",
    "omega": "speed velocity vel omega drehzahl geschwindigkeit rpm dps",
    "T": "torque moment drehmoment trq nm",
    "I": "current strom amp amps",
    "U": "voltage spannung volt",
}
_ROLE: Final = {
    "ref": "ref reference set setpoint target command commanded cmd demand soll sollwert sollage",
    "pinion": "pinion ritzel joint",
    "motor": "motor mot drive fc inverter antrieb umrichter servo master slave",
    "table": "table ring load axis tisch achse direct last output secondary enc encoder",
}
# Where no word says it, the unit does, beside a place, a drive, or the letter of a formula.
_MEASURES: Final = {"rad": "theta", "rad/s": "omega", "N*m": "T", "A": "I", "V": "U"}
_LETTERS: Final = {
    "theta": "phi alpha", "omega": "n w", "T": "m t md", "I": "i iq", "U": "u v",
}  # fmt: skip
_EFFECTIVE: Final = frozenset({"eff", "rms"})
_NUMBER: Final = {"1": "a master", "2": "b slave"}
_AXIS: Final = frozenset({"ax", "axis", "achse", "joint", "gelenk", "j"})
_UNIT: Final = {
    "rad": "rad", "mrad": "mrad", "deg": "deg", "degree": "deg", "arcsec": "arcsec",
    "rpm": "rpm", "dps": "deg/s", "nm": "N*m", "knm": "kN*m", "ma": "mA", "mm": "mm", "um": "um",
    "pct": "%", "percent": "%",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Meaning:
    """What a column's name says; what it doesn't say is empty, or None.

    quantity:  theta, omega, T, I or U
    role:      ref, pinion, motor or table
    number:    of a drive or an axis, as counted in the file
    axis:      whether it counts axes (ax1, joint 2), of which each has a motor of its own
    unit:      as the name has it
    current:   rms, of a current whose name says so
    words:     those that were understood
    """

    quantity: str = ""
    role: str = ""
    number: int | None = None
    axis: bool = False
    unit: str = ""
    current: str = ""
    words: tuple[str, ...] = ()

    def channel(self, drive: int | None) -> str:
        """The channel that this is on a drive (1, 2, or None where it is on no drive), or ""."""
        n = drive or ""
        per_drive = {"I": f"I_{n}", "U": f"U_{n}", "T": f"T_{n}"}
        if self.quantity in per_drive:
            table = self.quantity == "T" and self.role == "table"
            name = "T_load" if table else "" if self.role == "ref" else per_drive[self.quantity]
        elif not self.quantity:
            name = ""
        else:
            ends = {"ref": "ref", "table": "m", "pinion": f"c{n}", "motor": f"{n}", "": f"{n}"}
            name = f"{self.quantity}_{ends[self.role]}"
        return name if is_canonical(name) else ""

    @property
    def of_a_drive(self) -> bool:
        """Whether it belongs to one drive rather than to the table or the command."""
        return self.role not in ("ref", "table") or self.quantity in ("I", "U")


def meaning(column: str, unit: str = "") -> Meaning:
    """Read a column's name; a unit that the file states beside it goes before one in the name."""
    words = words_of(column)
    quantity, said = _find(words, _QUANTITY)
    role, placed = _find(words, _ROLE)
    letter, lettered = _find(words, _NUMBER)
    number, before = _numbered(words)
    axis = number is not None and before in _AXIS
    if axis and placed == before:  # "axis 3" is a name, not the place "axis"
        role, placed = _find([word for word in words if word != before], _ROLE)
    if number is None and letter:
        number = int(letter)
    found = unit or next((_UNIT[word] for word in reversed(words) if word in _UNIT), "")
    if lettered or number is None:
        counted = lettered
    else:
        counted = str(number) if before in (placed, said) else f"{before} {number}".strip()
    if not quantity:
        quantity = _measured_in(found)
        lettered_so = words[:1] and words[0] in _LETTERS.get(quantity, "").split()
        said = words[0] if lettered_so else ""
        if not (role or number or lettered_so):
            quantity = ""
        elif quantity and not said:
            said = found
    effective = next((w for w in words if w in _EFFECTIVE and quantity == "I"), "")
    understood = (word for word in (placed, said, effective, counted) if word)
    current = "rms" if effective else ""
    return Meaning(quantity, role, number, axis, found, current, tuple(dict.fromkeys(understood)))


def _measured_in(unit: str) -> str:
    """The quantity that is measured in this unit; "" where it is none of them."""
    for si, quantity in _MEASURES.items() if unit else ():
        try:
            conversion(unit, si)
        except UnitError:
            continue
        return quantity
    return ""


def words_of(name: str) -> list[str]:
    """Lower-case words of a name: ``FC1Torque`` -> fc 1 torque; ``ax1_vel_dps`` -> ax 1 vel dps."""
    parted = re.sub(r"(?<=[a-zäöü])(?=[A-Z])|(?<=[^\W\d_])(?=\d)|(?<=\d)(?=[^\W\d_])", " ", name)
    return re.findall(r"[^\W\d_]+|\d+", parted.lower())


def _numbered(words: list[str]) -> tuple[int | None, str]:
    """The first small number in a name and the word before it."""
    for k, word in enumerate(words):
        if word.isdecimal() and 0 < int(word) < 100:
            return int(word), words[k - 1] if k else ""
    return None, ""


def _find(words: list[str], vocabulary: Mapping[str, str]) -> tuple[str, str]:
    """Key of the first entry that a word belongs to, and the word; long words may be joined."""

    def meant(word: str, known: str) -> bool:
        joined = len(known) >= 4 and (word.startswith(known) or (len(known) >= 5 and known in word))
        return word == known or joined

    return next(
        (
            (key, word)
            for key, all_known in vocabulary.items()
            for word in words
            if any(meant(word, known) for known in all_known.split())
        ),
        ("", ""),
    )

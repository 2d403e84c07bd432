"""Hidden effects: what the engine is told, and what the label says.

Each entry of `EFFECTS` draws one effect at one place for one machine: the engine's words for it
and the label's. Amplitudes are shares of what is natural for them; torques, of the rated motor
torque in the frame of the body.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

Numbers = dict[str, float]
Rng = np.random.Generator


@dataclass(frozen=True)
class Setting:
    """What effects are scaled by.

    speed, travel: largest of the records, at the table; peak_torque: of a motor
    end, sample:   s, of the shortest record and between samples
    """

    machine: Mapping[str, float]
    speed: float
    travel: float
    rated_deflection: float
    peak_torque: float
    end: float
    sample: float

    @property
    def drives(self) -> int:
        return int(self.machine.get("drives", 2))

    @property
    def table_torque(self) -> float:
        """Rated torque of one motor, at the table."""
        return self.pinion_torque * self.machine["meshes.ratio"]

    @property
    def pinion_torque(self) -> float:
        return self.machine["motors.T_rated"] * self.machine["gearboxes.ratio"]

    @property
    def motor_torque(self) -> float:
        return self.machine["motors.T_rated"]

    @property
    def motor_speed(self) -> float:
        """Fastest motor speed of the records."""
        return self.speed * self.machine["meshes.ratio"] * self.machine["gearboxes.ratio"]


@dataclass(frozen=True)
class Hidden:
    """One effect, drawn.

    numbers:    of the engine; ``+b_m`` adds to what the machine has
    parameters: of the label, by the library's names where it has them
    without:    what the machine must not have beside it: its sheet is silent there
    recorder:   (channel, s) read late by the recorder alone
    """

    effect: str
    place: str
    equation: str
    numbers: Numbers
    parameters: Numbers
    without: tuple[str, ...] = ()
    recorder: tuple[str, float] | None = None


Draw = Callable[[Setting, float, Rng], Hidden]


@dataclass(frozen=True)
class Entry:
    """strong: amplitude of a strong case; least: smallest share of it that is drawn."""

    strong: float
    least: float
    draw: Draw


EFFECTS: dict[str, Entry] = {}
GROUPS = {"motor": "motors", "pinion": "pinions"}


class UnfitError(RuntimeError):
    """This draw makes no case: no such thing there, or it runs away, or it can not be seen."""


def effect(strong: float, least: float = 1e-3) -> Callable[[Draw], Draw]:
    """Enter a draw under its own name."""

    def enter(draw: Draw) -> Draw:
        EFFECTS[draw.__name__] = Entry(strong, least, draw)
        return draw

    return enter


def draw(name: str, setting: Setting, seed: int, share: float = 1.0) -> Hidden:
    """An effect of that name; `share` of a strong amplitude changes its size and nothing else."""
    entry = EFFECTS[name]
    size = max(share, entry.least) * entry.strong
    return entry.draw(setting, size, np.random.default_rng(seed))


def phase(rng: Rng) -> float:
    """An angle anywhere in the circle."""
    return float(rng.uniform(-np.pi, np.pi))


def pick(s: Setting, rng: Rng, *choices: str) -> str:
    """One of them; of a numbered one any drive's, which of a single drive is the whole group."""
    choice, number = str(rng.choice(choices)), int(rng.integers(1, s.drives + 1))
    stem, _, ending = choice.partition("_")
    if not ending.isdigit():
        return choice
    if s.drives == 1 and stem in GROUPS:
        return GROUPS[stem]
    return f"{stem}_{number}"


def at(place: str) -> str:
    """The engine's ending for a place: ``_1`` for motor_1, nothing for a group."""
    return place[-2:] if place[-2:-1] == "_" and place[-1].isdigit() else ""


def sized(setting: Setting, place: str) -> tuple[str, float, float]:
    """Engine's prefix of a body's friction, its torque scale, its fastest speed."""
    ratio, mesh = setting.machine["gearboxes.ratio"], setting.machine["meshes.ratio"]
    if place == "table":
        return "t_", setting.table_torque, setting.speed
    if place.startswith("pinion"):
        return "p_", setting.pinion_torque, setting.speed * mesh
    return "m_", setting.motor_torque, setting.speed * mesh * ratio


def of_body(place: str) -> str:
    """Which equation an effect on a body breaks."""
    return "table" if place == "table" else "drive"


def without_dry(place: str) -> tuple[str, ...]:
    """Nominal friction that would stand at the same body."""
    return ("dry_table",) if place == "table" else ("dry_pinions",)

"""Every number by which a closed-loop diagnosis decides, in one table."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Threshold:
    """A number that decides, and why it is what it is."""

    value: float
    reason: str


#: name -> number; see docs/theory/innovations.md
THRESHOLDS = {
    "unexplained torque": Threshold(
        0.01,
        "share of the drives' torque, below which a torque of unknown course is no missing law "
        "but what numbers within their tolerances and the noise model leave",
    ),
    "inflation": Threshold(
        4.0,
        "mean square of innovations summed over 1, 50 or 400 samples, 1 where white: more is left "
        "than the noise model can bear",
    ),
    "gain": Threshold(
        25.0,
        "in -2 log L over the inflation, that a law must bring beyond its numbers' share: five "
        "sigma of a single number, so that fifty laws and their orders give no false name",
    ),
    "simulated error": Threshold(
        0.3,
        "headline error of the refitted machine above which nobody would call it adequate, "
        "whatever the statistics say",
    ),
    "certain": Threshold(0.9, "probability from which one name is spoken alone"),
    "possible": Threshold(0.02, "probability from which a rival is counted to the group"),
    "temper": Threshold(
        1.0,
        "power of the likelihood ratio in probabilities, beyond the inflation that already divides "
        "it; smaller where innovations count themselves",
    ),
}


def threshold(name: str) -> float:
    """Its value."""
    return THRESHOLDS[name].value

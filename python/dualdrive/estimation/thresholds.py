"""Every number by which a closed-loop diagnosis decides what to try and what to say.

And those by which a torque balance doubts the data sheet; its own others stand in `judge`. A fit
begins with the same unknown torque on as many samples.
"""

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
    "white": Threshold(
        1.25,
        "the same of a machine that lacks nothing: sums over 400 samples of 30 s at 1 kHz vary by "
        "0.075 (chi-squared), and two empty machines of two generators left 1.00 and 1.07",
    ),
    "inflation": Threshold(
        4.0,
        "mean square of innovations summed over 1, 50 or 400 samples, 1 where white: more is left "
        "than the noise model can bear",
    ),
    "gain": Threshold(
        25.0,
        "in -2 log L over the inflation, that a law must bring beyond its numbers' share: five "
        "sigma of a single number, so that fifty laws and their orders give no false name. The "
        "same of a score, from which a law is tried where numbers alone leave noise",
    ),
    "wide torque": Threshold(
        0.1,
        "of the drives' torque: unknown course at first, so that any machine follows its records",
    ),
    "least torque": Threshold(
        1e-5, "of the drives' torque: the least unknown torque, so that a filter stays steady"
    ),
    "price of a number": Threshold(
        0.02,
        "share of all that is explained, beside the Bayesian criterion's log n: laws are not "
        "exact, and what a second mends of the first is no finding. Set after cases were read",
    ),
    "early": Threshold(
        0.25, "share of that price that a law must gain before the noise is estimated beside it"
    ),
    "runner-up": Threshold(
        0.5,
        "of the leader's gain: a law that alone gains more may be the first of the pair that is "
        "missing. The prototype's share; set after one pair was read. And of the best score, for "
        "a law to be tried where numbers alone leave noise: set after three laws were read",
    ),
    "tied": Threshold(
        0.9,
        "of the best law's gain under a leader's noise, from which another one is as good until "
        "less unknown torque tells; and of what refitted numbers gain over the data sheet's, that "
        "a law must gain beside these to be refitted from there. By hand: five laws of friction "
        "came within 0.93, strangers to 0.74",
    ),
    "clearly": Threshold(
        2.0,
        "of -2 log L over the inflation, by which other numbers must be likelier to lead: less "
        "is where a fit happened to end (its own end is as far)",
    ),
    "orders": Threshold(
        2,
        "of one law that are refitted beside a leader, lest a law of many orders crowds others out",
    ),
    "batches": Threshold(
        32,
        "of all records, over which a law's score is summed for an inflation of its own: a quarter "
        "of it is unsure then. By hand: by a script, of one law, 16 and 64 told 22 and 8 where "
        "32 told 13",
    ),
    "hopeless": Threshold(
        3.0, "gain of a score test, over the inflation, below which no refit is worth its replays"
    ),
    "hopeless beside a law": Threshold(
        10.0,
        "the same beside a law that leaves hardly any torque: what is small is told by its score",
    ),
    "apart": Threshold(
        0.1,
        "of the changes of modes, that may come more than a sample before or after with a law for "
        "a first order to score it. By hand, on two records: laws whose scores were off had 0.12 "
        "to 0.9, most others 0.07 and less",
    ),
    "own size": Threshold(
        2.0,
        "times its own size, or so many times less, that a probe of a local fault beyond its usual "
        "size may tell of: what it says of another is how a record goes another way",
    ),
    "stretches": Threshold(
        8000, "samples that a search looks at, of longer records: 16 places of half a second each"
    ),
    "contenders": Threshold(4, "of what stands on stretches, held against all samples"),
    "beyond": Threshold(
        60.0,
        "of -2 log L over the inflation: what is so much worse on stretches is so on all samples, "
        "and what is so under the noise of a law that leaves noise is no rival of it",
    ),
    "valleys": Threshold(
        2, "sizes, likeliest first under much unknown torque, from which a part is followed"
    ),
    "beyond the floor": Threshold(
        1.35,
        "times what the sensors leave: where a machine leaves more, it is not said that no effect "
        "is missing, nor that the one that is named is all. As `improve` had it; by hand",
    ),
    "simulated error": Threshold(
        0.3,
        "headline error of the refitted machine above which nobody would call it adequate, "
        "whatever the statistics say",
    ),
    "closed": Threshold(
        0.5,
        "of what the refitted machine leaves, simulated, beyond the sensors' noise: what a law "
        "must take away to be what is missing. Set after a false name that took 0.1 was read",
    ),
    "beyond noise": Threshold(
        0.1, "of the sensors' noise: what is less beyond it is no measure of a law"
    ),
    "guessed": Threshold(
        1.0, "relative one-sigma tolerance of a number that may have been a guess, set by hand"
    ),
    "strained": Threshold(
        3.0,
        "of the usual tolerance's sigmas, from which a number that moved speaks against it. By "
        "hand, after one robot axis was read: half and twice, see docs/theory/innovations.md",
    ),
    "cross_validated": Threshold(
        0.8,
        "of the cross-validated error within the usual tolerances: what guesses leave at most for "
        "them to be contradicted. By hand, likewise",
    ),
    "certain": Threshold(0.9, "probability from which one name is spoken alone"),
    "possible": Threshold(0.02, "probability from which a rival is counted to the group"),
}


def threshold(name: str) -> float:
    """Its value."""
    return THRESHOLDS[name].value

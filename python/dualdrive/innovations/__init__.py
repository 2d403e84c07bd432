"""Innovations: the machine as a stochastic grey box, predicted one sample ahead.

The record pulls the state back at every sample (`_core.predict`), so that a model is judged by what
each sample tells that the ones before had not; numbers and noise are estimated by likelihood.
Sources: Kristensen, Madsen, Jørgensen, Automatica 40 (2004) 225-237; Ljung, System Identification.
"""

from __future__ import annotations

from dualdrive.innovations.derivatives import changes, has_sensitivities, slopes
from dualdrive.innovations.greybox import Counter, Filtered, GreyBox
from dualdrive.innovations.harmonics import coordinates, deviations, values, waves
from dualdrive.innovations.homotopy import followed, levels
from dualdrive.innovations.levenberg_marquardt import covariance, fit, inflation, step_within
from dualdrive.innovations.likelihood import Place, maximum_likelihood, score_of_order_two
from dualdrive.innovations.noise import Noise, drive_torque, first_noise, least_noise
from dualdrive.innovations.records import Predictable, predictable
from dualdrive.innovations.stretches import some
from dualdrive.innovations.variant import Point, Variant, carried, flat
from dualdrive.innovations.whole_record import Simulated, simulated

__all__ = [
    "Counter",
    "Filtered",
    "GreyBox",
    "Noise",
    "Place",
    "Point",
    "Predictable",
    "Simulated",
    "Variant",
    "carried",
    "changes",
    "coordinates",
    "covariance",
    "deviations",
    "drive_torque",
    "first_noise",
    "fit",
    "flat",
    "followed",
    "has_sensitivities",
    "inflation",
    "least_noise",
    "levels",
    "maximum_likelihood",
    "predictable",
    "score_of_order_two",
    "simulated",
    "slopes",
    "some",
    "step_within",
    "values",
    "waves",
]

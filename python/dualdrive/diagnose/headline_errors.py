"""The errors that are printed beside a verdict, each of a simulated loop."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dualdrive.diagnose.decision import Decision
from dualdrive.diagnose.findings import TOLD
from dualdrive.diagnose.selection import Selection
from dualdrive.diagnose.simulated_errors import Simulation, noise_floor, of_the_data_sheet
from dualdrive.diagnose.uncertainty import Uncertainty
from dualdrive.innovations import GreyBox, Noise


def headline_errors(
    grey: GreyBox, found: Selection, decision: Decision, sure: Uncertainty
) -> tuple[dict[str, float], dict[str, float], set[str]]:
    """Error of each law by its key, headline errors, and names of the records these leave out."""
    base, stands = found.base, decision.stands(found)
    leaders = [f for f, _ in decision.ranked if f.variant.effects][:TOLD]
    loops = {f.variant.key: Simulation.of(grey, f) for f in (base, *leaders)}
    both = {f.variant.key: f for f in (base, stands)}
    out = _unfollowed(grey, [loops[key] for key in both], decision.best.noise)
    each = {key: loop.error(out) for key, loop in loops.items()}
    held_out = {key: each[key] * sure.cross_validated(f) for key, f in both.items()}
    left = [each[key] for key in both]
    headline = {
        "nominal": of_the_data_sheet(grey).error(out),
        "refitted": each[base.variant.key],
        # what sensors add slowly is extrapolated from a noise model; no machine leaves less of it
        "noise_floor": float(np.fmin.reduce([noise_floor(grey, decision.best, out), *left])),
        "held_out_refitted": held_out[base.variant.key],
        "best": each[stands.variant.key],
        "held_out_best": held_out[stands.variant.key],
        "creeping": loops[stands.variant.key].creeping(stands.noise).error(out),
    }
    return each, headline, out


def _unfollowed(grey: GreyBox, loops: Sequence[Simulation], noise: Noise) -> set[str]:
    """Records that one of these machines can't follow; none where that would leave no record."""
    out = set[str]().union(*(loop.unfollowed(noise) for loop in loops))
    return out if len(out) < len(grey.records) else set()

"""Whether a decision can stand beside its errors, and what the records say of numbers alone."""

from __future__ import annotations

from dataclasses import replace

from dualdrive.diagnose.decision.sanity import (
    asks_for_torque,
    beside_the_data_sheet,
    change_with_time,
    leaves_too_much,
    objection,
    takes_too_little,
    unseen,
)
from dualdrive.diagnose.decision.verdict import Decision, numbers_alone
from dualdrive.diagnose.result import Verdict
from dualdrive.diagnose.selection import Fitted, Selection, lost_without, white
from dualdrive.diagnose.uncertainty import Uncertainty


def upheld(
    found: Selection, decision: Decision, sure: Uncertainty, error: dict[str, float]
) -> tuple[Decision, dict[str, float], str]:
    """Decision and errors that can stand beside one another; if none but unknown can, why."""
    decision = replace(decision, verdict=beside_the_data_sheet(decision.verdict, error))
    verdict, best = decision.verdict, decision.best
    named = verdict in ("effect", "ambiguous")
    noise = named and white(best)  # none is named that asks for much torque
    denials = (
        unseen(verdict, error),
        objection(verdict, error),
        takes_too_little(verdict, error, leaves_noise=noise),
        leaves_too_much(verdict, error),
        _lacks(sure, best, verdict),
    )
    why = next(filter(None, denials), "")
    may_be_numbers = found.quiet and named and not unseen("parameters", error)
    if why and may_be_numbers and not _lacks(sure, found.base, "parameters"):
        alone = {"best": error["refitted"], "held_out_best": error["held_out_refitted"]}
        return numbers_alone(sure, found, decision), {**error, **alone}, ""
    if why:
        decision = replace(decision, verdict="unknown", group=())
    return decision, error, why


def _lacks(sure: Uncertainty, f: Fitted, verdict: Verdict) -> str:
    """Why numbers alone can't be all there is to say, in words; empty where they can."""
    if verdict not in ("adequate", "parameters"):
        return ""
    grey = sure.grey
    changes = change_with_time(sure.changing(f), grey.samples)
    return changes or asks_for_torque(lost_without(grey.core, grey, f))

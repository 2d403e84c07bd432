"""What no verdict may contradict: the errors that are printed beside it."""

from __future__ import annotations

import math
from collections.abc import Mapping

from dualdrive.diagnose.result import Verdict
from dualdrive.diagnose.uncertainty import Changing
from dualdrive.estimation.thresholds import threshold


def objection(verdict: Verdict, error: Mapping[str, float]) -> str:
    """Why a verdict can't stand beside its errors, in words; empty where it can.

    error: headline errors of a diagnosis; NaN where a machine could not be simulated
    """

    def of(name: str) -> float:
        return error.get(name, math.nan)

    if verdict != "unfinished" and of("noise_floor") >= 1.0:
        return f"the sensors' noise ({of('noise_floor'):.0%}) is larger than the signal"
    if verdict in ("effect", "ambiguous"):
        if of("best") >= of("refitted"):
            return (
                f"with the best candidate the error is {of('best'):.3g}, without it "
                f"{of('refitted'):.3g}"
            )
        # where refitted numbers alone do no better, it is not the law that fails there; and what is
        # less than a share of the sensors' noise, where that is known, tells no errors apart
        fails = not of("held_out_best") <= of("held_out_refitted")
        floor = of("noise_floor")
        apart = 0.0 if math.isnan(floor) else threshold("beyond noise") * floor
        if of("held_out_best") > of("nominal") + apart and fails:
            return (
                f"cross-validated, the best candidate leaves {of('held_out_best'):.1%}, the data "
                f"sheet {of('nominal'):.1%}"
            )
    if verdict in ("adequate", "parameters"):
        # of faint motions the sensors alone leave a large share
        noise = threshold("beyond the floor") * of("noise_floor")
        most = noise if noise > threshold("simulated error") else threshold("simulated error")
        if of("refitted") > most:
            return f"the refitted machine still leaves {of('refitted'):.0%}"
        if of("held_out_refitted") > max(of("nominal"), most):
            return f"cross-validated, the refitted machine leaves {of('held_out_refitted'):.0%}"
    return ""


def beside_the_data_sheet(verdict: Verdict, error: Mapping[str, float]) -> Verdict:
    """The same, but numbers that moved without the error falling are none that are off.

    error: as in :func:`objection`
    """
    moved = verdict == "parameters" and error["refitted"] >= error.get("nominal", math.nan)
    return "adequate" if moved else verdict


def removed(refitted: float, fitted: float, floor: float) -> float:
    """Share that a law takes away of what the refitted machine leaves beyond the sensors' noise.

    0 .. 1; NaN where nothing is left beyond it, or a machine could not be simulated.
    """
    beyond, taken = refitted - floor, refitted - fitted
    if not beyond > 0.0 or math.isnan(taken):
        return math.nan
    return min(max(taken / beyond, 0.0), 1.0)


def unseen(verdict: Verdict, error: Mapping[str, float]) -> str:
    """Why a simulated loop can't bear an answer out; empty where it can.

    error: as in :func:`objection`
    """
    if verdict == "unfinished":
        return ""
    if math.isnan(error["noise_floor"]):
        return (
            "no record has a channel that an error is told of: record the table's angle, the "
            "motors' currents or their torques as well"
        )
    named = verdict in ("effect", "ambiguous")
    if verdict != "unknown" and math.isnan(error["best" if named else "refitted"]):
        who = "the machine with the best candidate" if named else "the refitted machine"
        return f"{who} can't be simulated on these records"
    return ""


def takes_too_little(
    verdict: Verdict, error: Mapping[str, float], *, leaves_noise: bool = False
) -> str:
    """Why a law that is likelier is not what is missing from a simulated loop; empty where it is.

    Args:
        verdict: the answer.
        error: as in :func:`objection`.
        leaves_noise: whether what the law leaves of the records is noise. An error that the
            sensors' share is not sure to is no measure then, against all of the likelihood.

    """
    floor, refitted = error["noise_floor"], error["refitted"]
    sure = threshold("beyond the floor") - 1.0 if leaves_noise else threshold("beyond noise")
    beyond = refitted - floor > sure * floor
    taken = removed(refitted, error["best"], floor)
    if verdict not in ("effect", "ambiguous") or not beyond or taken >= threshold("closed"):
        return ""
    return (
        f"the best candidate takes away {taken:.0%} of what the refitted machine leaves "
        "beyond the sensors' noise"
    )


def enough_for(numbers: int, samples: int) -> float:
    """What so many numbers have to gain beyond doubt: what a law must, and the Bayesian price."""
    return threshold("gain") + numbers * math.log(samples)


def change_with_time(changing: Changing, samples: int) -> str:
    """Why a machine of these numbers is not all there is, in words; empty where they stay.

    A number that is let change from block to block is a law of as many numbers more, and weighed
    as any law is.

    Args:
        changing: the number that would change most.
        samples: of all records.

    """
    if not changing.gain > enough_for(changing.numbers, samples):
        return ""
    return (
        f"{changing.name} does not stay: let change from each part of the records to the next it "
        f"takes {changing.gain:.3g} off chi-squared, where noise would let it take about "
        f"{changing.numbers}"
    )


def asks_for_torque(lost: float) -> str:
    """Why a machine without a law is not all there is, in words; empty where it needs no torque.

    However little of a torque of unknown course makes innovations white: it may stand for a law
    that is none of the library's.

    lost: -2 log L over the inflation that it loses without any such torque
    """
    if lost < threshold("gain"):
        return ""
    return (
        "the refitted machine asks for a torque of unknown course, however small: without any, "
        f"-2 log L is {lost:.3g} more, and no law of the library makes that torque"
    )


def creeps(verdict: Verdict, error: Mapping[str, float]) -> str:
    """What to say of dry friction that is not so dry; empty where nothing needs be said.

    error: as in :func:`leaves_too_much`
    """
    left = error["best" if verdict in ("effect", "ambiguous") else "refitted"]
    floor, creeping = error["noise_floor"], error["creeping"]
    if verdict in ("unknown", "unfinished") or not left > threshold("beyond the floor") * floor:
        return ""
    return (
        f"what dry friction holds creeps: the simulated loop, where it rests, leaves {left:.3g}; "
        f"{creeping:.3g} where it follows the record while it is held, the sensors alone "
        f"{floor:.3g}"
    )


def leaves_too_much(verdict: Verdict, error: Mapping[str, float]) -> str:
    """Why an answer is not all there is to say of a simulated loop; empty where nothing speaks so.

    A filter forgives what acts slowly: it asks for hardly any torque where a pitch error or a
    play is missing that carries a simulation to several times what the sensors leave. So a
    hysteresis of no law of the library is nearly as likely to it as bristles, too.

    error: as in :func:`objection`; `creeping`: of what stands, where what dry friction holds
        follows its creep
    """
    floor, named = error["noise_floor"], verdict in ("effect", "ambiguous")
    left = error["creeping"]
    answered = named or verdict in ("adequate", "parameters")
    if not answered or not left > threshold("beyond the floor") * floor:
        return ""
    who = "with the best candidate the simulated loop" if named else "the refitted machine"
    rest = "is not, or not alone, what is missing" if named else "is no machine that lacks nothing"
    return f"{who} leaves {left:.3g}, where the sensors alone would leave {floor:.3g}: that {rest}"

"""Whether a record can have been made by a machine whose numbers are as well known as usual.

Tolerances that nobody gave are those of drawings and catalogues. Where a number was a guess, what
it leaves counts as noise, and so much noise hides every law. The record says so itself: with
nothing added it is foretold far better once the numbers may go where they like.
"""

from __future__ import annotations

import math
from typing import Any

from dualdrive.diagnose.result import Diagnosis
from dualdrive.estimation.thresholds import threshold
from dualdrive.estimation.unknowns import default_tolerances
from dualdrive.units import human


def wrong_guesses(core: Any, held: Diagnosis, free: Diagnosis) -> str:
    """Which numbers of the machine file the record contradicts, in words; empty where it does not.

    held, free: diagnoses within the usual tolerances, and as guesses; that of the free ones
        must have come to a name
    """
    if free.verdict not in ("effect", "ambiguous"):
        return ""
    before, after = (d.error.get("held_out_refitted", math.nan) for d in (held, free))
    usual = default_tolerances(core, list(free.moved))
    far = [
        f"{path} ({human(core.get(path), moved.unit)} in the machine file)"
        for path, moved in free.moved.items()
        if path in usual
        and _apart(core.get(path), moved.value) > threshold("strained") * usual[path]
    ]
    if not far or not after < threshold("cross_validated") * before:
        return ""
    return (
        f"{', '.join(far)} can't be as well known as data sheets are: with nothing added, other "
        f"numbers foretell the record to {100 * after:.3g} instead of {100 * before:.3g} %. All "
        f"numbers were taken for guesses; --tolerance says how well they are known"
    )


def _apart(nominal: float, value: float) -> float:
    """How far a number moved, relative, a factor counting alike both ways."""
    return abs(math.log(value / nominal)) if value * nominal > 0.0 else math.inf

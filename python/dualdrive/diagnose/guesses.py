"""First guesses from the torque balance: numbers from which a refit of the loop may begin.

Where a record of a closed loop holds torques (or currents) and angles, every equation of motion can
be closed on the recorded motion. That is noisier than the loop, but hardly curved: no flank is met
too early or too late, nothing sticks that moved. A strong effect is fitted there in a few hundred
milliseconds, and its refit in the loop then begins in the right valley.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.diagnose import whitening
from dualdrive.diagnose.candidates import SCALES
from dualdrive.diagnose.confront import Confrontation
from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.diagnose.evidence import Evidence, effective, evidence
from dualdrive.diagnose.floors import heard_above
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.diagnose.loads import LOAD, begun, sought
from dualdrive.diagnose.loop import ClosedLoop
from dualdrive.diagnose.refit import Fitter, Refit, Start
from dualdrive.diagnose.stage import Score, Stage, scale_of
from dualdrive.diagnose.starts import near
from dualdrive.diagnose.work import Work

Array = NDArray[np.float64]

_FITTED = 8  # hypotheses
_GAINS = 4.0  # fall of chi^2 over its inflation that makes a fit worth while


@dataclass(frozen=True, eq=False)
class Guesses:
    """Numbers that close the equations of motion.

    nominal: path -> SI value, nothing missing
    by_label: label -> path -> SI value, the machine's and the effect's
    loads: a load in time that was found, its hour as it was fitted
    """

    nominal: Mapping[str, float] = field(default_factory=dict)
    by_label: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    loads: Sequence[Hypothesis] = ()

    def start(self, c: Confrontation, u: Array, label: str = "") -> Start | None:
        """A start in the loop: the machine's numbers from here, all else as in u."""
        known = self.by_label.get(label) if label else self.nominal
        if not known:
            return None
        moved = u.copy()
        for j, p in enumerate(c.nominal):
            if p.path in known:
                moved[j] = p.coordinate(known[p.path])
        return Start(np.clip(moved, c.low, c.high), known)


def guessed(
    c: Confrontation,
    hypotheses: Sequence[Hypothesis],
    work: Work,
    *,
    load: bool = True,
) -> Guesses:
    """Fit what a balance shows of the hypotheses; none where no balance can be drawn up.

    load: whether a load in time is looked for, too
    """
    balance = _balance(c)
    left = balance.left(balance.core, balance.start) if balance is not None else None
    if balance is None or left is None or work.stop():
        return Guesses()
    seen = [h for h in hypotheses if _shows(h)]
    work.tell(f"closing the torque balance with {len(seen)} effects")
    first = evidence(balance, whitening.sized(balance.series, left))
    base = Fitter(first, work.stop).nominal(balance.levelled(balance.core, balance.start))
    if base is None:
        return Guesses()
    noise = evidence(balance, whitening.sized(balance.series, base.left))
    seen += sought(noise, base) if load else []
    fitter = Fitter(noise, work.stop)
    found: list[Refit] = []
    for score in _best(balance, noise, base, seen, work):
        trial = fitter.tried(score.signature.hypothesis, near(score, base.u))
        if trial is not None:
            found.append(fitter(trial, base.slopes))
    found.sort(key=lambda r: r.chi)
    return Guesses(
        _numbers(balance, base),
        {r.hypothesis.label: {**_numbers(balance, r), **r.values()} for r in reversed(found)},
        [begun(r) for r in found if LOAD in r.hypothesis.effects],
    )


def _best(
    balance: TorqueBalance,
    seen: Evidence,
    base: Refit,
    hypotheses: Sequence[Hypothesis],
    work: Work,
) -> list[Score]:
    own = scale_of(seen, base, effective(seen.white(base.left), seen))
    floors = list(map(heard_above, balance.series))
    stage = Stage(balance, base.u, base.left, [own], work, floors)
    scores = stage.scores(stage.listed(hypotheses))
    worth = [s for s in scores if s.gain.gain > _GAINS and not stands_out(s)]
    loads = [s for s in scores if stands_out(s)]
    return [*sorted(worth, key=lambda s: -s.gain.gain)[:_FITTED], *loads]


def stands_out(score: Score) -> bool:
    """Whether it is a load whose hour was looked for: what was found stands out already."""
    return LOAD in score.signature.hypothesis.effects


def _numbers(balance: TorqueBalance, r: Refit) -> dict[str, float]:
    return {p.path: p.value(float(x)) for p, x in zip(balance.nominal, r.u, strict=False)}


def _shows(h: Hypothesis) -> bool:
    """Whether a torque balance shows all its effects."""
    for effect, place in h.effects:
        kind = _core.effect_type(effect)
        channel = place.startswith(("theta_", "omega_", "I_", "T_", "U_"))
        if kind.structural or not kind.in_balance or effect in SCALES or channel:
            return False
    return True


def _balance(c: Confrontation) -> TorqueBalance | None:
    if not isinstance(c, ClosedLoop):
        return None
    try:
        return TorqueBalance(
            c.core,
            {r.name: r.trace for r in c.records},
            {r.name: r.settings for r in c.records},
        )
    except (ValueError, KeyError, StopIteration):
        return None  # no torques, or too little motion

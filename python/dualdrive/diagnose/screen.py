"""Which effects are worth a simulation: a first screen that simulates nothing.

Where a record of a closed loop holds torques (or currents) and angles, every equation of motion can
be closed on the recorded motion; trying an effect there costs a millisecond. The best by that score
are simulated, and with them all that a torque balance does not show: sensors, limits, delays, loose
joints. A balance has more noise than the loop, so that the list is generous.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from dualdrive import _core
from dualdrive.diagnose import whitening
from dualdrive.diagnose.confront import Confrontation
from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.diagnose.evidence import effective, evidence
from dualdrive.diagnose.hypotheses import SCALES, Hypothesis
from dualdrive.diagnose.loop import ClosedLoop
from dualdrive.diagnose.refit import Fitter
from dualdrive.diagnose.score import Scorer
from dualdrive.diagnose.signatures import Prober, score_all, with_orders

if TYPE_CHECKING:
    from dualdrive.diagnose.survey import Clock

#: simulated in any case, by rank; and whatever gains so much
KEPT, GAINS = 10, 12.0


def worth_simulating(
    c: Confrontation,
    hypotheses: Sequence[Hypothesis],
    clock: Clock,
    threads: int,
    tell: Callable[[str], None],
) -> list[Hypothesis]:
    """Those to simulate, the others left out; all of them where no balance can be drawn up."""
    balance = _balance(c)
    if balance is None:
        return list(hypotheses)
    seen = [h for h in hypotheses if _shows(h)]
    hidden = [h for h in hypotheses if not _shows(h)]
    left = balance.left(balance.core, balance.start)
    if left is None:
        return list(hypotheses)
    tell(f"screening {len(seen)} effects by the torque balance")
    first = evidence(balance, whitening.sized(balance.series, left))
    base = Fitter(first, clock.stop).nominal(balance.levelled(balance.core, balance.start))
    if base is None:
        return list(hypotheses)
    noise = evidence(balance, whitening.sized(balance.series, base.left))
    scorer = Scorer(noise.rows(base.u, base.left, base.slopes))
    prober = Prober(
        balance, base.u, base.left, [max(s.floor, 1e-3 * s.spread) for s in balance.series]
    )
    rest = scorer.rest(scorer.rows.left[:, None])[:, 0]
    over = effective(noise.white(base.left), noise)
    scores = score_all(
        prober,
        [(noise, scorer)],
        [over],
        with_orders(noise, rest, seen),
        threads,
        clock.stop,
    )
    gains: dict[str, float] = {}
    for s in scores:
        gains[s.label] = max(gains.get(s.label, 0.0), s.gain.gain)
    ranked = sorted(seen, key=lambda h: -gains.get(h.label, 0.0))
    kept = {h.label for h in ranked[:KEPT]} | {k for k, g in gains.items() if g > GAINS}
    return [h for h in seen if h.label in kept] + hidden


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

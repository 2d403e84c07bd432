"""Signs and order of measured torques, by power: a machine without a source of its own is passive.

What the drives put in, torque times speed, feeds kinetic energy and losses. So the sum of the
torques at the table is a sum of acceleration, speed and the sign of speed, none of them with a
factor below zero (J, b and Coulomb friction in the balance J α + b ω + F sgn ω = Σ r T), beside a
constant and gravity, which turns with the angle. Torques that are turned round, or exchanged where
the ratios differ, leave nothing of that sum for such factors to explain; the ones that a sign was
lost from explain it once turned back. Where the ratios are alike an exchange leaves the sum as it
was; then the drive that pushes harder must be the one that is twisted further ahead.

The factors are fitted by least squares with none below zero (C. Lawson, R. Hanson, Solving Least
Squares Problems, 1974), so that no number of the machine but its ratios is asked for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.echo import once
from dualdrive.identify.coloured import correlation_time
from dualdrive.identify.filtering import ANGLES, Piece, Processing, pieces
from dualdrive.replay import ratio_to_table

Array = NDArray[np.float64]

#: signs show in slow motion, where torque is largest
FILTER = Processing(decimate=10)
_HALF = 0.5  # of what the torques as recorded leave unexplained, at most, once turned round
_NOTHING = 0.1  # of what they explain turned round: explained as recorded, it is nothing
_LEAST = 0.1  # share that must be explained at all
_CLEAR = 0.6  # share of the drives' difference that their twist must explain to tell them apart
#: twice the logarithm of a likelihood ratio, samples counted as far as they are independent: very
#: strong evidence (R. Kass, A. Raftery, Journal of the American Statistical Association 90, 1995)
_SURE = 10.0


@dataclass(frozen=True)
class TorqueDoubt:
    """What is wrong with the torques of a record, by power.

    code:     ``sign`` or ``swapped``
    torques:  channels that are turned round or exchanged
    recorded: share of the torque that inertia and losses explain as recorded; mended: once
              `torques` are turned round or exchanged
    work:     that the drives put in over the record, J (at the table's side of the ratios)
    message:  one sentence with a way out, without the record's name
    """

    code: str
    torques: tuple[str, ...]
    recorded: float
    mended: float
    work: float
    message: str


def torque_doubts(core: Any, trace: Any) -> list[TorqueDoubt]:
    """Say which measured torques of a record are turned round, or exchanged.

    Args:
        core: the core's machine, asked for its motors and ratios alone.
        trace: has ``t`` and ``channels`` (SI): every motor's torque and an angle or speed.

    Returns:
        None, one or more doubts; none for a record too short for the filters, or one that lacks a
        motor's torque.

    """
    known = _torques_of(core, trace)
    if known is None:
        return []
    seen, own = known
    found = list(_turned(seen, own))
    return found if found or len(own) != 2 else list(_exchanged(seen, own))


def whose_is_open(core: Any, trace: Any) -> str:
    """Why a record can't tell which of two torques is whose, in words; empty where it can.

    Their sum at the table is the same either way where the ratios are alike. What tells them apart
    is the drives' twist, which tension makes; without it, or without the drives' angles, nothing
    does. Arguments as of `torque_doubts`.
    """
    known = _torques_of(core, trace)
    if known is None or len(known[1]) != 2 or list(_turned(*known)):
        return ""
    seen, own = known
    first, second = own
    apart = seen.apart()
    if apart is None:
        why = "the drives' angles are not recorded"
    else:
        recorded, other = _twisted(seen, own, apart)
        if max(recorded.part, other.part) >= _CLEAR:
            return ""
        why = (
            f"what holds the drives apart explains {recorded.part:.0%} of {first} - {second}, and "
            f"{other.part:.0%} were they exchanged; a record under more tension may tell"
        )
    return (
        f"which of {first} and {second} is whose this record can't tell: {why}. Their sum is the "
        "same either way; what is said of one drive alone hangs on the mapping"
    )


def _torques_of(core: Any, trace: Any) -> tuple[_Seen, dict[str, Array]] | None:
    """A moving record's filtered signals, and each motor's torque at the table; or None."""
    names = {motor: f"T_{motor.rpartition('_')[2]}" for motor in core.motors}
    if not names or not set(names.values()) <= set(trace.channels):
        return None
    try:
        parts = list(pieces(trace, str(getattr(trace, "name", "")), FILTER))
    except ValueError:
        return None
    seen = _Seen(core, parts, FILTER)
    if not seen.moves:
        return None
    return seen, {n: seen.torque(n, ratio_to_table(core, m)) for m, n in names.items()}


def torque_notes(core: Any, traces: Mapping[str, Any]) -> list[str]:
    """What several records, name -> trace, can't tell of their torques, in words, by name."""
    told = {name: whose_is_open(core, trace) for name, trace in traces.items()}
    return once((f"{name}: {words}" for name, words in told.items() if words), traces)


def torque_warnings(core: Any, traces: Mapping[str, Any]) -> list[str]:
    """`torque_doubts` of several records, name -> trace, in words, each with its record's name."""
    told = [
        f"{name}: {doubt.message}"
        for name, trace in traces.items()
        for doubt in torque_doubts(core, trace)
    ]
    return once(told, traces)


class _Seen:
    """Filtered signals of a record, all its pieces end to end."""

    def __init__(self, core: Any, parts: Sequence[Piece], process: Processing) -> None:
        self.core, self.parts, self.process = core, parts, process
        self._motion = self._common()

    @property
    def moves(self) -> bool:
        """Whether any body's motion is recorded, and there is any."""
        return self._motion is not None and bool(np.any(self.of(self._part(1))))

    @property
    def lasts(self) -> float:
        """How long the pieces last that are looked at, s."""
        kept = (
            len(self.process.kept(len(p), p.step)) * self.process.every(p.step) * p.step
            for p in self.parts
        )
        return float(sum(kept))

    def of(self, signal: Callable[[Piece], Array]) -> Array:
        """One signal of every piece through the filter that both sides of a balance pass."""
        return np.concatenate([self.process.reduce(signal(p), p.step) for p in self.parts])

    def torque(self, name: str, ratio: float) -> Array:
        """A motor's torque carried to the table; angles have passed the low-pass, so it does."""
        return self.of(lambda p: ratio * self.process.low_pass(p.samples[name], p.step))

    def passive(self) -> Array:
        """What takes torque whichever way the machine moves: (n, 3), inertia and losses."""
        rows = [self.of(self._part(2)), self.of(self._part(1))]
        rows.append(self.of(lambda p: np.sign(self._part(1)(p))))
        return np.stack(rows, axis=1)

    def open(self) -> Array:
        """What may take torque either way: a constant, and gravity where an angle is known."""
        rows = [self.of(lambda p: np.ones(len(p)))]
        assert self._motion is not None
        if self._motion[0] in self.parts[0].samples:
            rows.append(self.of(lambda p: np.sin(self._part(0)(p))))
            rows.append(self.of(lambda p: np.cos(self._part(0)(p))))
        return np.stack(rows, axis=1)

    def speed(self) -> Array:
        """Of the table, or what stands for it, rad/s."""
        return self.of(self._part(1))

    def apart(self) -> Array | None:
        """How far drive 1 is ahead of drive 2, and its acceleration: (n, 2); None if not known."""
        angles = [_angle_of(self.core, self.parts[0].samples, n) for n in "12"]
        if any(a is None for a in angles):
            return None
        (one, first), (two, second) = [a for a in angles if a is not None]

        def differ(k: int) -> Array:
            a, b = ((name, *ANGLES[name])[k] for name in (one, two))
            return self.of(lambda p: p.samples[a] / first - p.samples[b] / second)

        return np.stack([differ(0), differ(2)], axis=1)

    def _part(self, k: int) -> Callable[[Piece], Array]:
        """Angle, speed or acceleration of the table, from whatever tells it."""
        assert self._motion is not None
        name, ratio = self._motion
        own = (name, *ANGLES[name])[k]
        return lambda p: p.samples[own] / ratio

    def _common(self) -> tuple[str, float] | None:
        samples = self.parts[0].samples
        if ANGLES["theta_m"][0] in samples:
            return "theta_m", 1.0
        found = (_angle_of(self.core, samples, m.rpartition("_")[2]) for m in self.core.motors)
        return next((f for f in found if f is not None), None)


def _angle_of(core: Any, samples: Any, n: str) -> tuple[str, float] | None:
    """The angle that tells how a drive moves, and how often it turns for the table's once."""
    for angle, part in ((f"theta_{n}", f"motor_{n}"), (f"theta_c{n}", f"pinion_{n}")):
        if ANGLES[angle][0] in samples:
            return angle, ratio_to_table(core, part)
    return None


def _turned(seen: _Seen, own: dict[str, Array]) -> list[TorqueDoubt]:
    """Torques that feed inertia and losses only once they are turned round."""
    passive, free, speed = seen.passive(), seen.open(), seen.speed()
    names, each = list(own), np.stack(list(own.values()))
    share = {
        signs: _explained(np.array(signs) @ each, passive, free)
        for signs in product((1.0, -1.0), repeat=len(names))
    }
    as_recorded = share[(1.0,) * len(names)]
    best = max(share, key=lambda signs: share[signs].part)
    turned = tuple(n for s, n in zip(best, names, strict=True) if s < 0.0)
    work = {n: float(np.mean(own[n] * speed)) * seen.lasts for n in names}
    # a drive that holds against the other gives as much one way as it takes the other
    if not turned or not all(work[n] < 0.0 for n in turned):
        return []
    if not _better(share[best], as_recorded):
        return []
    several = len(turned) > 1
    which = " and ".join(f"{n} (or I{n[1:]})" for n in turned)
    exchanged = " (or exchange them, if one has a sign of its own already)" if several else ""
    message = (
        f"{which} push{'' if several else 'es'} against the motion that "
        f"{'they' if several else 'it'} should make: {sum(work[n] for n in turned):.3g} J over the "
        f"record, where a machine can only take work. As recorded, inertia and losses explain "
        f"{as_recorded.part:.0%} of the torque, turned round {share[best].part:.0%}; turn "
        f"{'both' if several else 'it'} round with sign = -1 in the mapping{exchanged}, or turn "
        "the angles round"
    )
    return [
        TorqueDoubt("sign", turned, as_recorded.part, share[best].part, sum(work.values()), message)
    ]


def _exchanged(seen: _Seen, own: dict[str, Array]) -> list[TorqueDoubt]:
    """Torques of two drives of which the one that pushes less is twisted further ahead."""
    apart = seen.apart()
    if apart is None:
        return []
    (first, one), (second, two) = own.items()
    recorded, other = _twisted(seen, own, apart)
    if other.part < _CLEAR or not _better(other, recorded):
        return []
    work = float(np.mean((one + two) * seen.speed())) * seen.lasts
    message = (
        f"the torques (or currents) of motors 1 and 2 look exchanged: the drive that pushes harder "
        f"is twisted back, not ahead. What holds the drives apart explains {recorded.part:.0%} of "
        f"{first} - {second}, and {other.part:.0%} once they are exchanged; exchange {first} and "
        f"{second} in the mapping, or the drives' angles"
    )
    return [TorqueDoubt("swapped", (first, second), recorded.part, other.part, work, message)]


def _twisted(seen: _Seen, own: dict[str, Array], apart: Array) -> tuple[_Share, _Share]:
    """What the drives' twist explains of the difference of their torques, and exchanged."""
    # friction and inertia of either drive, and a late encoder, part them too: no evidence
    beside = np.concatenate([seen.open(), seen.passive()], axis=1)
    one, two = own.values()
    return _explained(one - two, apart, beside), _explained(two - one, apart, beside)


@dataclass(frozen=True)
class _Share:
    """Share of a torque's square that passive terms explain, 0 .. 1, and effective samples."""

    part: float
    effective: float


def _explained(torque: Array, passive: Array, free: Array) -> _Share:
    """Torque (n,), passive (n, k) with factors of zero and more, free (n, m) with any."""
    from scipy.optimize import nnls

    own, _ = np.linalg.qr(free)
    target = torque - own @ (own.T @ torque)
    columns = passive - own @ (own.T @ passive)
    size = np.linalg.norm(columns, axis=0)
    columns = columns / np.where(size > 0.0, size, 1.0)
    whole = float(target @ target)
    if whole <= 1e-18 * float(torque @ torque) or not np.any(size > 0.0):
        return _Share(0.0, 0.0)
    factors, _ = nnls(columns, target)
    left = target - columns @ factors
    alike = 1.0 + 2.0 * correlation_time(left)
    return _Share(1.0 - float(left @ left) / whole, len(torque) / alike)


def _better(turned: _Share, recorded: _Share) -> bool:
    """Whether the other reading explains what the recorded one does not, beyond doubt."""
    rest, now = 1.0 - turned.part, 1.0 - recorded.part
    clearly = rest < _HALF * now or recorded.part < _NOTHING * turned.part
    gain = turned.effective * math.log(max(now, 1e-12) / max(rest, 1e-12))
    return turned.part > _LEAST and clearly and gain > _SURE

"""The noise of a grey box: sensors with a memory, torques of unknown course, and creep."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dualdrive.replay import ratio_to_table

if TYPE_CHECKING:
    from dualdrive.innovations.records import Predictable

Array = NDArray[np.float64]

_LEAST_MEMORY = -0.5
_MOST_SECOND = 0.95
_COURSE = 0.1  # s: over which a torque of unknown course changes
#: of a body's RMS speed as commanded: its creep at first, and the least
CREEP, LEAST_CREEP = 1e-3, 1e-6
_WANDER = 0.2  # s: over which a sensor's zero drifts
_DRIFT = 0.3  # of what drives a sensor's noise: its zero's drift at first
_SHORTEST, _LONGEST = 10.0, 1e6  # samples: over which a zero may drift, where that is sought
_ALIKE = 1e-6  # of a sample: records' clocks that differ by rounding
_FARTHEST = 14.0  # of a logarithm, from where the search began
_INITIAL = (1e-3, 100.0)  # lowest and highest: beside them a first state is known, or not at all
#: of what drives a sensor's noise at first: less is none, and the less the fainter the slope that
#: leads back, since a likelihood knows a deviation by its square
_FAINT = 1.0 / 30.0


@dataclass(frozen=True)
class Noise:
    """Standard deviations and poles per sample of `step` s.

    Over samples of another length what forgets over a time is as large and forgets over the same.

    drive:  kind of channel -> what drives its autoregression, SI of the channel
    memory: kind of channel -> its pole over a sample, 0 white .. 1 a random walk; of an
        autoregression of order two the first partial autocorrelation
    second: kind of channel -> the second one, -1 .. 1; empty: of order one
    torque: body -> what drives the torque of unknown course there, constant over a sample, N*m in
        the body's own frame; empty: the replay is a simulation
    course: pole over a sample of these torques, an autoregression of order one, too
    creep:  body -> what drives its speed while dry friction holds it, another one of that pole,
        rad/s; empty: it does not move
    drift:  kind of channel -> what drives its zero, another one, SI of the channel; empty: none
    wander: kind of channel -> pole over a sample of that zero
    seeks: whether a search of the noise seeks these poles, too
    step: s; 0: a sample of any record
    initial: of what is not known of a first state, its standard deviation over that of a first
        guess; see `GreyBox.steady`
    """

    drive: Mapping[str, float]
    memory: Mapping[str, float]
    torque: Mapping[str, float]
    course: float = 0.0
    drift: Mapping[str, float] = field(default_factory=dict)
    wander: Mapping[str, float] = field(default_factory=dict)
    second: Mapping[str, float] = field(default_factory=dict)
    seeks: bool = False
    creep: Mapping[str, float] = field(default_factory=dict)
    step: float = 0.0
    initial: float = 1.0

    def _over(self, record: Predictable, drive: float, memory: float) -> tuple[float, float]:
        """An autoregression of order one over the samples of a record, its variance the same."""
        samples = record.sampled.step / self.step if self.step > 0.0 else 1.0
        if abs(samples - 1.0) < _ALIKE or not 0.0 < memory < 1.0:
            return drive, memory
        own = memory**samples
        return drive * float(np.sqrt(_unforgotten(own, memory))), own

    def torques(self, record: Predictable) -> dict[str, tuple[float, float]]:
        """Body -> (drive, memory)."""
        return {body: self._over(record, s, self.course) for body, s in self.torque.items()}

    def creeps(self, record: Predictable) -> dict[str, tuple[float, float]]:
        """Body -> (drive, memory) of its speed while dry friction holds it."""
        return {body: self._over(record, s, self.course) for body, s in self.creep.items()}

    def sensors(self, record: Predictable) -> list[tuple[float, float, float]]:
        """(drive, memory, white part of the rounding) per channel of a record."""

        def own(kind: str) -> tuple[float, float]:
            drive, memory = self.drive[kind], self.memory[kind]
            # a memory of two samples is none of a time
            return (drive, memory) if self.second else self._over(record, drive, memory)

        return [
            (*own(kind), step / np.sqrt(12.0))
            for kind, step in zip(record.kinds, record.steps, strict=True)
        ]

    def variance(self, record: Predictable) -> dict[str, float]:
        """Channel -> variance of its sensor's noise, drift and rounding with it."""
        drifts = self.drifts(record) or [(0.0, 0.0)] * len(record.channels)
        seconds = self.seconds(record) or [0.0] * len(record.channels)
        parts = zip(record.channels, self.sensors(record), drifts, seconds, strict=True)
        return {
            channel: _variance(drive, memory) / (1.0 - second**2) + white**2 + _variance(*drift)
            for channel, (drive, memory, white), drift, second in parts
        }

    def drifts(self, record: Predictable) -> list[tuple[float, float]]:
        """(drive, memory) per channel of a record; empty where no zero drifts."""
        if not self.drift:
            return []
        return [self._over(record, self.drift[kind], self.wander[kind]) for kind in record.kinds]

    def seconds(self, record: Predictable) -> list[float]:
        """Second partial autocorrelation per channel of a record; empty where of order one."""
        return [self.second[kind] for kind in record.kinds] if self.second else []

    def densities(self, record: Predictable, frequency: Array) -> Array:
        """Spectral densities of torques of unknown course, by body, and of the sensors' noise.

        Args:
            record: over whose samples.
            frequency: rad a sample, shape (n,).

        Returns:
            Shape (bodies + channels, n), 1 of white noise of unit variance.

        """
        torques, channels = self.torques(record), len(record.channels)
        sensors = self.sensors(record)
        seconds = self.seconds(record) or [0.0] * channels
        own = [
            (drive, memory * (1.0 - second), second)
            for (drive, memory, _), second in zip(sensors, seconds, strict=True)
        ]
        own += [(drive, memory, 0.0) for drive, memory in self.drifts(record)]
        own += [(*torques[body], 0.0) for body in sorted(torques)]
        found = _densities(np.array(own), frequency)
        heard = found[:channels] + np.array([[white**2] for _, _, white in sensors])
        if self.drift:
            heard += found[channels : 2 * channels]
        return np.concatenate([found[len(own) - len(torques) :], heard])

    def of_order_two(self) -> Noise:
        """The same, its sensors' noise free to be of order two."""
        return replace(self, second=dict.fromkeys(self.drive, 0.0))

    def slower(self, factor: float) -> Noise:
        """The same, zeros drifting as far but `factor` times as slowly, and that sought, too."""
        wander = {kind: pole ** (1.0 / factor) for kind, pole in self.wander.items()}
        drift = {
            kind: float(s * np.sqrt((1.0 - wander[kind] ** 2) / (1.0 - self.wander[kind] ** 2)))
            for kind, s in self.drift.items()
        }
        return replace(self, drift=drift, wander=wander, seeks=True)

    def creeping(self, speeds: Mapping[str, float], share: float = CREEP) -> Noise:
        """The same where these bodies may creep, and no others.

        Args:
            speeds: body -> its RMS speed as commanded, rad/s.
            share: of that speed, of a creep that is not known yet.

        """
        drive = share * float(np.sqrt(1.0 - self.course**2))
        return replace(self, creep={b: self.creep.get(b, drive * v) for b, v in speeds.items()})

    def of_a_simulation(self, records: Sequence[Predictable]) -> Noise:
        """Sensors that forget at once, as noisy as they are, no torque, and what creeps."""
        most: dict[str, float] = {}
        for r in records:
            sensors = zip(self.variance(r).values(), self.sensors(r), strict=True)
            for kind, (variance, (_, _, rounding)) in zip(r.kinds, sensors, strict=True):
                own = max(0.0, variance - rounding**2)  # rounding comes to each record by itself
                most[kind] = max(most.get(kind, 0.0), float(np.sqrt(own)))
        return Noise(
            most, dict.fromkeys(most, 0.0), {}, self.course, creep=self.creep, step=self.step
        )

    def with_torque(self, factor: float) -> Noise:
        """The same with torques of unknown course `factor` times as large."""
        return replace(self, torque={body: factor * s for body, s in self.torque.items()})

    def at_least(self, floor: Noise | None) -> Noise:
        """The same with nothing less driving the torques of unknown course than another noise."""
        known = floor.torque if floor else {}
        least = {body: max(s, known.get(body, 0.0)) for body, s in self.torque.items()}
        return replace(self, torque=least)


def first_noise(core: Any, records: Sequence[Predictable], share: float) -> Noise:
    """A first guess from the records alone, torques wide so that any machine follows them.

    share: of the RMS drive torque, standard deviation of the torque of unknown course
    """
    rough: dict[str, list[float]] = {}
    for r in records:
        for kind, y in zip(r.kinds, r.measured.T, strict=True):
            # third differences of white noise are sqrt(20) times as large; motion hardly has any
            rough.setdefault(kind, []).append(float(np.std(np.diff(y, 3))) / np.sqrt(20.0))
    drive = {kind: max(float(np.median(s)), 1e-300) for kind, s in rough.items()}
    # of the shortest: what forgets over several of them has forgotten over a longer one
    step = float(min(r.sampled.step for r in records))
    course = float(np.exp(-step / _COURSE))
    scale = share * float(np.sqrt(1.0 - course**2))
    torque = {body: scale * s for body, s in drive_torque(core, records).items()}
    wander = float(np.exp(-step / _WANDER))
    drift = {kind: _DRIFT * s * float(np.sqrt(1.0 - wander**2)) for kind, s in drive.items()}
    wanders = dict.fromkeys(drive, wander)
    memory = dict.fromkeys(drive, 0.5)
    return Noise(drive, memory, torque, course, drift, wanders, step=step)


def least_noise(core: Any, records: Sequence[Predictable], share: float) -> Noise:
    """What a search of the noise does not go below: beside it there is none.

    share: of the RMS drive torque, standard deviation of the torque of unknown course
    """
    found = first_noise(core, records, share)
    drive = {kind: _FAINT * s for kind, s in found.drive.items()}
    return replace(found, drive=drive, drift={kind: _FAINT * s for kind, s in found.drift.items()})


def drive_torque(core: Any, records: Sequence[Predictable]) -> dict[str, float]:
    """RMS of what the drives gave over the records, N*m: each motor's, and all of it at the table.

    Torques or currents where they are recorded, a tenth of the rated torque else.
    """
    squares: dict[str, list[float]] = {}
    for r in records:
        for channel, y in zip(r.channels, r.measured.T, strict=True):
            stem, _, n = channel.partition("_")
            if stem in ("I", "T") and f"motor_{n}" in core.motors:
                factor = core.get(f"motor_{n}.K_d") if stem == "I" else 1.0
                squares.setdefault(f"motor_{n}", []).append(float(np.mean((factor * y) ** 2)))
    known = {motor: float(np.sqrt(np.mean(s))) for motor, s in squares.items()}
    usual = float(np.mean(list(known.values()))) if known else _rated(core)
    found = {motor: known.get(motor, usual) for motor in core.motors}
    table = sum((ratio_to_table(core, motor) * t) ** 2 for motor, t in found.items())
    return {**found, "table": float(np.sqrt(table))}


def _rated(core: Any) -> float:
    rated = [core.get(f"{motor}.T_rated") for motor in core.motors]
    finite = [x for x in rated if np.isfinite(x)]
    return 0.1 * float(np.mean(finite)) if finite else 1.0


class _Parts(NamedTuple):
    """Whose logarithms come one after the other; `wander` of those drifts whose time is sought."""

    drive: tuple[str, ...]
    memory: tuple[str, ...]
    drift: tuple[str, ...]
    wander: tuple[str, ...]
    second: tuple[str, ...]
    torque: tuple[str, ...]
    creep: tuple[str, ...]
    initial: tuple[str, ...] = ("initial",)


class Logarithms:
    """A noise as a vector of logarithms, torques and creep of the motors tied.

    noise: where all of them are zero
    floor: less drives nothing; None: there is no least
    """

    def __init__(self, noise: Noise, floor: Noise | None = None) -> None:
        self.noise, self.floor = noise, floor
        self.kinds = tuple(sorted(noise.drive))
        self.ties = tuple(sorted({_tie(body) for body in noise.torque}))
        self.creeping = {_tie(body): body for body in sorted(noise.creep)}

    def __len__(self) -> int:
        return sum(map(len, self._parts()))

    def _parts(self) -> _Parts:
        drifting = tuple(sorted(self.noise.drift))
        sought = drifting if self.noise.seeks else ()
        second, creeping = tuple(sorted(self.noise.second)), tuple(self.creeping)
        return _Parts(self.kinds, self.kinds, drifting, sought, second, self.ties, creeping)

    @property
    def second(self) -> range:
        """Places of the second partial autocorrelations."""
        parts = self._parts()
        first = sum(map(len, parts[: _Parts._fields.index("second")]))
        return range(first, first + len(parts.second))

    @property
    def everything(self) -> range:
        """Places of all."""
        return range(len(self))

    @property
    def unheard(self) -> range:
        """Places of those that no spectrum tells: of bodies at rest, and of first states."""
        parts = self._parts()
        return range(len(self) - len(parts.creep) - len(parts.initial), len(self))

    def _of(self, x: Array) -> list[dict[str, float]]:
        """Of every part, name -> logarithm."""
        found, first = [], 0
        for part in self._parts():
            found.append(dict(zip(part, map(float, x[first : first + len(part)]), strict=True)))
            first += len(part)
        return found

    def at(self, x: Array) -> Noise:
        """The noise at a vector; zero is the one it was begun with."""
        own = self.noise
        grown, kept, far, slow, seconds, torques, creeps, initial = self._of(x)
        drive = {**own.drive, **{k: float(own.drive[k] * np.exp(v)) for k, v in grown.items()}}
        memory = {**own.memory, **{k: _memory(_logit(own.memory[k]) + v) for k, v in kept.items()}}
        wander = {k: float(pole ** np.exp(-slow.get(k, 0.0))) for k, pole in own.wander.items()}
        drift = {
            k: float(own.drift[k] * np.exp(v) * np.sqrt(_unforgotten(wander[k], own.wander[k])))
            for k, v in far.items()
        }
        second = {k: _memory(_logit(own.second[k]) + v) for k, v in seconds.items()}
        factor = {tie: float(np.exp(v)) for tie, v in torques.items()}
        torque = {body: float(s * factor.get(_tie(body), 1.0)) for body, s in own.torque.items()}
        creep = {body: float(s * np.exp(creeps[_tie(body)])) for body, s in own.creep.items()}
        found = replace(
            own, drive=drive, memory=memory, torque=torque, drift=drift, wander=wander,
            second=second, creep=creep, initial=float(own.initial * np.exp(initial["initial"])),
        )  # fmt: skip
        return found.at_least(self.floor)

    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest of every logarithm; a memory's are those of a pole."""
        own, floor = self.noise, self.floor
        ends = _above(own.drive, floor.drive if floor else {})
        for kind in self.kinds:
            pole = _logit(own.memory[kind])
            # what changes more slowly than a torque of unknown course is no sensor's noise
            ends.append((_logit(_LEAST_MEMORY) - pole, _logit(own.course) - pole))
        ends += _above(own.drift, floor.drift if floor else {})
        for kind in sorted(own.drift) if own.seeks else ():
            samples = -1.0 / np.log(own.wander[kind])
            ends.append((float(np.log(_SHORTEST / samples)), float(np.log(_LONGEST / samples))))
        for kind in sorted(own.second):
            known = _logit(own.second[kind])
            ends.append((_logit(-_MOST_SECOND) - known, _logit(_MOST_SECOND) - known))
        ends += [(-_FARTHEST, _FARTHEST)] * len(self.ties)
        first = {body: own.creep[body] for body in self.creeping.values()}
        ends += _above(first, floor.creep if floor else {})
        least, most = _INITIAL
        ends.append((float(np.log(least / own.initial)), float(np.log(most / own.initial))))
        low, high = np.array(ends).T
        return np.minimum(low, 0.0), np.maximum(high, 0.0)


def _above(own: Mapping[str, float], least: Mapping[str, float]) -> list[tuple[float, float]]:
    """Lowest and highest logarithms of drives, in the order of their kinds."""
    return [
        (float(np.log(least[kind] / own[kind])) if kind in least else -_FARTHEST, _FARTHEST)
        for kind in sorted(own)
    ]


def _densities(own: Array, frequency: Array) -> Array:
    """Of autoregressions of order two, shape (autoregressions, frequencies).

    |1 - a z - b z^2|^-2, z the delay by a sample, without cancelling where a is nearly 1.

    own: what drives each, and its coefficients a and b, shape (autoregressions, 3)
    """
    drive, first, second = own.T[:, :, None]
    slow, fast = np.sin(0.5 * frequency) ** 2, np.sin(frequency) ** 2
    left = (1.0 - first - second) ** 2
    found: Array = drive**2 / (left + 4.0 * (first * (1.0 - second) * slow + second * fast))
    return found


def _variance(drive: float, memory: float) -> float:
    """Of an autoregression of order one."""
    return drive**2 / max(1.0 - memory**2, 1e-6)


def _unforgotten(pole: float, before: float) -> float:
    """By how much less drives an autoregression as far with another pole, as variances."""
    return max(1.0 - pole**2, 1e-15) / max(1.0 - before**2, 1e-15)


def _tie(body: str) -> str:
    """Motors are alike."""
    return body.rpartition("_")[0] if body.rpartition("_")[2].isdigit() else body


def _logit(memory: float) -> float:
    return float(np.log((1.0 + memory) / (1.0 - memory)))


def _memory(x: float) -> float:
    return float(np.tanh(0.5 * x))

"""From recorded angles to speeds and accelerations, and the same filter for both sides.

A torque balance compares ``inertia * acceleration + friction + ...`` with a measured torque. Angles
must be differentiated twice, so they pass a zero-phase low-pass first; then *both* sides of the
equation pass one more common filter and are decimated. Any linear filter common to both sides
leaves the parameters unbiased, while a filter on one side alone is a time skew that poses as
friction or compliance (M. Gautier, "Dynamic identification of robots with power model", ICRA 1997;
A. Janot et al., "Data set and reference models of EMPS", 2019).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.traces.names import DRIVES

Array = NDArray[np.float64]

#: pass-band ripple of the decimation filter in dB
RIPPLE = 0.05

_NOISY = 0.01  # of the acceleration's mean square that may be an encoder's noise
_ENDS = 0.2  # of a record that the ends of the filters may take
_LOWER = 0.9  # times a cutoff: the next one that is tried
_SPECTRUM = 256  # samples; fewer show no spectrum

#: recorded angle -> the names of its two derivatives
ANGLES = {
    f"theta_{place}": (f"omega_{place}", f"alpha_{place}")
    for place in ("m", *map(str, DRIVES), *(f"c{n}" for n in DRIVES))
}


@dataclass(frozen=True)
class Processing:
    """How a trace is prepared for a torque balance; every choice is printed with the result.

    Args:
        cutoff: -3 dB frequency in Hz of one pass of the Butterworth low-pass; unless given a tenth
            of the sampling rate, or less where an encoder's noise asks for it, see
            :func:`for_records`.
        order: of the Butterworth low-pass, run forwards and backwards.
        decimate: every n-th sample is kept, behind a zero-phase Chebyshev filter (order 8, 0.05 dB,
            0.8 of the new Nyquist frequency) on both sides of the balance; 1 keeps all. Unless
            given as many as leave what is below the cutoff: 4 at a tenth of the sampling rate.
        trim: seconds dropped at either end of each continuous piece, where the filters start
            up; ``10 / cutoff`` unless given.
        max_gap: a pause longer than this many sampling intervals ends a piece; shorter ones are
            bridged linearly.

    Raises:
        ValueError: a number outside its range.

    """

    cutoff: float | None = None
    order: int = 4
    decimate: int | None = None
    trim: float | None = None
    max_gap: float = 5.0

    def __post_init__(self) -> None:
        rules = (
            (self.cutoff is None or self.cutoff > 0, "cutoff", "must be positive"),
            (self.order >= 1, "order", "must be at least 1"),
            (self.decimate is None or self.decimate >= 1, "decimate", "must be at least 1"),
            (self.trim is None or self.trim >= 0, "trim", "must not be negative"),
            (self.max_gap >= 1, "max_gap", "must be at least 1 sampling interval"),
        )
        for holds, name, rule in rules:
            if not holds:
                raise ValueError(f"Processing: {name} = {getattr(self, name)} {rule}")

    def at(self, step: float) -> Processing:
        """The same choices with nothing left open, for samples ``step`` seconds apart."""
        cutoff = 0.1 / step if self.cutoff is None else self.cutoff
        if cutoff >= 0.5 / step:
            raise ValueError(
                f"Processing: cutoff = {cutoff:g} Hz is not below half the sampling rate, "
                f"{0.5 / step:g} Hz; choose a lower cutoff or leave it open"
            )
        trim = 10.0 / cutoff if self.trim is None else self.trim
        kept = self.decimate
        if kept is None:
            # the Chebyshev filter passes 0.8 of half the new rate; rounding is no reason for less
            kept = max(1, int(0.8 * 0.5 / (cutoff * step) * (1.0 + 1e-9)))
        return Processing(cutoff, self.order, kept, trim, self.max_gap)

    def every(self, step: float) -> int:
        """Which of the samples ``step`` seconds apart are kept: every n-th."""
        kept = self.at(step).decimate
        assert kept is not None
        return kept

    def low_pass(self, signal: Array, step: float) -> Array:
        """Zero-phase Butterworth low-pass along the last axis."""
        own = self.at(step)
        assert own.cutoff is not None
        return _forward_backward(_butterworth(own.order, 2 * own.cutoff * step), signal)

    def reduce(self, signal: Array, step: float) -> Array:
        """What either side of the balance goes through: low-pass, decimate, drop the ends."""
        smooth = self.low_pass(signal, step)
        if (kept := self.every(step)) > 1:
            at_rest = 10 ** (-RIPPLE / 10)  # an even order sits at the foot of its ripple, twice
            smooth = _forward_backward(_chebyshev(kept), smooth) / at_rest
        return smooth[..., self.kept(signal.shape[-1], step)]

    def kept(self, samples: int, step: float) -> NDArray[np.intp]:
        """Indices, of ``samples`` at full rate, that :meth:`reduce` keeps."""
        trim = self.at(step).trim
        assert trim is not None
        ends = round(trim / step)
        return np.arange(ends, samples - ends, self.every(step))

    def near(self, flags: NDArray[np.bool_], step: float) -> NDArray[np.bool_]:
        """Kept samples with a flag within half a decimation interval: ``flags`` at the new rate."""
        half = self.every(step) // 2
        if half and flags.shape[-1]:
            from scipy.ndimage import maximum_filter1d

            flags = maximum_filter1d(flags.astype(np.uint8), 2 * half + 1, axis=-1).astype(bool)
        return flags[..., self.kept(flags.shape[-1], step)]

    def describe(self, step: float) -> str:
        """One line for people: filter, decimation, ends."""
        own = self.at(step)
        text = (
            f"angles and both sides zero-phase Butterworth order {own.order}, {own.cutoff:.4g} Hz; "
            f"{1 / step:.4g} Hz sampling"
        )
        assert own.decimate is not None
        if own.decimate > 1:
            text += f", both sides decimated ×{own.decimate} to {1 / step / own.decimate:.4g} Hz"
        return f"{text}; {own.trim:.3g} s dropped at either end of a piece"


@dataclass(frozen=True)
class Piece:
    """An evenly sampled stretch of one record, with its kinematics.

    ``samples`` maps names to arrays of one length: the recorded channels, and for every recorded
    angle its smoothed value, its speed and its acceleration (``theta_m``, ``omega_m``,
    ``alpha_m``), and the time ``t``, which loads in time ask for.
    """

    record: str
    start: float
    step: float
    samples: Mapping[str, Array]

    def __len__(self) -> int:
        return len(next(iter(self.samples.values())))

    @property
    def t(self) -> Array:
        """Time of every sample, s."""
        times: Array = self.start + self.step * np.arange(len(self), dtype=np.float64)
        return times


def for_records(processing: Processing | None, traces: Mapping[str, Any]) -> Processing:
    """The same choices with a cutoff that the encoders of these records bear.

    Noise of an angle is noise of its acceleration, and grows with the fifth power of the band:
    white noise of density N (rad²/Hz) leaves (2π)⁴ N f⁵ / 5 (rad²/s⁴) below a frequency f.
    Acceleration is a regressor, and noise in a regressor takes its share off the inertia that is
    found: as much as its power is of the whole (W. Fuller, Measurement Error Models, 1987). The
    cutoff is a tenth of the sampling rate, or as far below as keeps that share under a hundredth
    for every angle; but never so low that the filters' ends take more than a fifth of a record.

    Args:
        processing: choices; the usual ones for None. A cutoff that is given stays.
        traces: name -> trace, as :func:`pieces` takes them; one cutoff serves all of them.

    """
    own = processing or Processing()
    if own.cutoff is not None:
        return own
    limits = [limit for trace in traces.values() if (limit := _bearable(trace)) is not None]
    return replace(own, cutoff=min(limits)) if limits else own


def _bearable(trace: Any) -> float | None:
    """Cutoff that every angle of a trace bears, Hz; None where the usual one does."""
    t = np.asarray(trace.t, dtype=float)
    if t.ndim != 1 or len(t) < _SPECTRUM:
        return None
    step = float(np.median(np.diff(t)))
    usual = lowest = 0.1 / step
    least = 2 * 10.0 / (_ENDS * step * len(t))
    for angle in ANGLES:
        if angle not in trace.channels:
            continue
        values = _values(trace.channels[angle])
        density = _white(values, step)
        cutoff = usual
        while cutoff > least and not _clear(values, step, cutoff, density):
            cutoff *= _LOWER
        lowest = min(lowest, max(cutoff, min(least, usual)))
    return lowest if lowest < usual else None


def _clear(values: Array, step: float, cutoff: float, density: float) -> bool:
    """Whether noise of such a density (rad²/Hz) is a small part of the acceleration's square."""
    own = Processing(cutoff=cutoff)
    bend = np.gradient(np.gradient(own.low_pass(values, step), step), step)
    ends = min(round(10.0 / (cutoff * step)), len(bend) // 4)
    noise = (2.0 * np.pi) ** 4 * density * cutoff**5 / 5.0
    return bool(noise <= _NOISY * np.mean(bend[ends : len(bend) - ends] ** 2))


def _white(values: Array, step: float) -> float:
    """Density of white noise as the spectrum near half the sampling rate has it, rad²/Hz."""
    from scipy.signal import welch

    f, density = welch(values, 1.0 / step, "hann", min(1024, len(values) // 4))
    return float(np.median(density[(f >= 0.3 / step) & (f <= 0.475 / step)]))


def pieces(trace: Any, record: str, processing: Processing) -> Iterator[Piece]:
    """Cut a trace at its pauses, lay each piece on an even grid and differentiate its angles.

    Args:
        trace: has ``t``, seconds, rising, shape (n,), and ``channels``, name -> values of shape
            (n,), in SI units; ``breaks``, if any, are samples that start a new stretch.
        record: the name results are reported under.
        processing: filters and their ends.

    Raises:
        ValueError: time that does not rise, a channel of another length or with a value that is no
            number, or no piece long enough for the filters.

    """
    t = np.asarray(trace.t, dtype=float)
    channels = {name: _values(channel) for name, channel in trace.channels.items()}
    _check(t, channels, record)
    step = float(np.median(np.diff(t)))
    own = processing.at(step)
    pauses = np.flatnonzero(np.diff(t) > processing.max_gap * step) + 1
    found = False
    for index in np.split(np.arange(len(t)), np.union1d(pauses, _breaks(trace))):
        count = 1 + int(np.floor((t[index[-1]] - t[index[0]]) / step * (1 + 1e-12)))
        if len(index) < 2 or len(own.kept(count, step)) < 2 or count < 60 * own.every(step):
            continue
        found = True
        grid = t[index[0]] + step * np.arange(count)
        even = {name: np.interp(grid, t[index], x[index]) for name, x in channels.items()}
        known = even | _kinematics(even, step, own) | {"t": grid}
        yield Piece(record, float(grid[0]), step, known)
    if not found:
        raise ValueError(
            f"{record}: no stretch without a pause is long enough for the filters "
            f"({own.describe(step)}); record longer, or lower decimate or trim"
        )


def _kinematics(
    channels: Mapping[str, Array], step: float, processing: Processing
) -> dict[str, Array]:
    """Smoothed angle, speed and acceleration (central differences) of every recorded angle."""
    found: dict[str, Array] = {}
    for angle, (speed, acceleration) in ANGLES.items():
        if angle in channels:
            found[angle] = processing.low_pass(channels[angle], step)
            found[speed] = np.gradient(found[angle], step)
        elif speed in channels:
            found[speed] = processing.low_pass(channels[speed], step)
        else:
            continue
        found[acceleration] = np.gradient(found[speed], step)
    return found


@lru_cache(maxsize=64)
def _butterworth(order: int, cutoff: float) -> Array:
    """Second-order sections of a low-pass; its cutoff over half the sampling rate."""
    from scipy.signal import butter

    return np.asarray(butter(order, cutoff, output="sos"))


@lru_cache(maxsize=64)
def _chebyshev(kept: int) -> Array:
    """Second-order sections of the low-pass before every so many samples are kept."""
    from scipy.signal import cheby1

    return np.asarray(cheby1(8, RIPPLE, 0.8 / kept, output="sos"))


def _forward_backward(sections: Array, signal: Array) -> Array:
    from scipy.signal import sosfiltfilt

    result: Array = sosfiltfilt(sections, signal, axis=-1)
    return result


def _breaks(trace: Any) -> NDArray[np.intp]:
    return np.asarray(getattr(trace, "breaks", ()), dtype=np.intp)


def _values(channel: Any) -> Array:
    return np.asarray(getattr(channel, "values", channel), dtype=np.float64)


def _check(t: Array, channels: Mapping[str, Array], record: str) -> None:
    if t.ndim == 1 and len(t) < 3:
        raise ValueError(f"{record}: {len(t)} samples are too few for derivatives; record longer")
    if t.ndim != 1 or not np.all(np.diff(t) > 0):
        bad = int(np.argmin(np.diff(t))) + 1 if t.ndim == 1 and len(t) > 1 else 0
        raise ValueError(f"{record}: t must rise from row to row; row {bad} does not")
    for name, values in channels.items():
        if values.shape != t.shape:
            raise ValueError(f"{record}: {name} has {values.shape} values for {t.shape} times")
        if not np.all(np.isfinite(values)):
            row = int(np.flatnonzero(~np.isfinite(values))[0])
            raise ValueError(
                f"{record}: {name} has no number in row {row}; cut the trace there or drop it"
            )

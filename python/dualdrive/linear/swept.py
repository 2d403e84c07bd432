"""Frequency responses measured on the nonlinear machine, by stepped sines or by multisines.

A stepped sine gives the response to that amplitude and, in its harmonics, how far the machine is
from linear. Multisines with random phases give the best linear approximation and, from how much it
changes with the phases, a coherence (Pintelon, Schoukens, *System Identification*, 2nd ed. 2012,
ch. 3 and 4). Both use whole periods after what came before has decayed.
"""

from __future__ import annotations

from collections.abc import Callable
from math import ceil

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualdrive import _core
from dualdrive.linear.errors import LinearError
from dualdrive.linear.excite import Bench, bench_for
from dualdrive.linear.frequency import own_unit, poles, unit_of
from dualdrive.linear.response import FrequencyResponse
from dualdrive.linear.small_signal import small_signal
from dualdrive.machine import Machine
from dualdrive.simulation import simulate
from dualdrive.units import human

__all__ = ["multisine", "spaced", "stepped_sine", "worth_measuring"]

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

_HARMONICS = 10
_SAMPLES = 64  # per period of the highest frequency that is read
_DECAYED = 12.0  # time constants of the slowest pole: e^-12 is left
_LONGEST = 60.0  # s, of waiting


def spaced(low: float, high: float, count: int) -> Array:
    """Frequencies from low to high, evenly spaced in logarithm."""
    return np.geomspace(low, high, count)


def worth_measuring(model: FrequencyResponse, count: int = 25) -> Array:
    """Frequencies over the range in which a response is within 40 dB of its peak."""
    size = model.magnitude_db
    alive = model.frequency_hz[size > size.max() - 40]
    return spaced(float(alive[0]), float(alive[-1]), count if alive.size > 1 else 1)


def stepped_sine(
    machine: Machine,
    input: str,  # noqa: A002 -- what it is
    output: str,
    frequencies_hz: ArrayLike,
    amplitude: ArrayLike,
    *,
    periods: int = 4,
    settle: float | None = None,
    speed: float = 0.0,
    load: float = 0.0,
    progress: Progress | None = None,
) -> FrequencyResponse:
    """Drive with one sine after the other and read the fundamental of the output.

    input:      theta_ref, T_load, Omega_1 (speed set-point of all drives; the position loop is open
                then), or a torque on a body, torque@motor_1
    amplitude:  of the input, SI; one number, or one for each frequency
    periods:    that are read, at each frequency
    settle:     s to wait before the sine and again before reading; default: 12 time constants of
                the machine's slowest pole, 60 s at most
    speed:      steady speed of the table besides, so that dry friction slides, rad/s
    load:       steady load besides, N m

    `distortion` is the RMS of harmonics 2 to 10 over the fundamental; `coherence` says how much
    the periods agree: below 1 the motion doesn't repeat with the input.
    Raises LinearError for input that makes no sense or a simulation that fails.
    """
    f = np.atleast_1d(np.asarray(frequencies_hz, float))
    sizes = np.broadcast_to(np.asarray(amplitude, float), f.shape)
    if not (sizes > 0).all() or periods < 2:
        raise LinearError("stepped_sine: amplitude must be positive and periods at least 2")
    bench = bench_for(machine, input, speed, load)
    wait = _waiting(bench.bare, settle)
    found = []
    for k, (frequency, size) in enumerate(zip(f.tolist(), sizes.tolist(), strict=True)):
        begin = ceil(wait * frequency) / frequency  # both waits are whole periods
        found.append(_one_sine(bench, output, frequency, size, begin, periods))
        if progress:
            progress(k + 1, f.size)
    response, distortion, coherence = (np.array(column) for column in zip(*found, strict=True))
    said = _Said(machine, input)
    note = said.note(f"stepped sine of {said.span(sizes)}", speed, load)
    return _simulated(machine, input, output, f, response, note, coherence, distortion)


def multisine(
    machine: Machine,
    input: str,  # noqa: A002 -- what it is
    output: str,
    base_hz: float,
    lines: int,
    rms: float,
    *,
    realisations: int = 4,
    periods: int = 2,
    settle: float | None = None,
    speed: float = 0.0,
    load: float = 0.0,
    seed: int = 0,
    progress: Progress | None = None,
) -> FrequencyResponse:
    """Drive with odd harmonics of `base_hz`, all at once, and average over random phases.

    lines:         harmonics f, 3f, 5f, ...
    rms:           of the input, SI
    realisations:  draws of the phases, at least 2
    Other arguments and errors as for `stepped_sine`.

    `coherence` is |mean G|^2 / mean |G|^2 over the draws: what of the answer is linear.
    `distortion` is the RMS of what comes back at even harmonics beside each line over that line.
    """
    if lines < 1 or realisations < 2 or periods < 1 or not (base_hz > 0 and rms > 0):
        raise LinearError(
            f"multisine: base_hz = {base_hz:g}, lines = {lines}, rms = {rms:g}, realisations = "
            f"{realisations}: needs positive numbers, and 2 realisations at least"
        )
    bench = bench_for(machine, input, speed, load)
    begin = ceil(_waiting(bench.bare, settle) * base_hz) / base_hz
    odd = 1 + 2 * np.arange(lines)
    f = np.asarray(base_hz * odd, np.float64)
    found, even = [], []
    for draw in range(realisations):
        phases = np.random.default_rng([seed, draw]).uniform(0, 2 * np.pi, lines)
        sizes = np.full(lines, rms * np.sqrt(2 / lines))
        given = sizes * np.exp(1j * (phases - np.pi / 2))  # of sines
        wave = _wave(bench, sizes, f, phases, begin)
        step = 1 / (base_hz * _SAMPLES * odd[-1] / 2)
        t, y = _steady(bench, wave, output, 2 * begin, periods / base_hz, step)
        fitted = _fourier(t - begin, y, base_hz, np.arange(1, 2 * lines + 1))
        found.append(fitted[odd - 1] / given)
        even.append(np.abs(fitted[odd]))
        if progress:
            progress(draw + 1, realisations)
    G = np.array(found)
    mean = G.mean(0)
    answered = np.abs(G * rms * np.sqrt(2 / lines))
    coherence = np.abs(mean) ** 2 / np.maximum((np.abs(G) ** 2).mean(0), 1e-300)
    distortion = np.sqrt((np.array(even) ** 2).mean(0) / np.maximum((answered**2).mean(0), 1e-300))
    said = _Said(machine, input)
    size = said.span(np.array([rms]))
    note = said.note(f"{realisations} multisines of {size} RMS", speed, load)
    return _simulated(machine, input, output, f, mean, note, coherence, distortion)


def _simulated(
    machine: Machine,
    source: str,
    output: str,
    f: Array,
    response: NDArray[np.complex128],
    note: str,
    coherence: Array,
    distortion: Array,
) -> FrequencyResponse:
    return FrequencyResponse(
        frequency_hz=f,
        response=response,
        input=source,
        output=output,
        unit=unit_of(machine, small_signal(machine.core), source, output),
        note=note,
        coherence=coherence,
        distortion=distortion,
        origin="simulated",
    )


def _one_sine(
    bench: Bench, output: str, f: float, size: float, begin: float, periods: int
) -> tuple[complex, float, float]:
    """Response, distortion, coherence at one frequency."""
    wave = _wave(bench, np.array([size]), np.array([f]), np.zeros(1), begin)
    t, y = _steady(bench, wave, output, 2 * begin, periods / f, 1 / (f * _SAMPLES))
    fitted = _fourier(t - begin, y, f, np.arange(1, _HARMONICS + 1))
    response = fitted[0] / (size * np.exp(-0.5j * np.pi))
    harmonics = float(np.sqrt((np.abs(fitted[1:]) ** 2).sum() / max(abs(fitted[0]), 1e-300) ** 2))
    parts = [
        _fourier(one - begin, values, f, np.array([1]))[0]
        for one, values in zip(np.split(t, periods), np.split(y, periods), strict=True)
    ]
    agreement = abs(np.mean(parts)) ** 2 / max(float(np.mean(np.abs(parts) ** 2)), 1e-300)
    return complex(response), harmonics, float(agreement)


def _wave(bench: Bench, sizes: Array, f: Array, phases: Array, begin: float) -> _core.Waveform:
    """Sines from `begin` on as the bench's input takes them, integrated where it does."""
    if bench.integrated:
        sizes, phases = sizes / (2 * np.pi * f), phases - np.pi / 2
    start = float((sizes * np.sin(phases)).sum())  # an angle that begins without a jump
    wave = _core.multisine(sizes, f, phases, begin)
    return wave + _core.step(-start, begin) if bench.integrated else wave


def _steady(
    bench: Bench, wave: _core.Waveform, output: str, begin: float, length: float, step: float
) -> tuple[Array, Array]:
    """The output over the last `length` seconds, its last sample left out: whole periods."""
    count = round(length / step)
    times = np.asarray(begin + step * np.arange(count), np.float64)
    run = simulate(
        bench.machine,
        inputs=dict(bench.driven(wave)),
        end=float(times[-1]),
        times=times,
        signals=[output],
        energy=False,
    )
    if not run.ok:
        raise LinearError(f"{bench.machine.name}: the simulation ended early: {run.message}")
    return times, np.asarray(run[output])


def _fourier(t: Array, y: Array, f: float, harmonics: NDArray[np.int_]) -> NDArray[np.complex128]:
    """Complex amplitudes at harmonics of f, beside a constant and a straight line, least squares.

    Time counts from where the sines began.
    """
    angle = 2 * np.pi * f * t[:, None] * harmonics
    line = np.stack([np.ones_like(t), (t - t.mean()) / max(float(np.ptp(t)), 1e-300)], 1)
    basis = np.concatenate([line, np.cos(angle), np.sin(angle)], 1)
    found = np.linalg.lstsq(basis, y, rcond=None)[0][2:]
    return np.asarray(found[: harmonics.size] - 1j * found[harmonics.size :], np.complex128)


def _waiting(machine: Machine, settle: float | None) -> float:
    """How long what came before takes to decay, s."""
    if settle is not None:
        if not settle >= 0:
            raise LinearError(f"settle = {settle:g}: must be a time of 0 s or more")
        return settle
    decays = -poles(machine).real
    slow = decays[decays > 1e-7 * decays.max()]
    return min(_DECAYED / float(slow.min()), _LONGEST) if slow.size else _LONGEST


class _Said:
    """What a measurement is called: sizes with the units of this machine."""

    def __init__(self, machine: Machine, source: str) -> None:
        self._units = {
            name: own_unit(machine, small_signal(machine.core), name)
            for name in (source, "omega_m", "T_load")
        }
        self._source = source

    def span(self, sizes: Array) -> str:
        """The size of the input, or from which to which."""
        low, high = (self._human(self._source, float(f(sizes))) for f in (np.min, np.max))
        return low if low == high else f"{low} to {high}"

    def note(self, text: str, speed: float, load: float) -> str:
        """The words, and what went on meanwhile."""
        steady = [("speed", "omega_m", speed), ("load", "T_load", load)]
        more = [f"{word} {self._human(name, value)}" for word, name, value in steady if value]
        return "; ".join([text, *more])

    def _human(self, name: str, value: float) -> str:
        return human(value, self._units[name])

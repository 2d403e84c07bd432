"""The likelihood of a noise by the spectra of what a filter leaves.

-2 log L = sum over frequencies of log det Phi + tr(Phi^-1 I), I the periodograms of the innovations
and Phi their spectral density under a noise (Whittle, Arkiv foer Matematik 2 (1953) 423-434;
several channels: Dunsmuir, Annals of Statistics 7 (1979) 490-506). A filter that is held passes
each source of noise on by a response of its own, V; only their densities depend on the noise:

    Phi = sum of V V* a,   V = S^(-1/2) (1 - C (z - F (1 - K C))^-1 F K) (C (z - F)^-1 B, 1)

One replay thus tells the likelihood of all noises, as far as the machine keeps to the pattern of
modes in which all meshes carry. Of what ticks in sampled loops the responses by which a frequency
is heard at its aliases are counted, not how these are correlated.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.innovations.greybox import GreyBox, first_alike
from dualdrive.innovations.levenberg_marquardt import step_within
from dualdrive.innovations.noise import Logarithms, Noise
from dualdrive.innovations.prediction import GIVEN
from dualdrive.innovations.records import Predictable
from dualdrive.innovations.variant import Point
from dualdrive.replay.record import with_settings

Array = NDArray[np.float64]
Complex = NDArray[np.complexfloating]

#: bands, over which periodograms are averaged: an autoregression bends over an octave at least
_PER_OCTAVE = 4
_STEP = 1e-4  # of a logarithm, for differences of densities
_ITERATIONS = 60
_LITTLE = 0.5  # of -2 log L: a step that brings less ends it; by replays, less than 2 does
_DAMPING, _LESS, _MORE, _MOST = 1e-3, 0.2, 8.0, 1e8  # of a step: at first, after a good one, a bad


class Band(NamedTuple):
    """Averages over bands of frequencies.

    frequency: rad a sample, shape (bands,)
    values: how many are averaged, shape (bands,)
    power: of whitened innovations, shape (bands, channels, channels)
    """

    frequency: Array
    values: Array
    power: Complex


class _Heard(NamedTuple):
    """What is heard of sources of noise, of records whose filters are alike.

    record: one of them
    band: their periodograms
    source: frequencies at which sources act that are heard there, shape (aliases, bands)
    response: to each source, shape (bands, channels, aliases * sources)
    """

    record: Predictable
    band: Band
    source: Array
    response: Complex


class WhittleLikelihood:
    """Of a noise, as a vector of logarithms, beside a machine at a point.

    What they say of a first state, or of a body at rest, no spectrum tells: no derivatives there.
    """

    def __init__(
        self, grey: GreyBox, point: Point, gains: Sequence[Any], logarithms: Logarithms
    ) -> None:
        self._logs = logarithms
        core = grey.machine(point.variant, point.theta)
        alike: dict[int, list[int]] = {}
        for r in range(len(gains)):
            alike.setdefault(first_alike(gains, r), []).append(r)
        self._heard = []
        for first, records in alike.items():
            record, own = grey.records[first], gains[first]
            pieces = [
                piece
                for r in records
                for piece in _stretches(point.residuals[r], grey.records[r].sampled.starts)
            ]
            if not pieces:
                continue
            band = averaged(pieces)
            there = with_settings(core, record.record.settings)
            bodies = len(logarithms.noise.torque)
            source, response = _responses(there, record, own, bodies, band.frequency)
            self._heard.append(_Heard(record, band, source, response))

    def __call__(self, x: Array) -> float:
        """-2 log L, constants left out."""
        noise = self._logs.at(x)
        total = 0.0
        for heard in self._heard:
            density = _densities(noise, heard)
            total += _likelihood(heard, density)[0]
        return total

    def normal(self, x: Array) -> tuple[Array, Array]:
        """Half the expected second derivatives and half the gradient, by the logarithms."""
        noise, m = self._logs.at(x), len(x)
        moved = [self._logs.at(x + e) for e in np.diag(np.full(m, _STEP))]
        H, g = np.zeros((m, m)), np.zeros(m)
        for heard in self._heard:
            density = _densities(noise, heard)
            by = np.stack([_densities(own, heard) - density for own in moved]) / _STEP
            _, inverse = _likelihood(heard, density)
            V, power = heard.response, heard.band.power
            U = inverse @ V
            excess = np.einsum("qic,qic->qc", V.conj(), U).real  # of what is expected
            excess -= np.einsum("qic,qij,qjc->qc", U.conj(), power, U).real
            weighed = heard.band.values[:, None] * excess
            g += 0.5 * np.einsum("mqc,qc->m", by, weighed)
            both = np.abs(V.conj().swapaxes(1, 2) @ U) ** 2
            told = np.einsum("mqc,qcd->mqd", by * heard.band.values[:, None], both)
            H += 0.5 * np.einsum("mqd,kqd->mk", told, by)
        return H, g

    def minimum(self, x: Array, low: Array, high: Array, *, held: float) -> Array:
        """Where it is likeliest within bounds, from a point.

        Args:
            x: the point.
            low: bounds.
            high: bounds.
            held: how much it counts to stay there, over the information (one, where there is
                less): a damped step.

        """
        begin, cost, damping = x, self(x), _DAMPING
        H, g = self.normal(x)
        stay = held * np.maximum(np.diag(H), 1.0)
        for _ in range(_ITERATIONS):
            away = x - begin
            bent = H + np.diag(stay) + damping * np.diag(np.diag(H)) + 1e-9 * np.eye(len(x))
            d = step_within(bent, g + stay * away, low - x, high - x)
            gone = away + d
            other = self(x + d) + float(stay @ gone**2)
            if other < cost:
                gained, x, cost = cost - other, x + d, other
                damping = max(damping * _LESS, 1e-6)
                if gained < _LITTLE:
                    break
                H, g = self.normal(x)
            elif damping > _MOST:
                break
            else:
                damping *= _MORE
        return x


def _stretches(residuals: Array, starts: Sequence[int]) -> list[Array]:
    """Whitened innovations by stretch, without those that the likelihood is conditioned on."""
    ends = [*starts[1:], len(residuals)]
    return [residuals[a + GIVEN : b] for a, b in zip(starts, ends, strict=True) if b > a + GIVEN]


def averaged(pieces: Sequence[Array]) -> Band:
    """Periodograms of several series, shape (n, channels) each, averaged over bands."""
    total: dict[int, list[Any]] = {}
    for x in pieces:
        n = len(x)
        spectrum = np.fft.rfft(x, axis=0) / np.sqrt(n)
        frequency = 2.0 * np.pi * np.arange(len(spectrum)) / n
        frequency[0] = 0.5 * frequency[1] if n > 1 else np.pi  # of a mean: below all others
        signs = np.full(len(spectrum), 2.0)
        signs[0] = 1.0
        if n % 2 == 0:
            signs[-1] = 1.0
        place = np.floor(_PER_OCTAVE * np.log2(frequency / np.pi) + 1e-9).astype(int)
        for k in np.unique(place):
            own = place == k
            f, v = spectrum[own], signs[own]
            sums = total.setdefault(int(k), [0.0, 0.0, 0.0])
            sums[0] += float(v.sum())
            sums[1] += float(v @ np.log(frequency[own]))
            sums[2] = sums[2] + (f.T * v) @ f.conj()
    found = [total[k] for k in sorted(total)]
    values = np.array([s[0] for s in found])
    return Band(
        np.exp(np.array([s[1] for s in found]) / values),
        values,
        np.stack([s[2] / s[0] for s in found]),
    )


def _responses(
    core: Any, record: Predictable, gains: Any, bodies: int, frequency: Array
) -> tuple[Array, Complex]:
    """Frequencies of sources that are heard at others, and the responses to them; see `_Heard`."""
    F, C, states = _core.linear_filter(core, record.sampled, gains)
    phases, m = len(F), len(C)
    aliases = 2.0 * np.pi / phases * np.arange(phases)
    source = frequency - aliases[:, None]

    def turns(columns: int) -> Complex:
        """What a sample turns each source by, shape (bands, 1, aliases * columns)."""
        return np.repeat(np.exp(1j * source.T), columns, axis=1)[:, None, :]

    period = np.exp(1j * phases * frequency)[:, None, None]
    pushed = [np.tile(f[:states, states : states + bodies], phases) for f in F]
    moved = _periodic([f[:states, :states] for f in F], pushed, turns(bodies), period)
    sensed = np.broadcast_to(np.eye(m), (len(frequency), phases, m, m)).swapaxes(1, 2)
    given = []
    for x in moved:
        seen = (C[:, :states] @ x).reshape(len(frequency), m, phases, bodies)
        given.append(np.concatenate([seen, sensed], axis=3).reshape(len(frequency), m, -1))
    K, z = [gains.K(phase) for phase in range(phases)], turns(bodies + m)
    A = [f @ (np.eye(len(f)) - k @ C) for f, k in zip(F, K, strict=True)]
    predicted = _periodic(A, [f @ k @ y for f, k, y in zip(F, K, given, strict=True)], z, period)
    heard = np.zeros_like(given[0])
    for phase, (y, x) in enumerate(zip(given, predicted, strict=True)):
        back = np.repeat(np.exp(-1j * aliases * phase), bodies + m) / phases
        heard += gains.whitening(phase) @ (y - C @ x) * back
    return source, heard


def _periodic(
    A: Sequence[Array], B: Sequence[Array | Complex], z: Complex, period: Complex
) -> list[Complex]:
    """Solve z x[k+1] = A[k] x[k] + B[k] for what repeats, shape (bands, states, inputs) each.

    z: of each input, shape (bands, 1, inputs), of which there may be none
    period: what all inputs of a band turn by over a period, shape (bands, 1, 1)
    """
    over, add = np.eye(len(A[0])), np.zeros((len(z), len(A[0]), z.shape[2]), dtype=complex)
    for k, (a, b) in enumerate(zip(A, B, strict=True)):
        over, add = a @ over, a @ add + z**k * b
    found = [np.linalg.solve(period * np.eye(len(over)) - over, add)]
    for a, b in zip(A[:-1], B[:-1], strict=True):
        found.append((a @ found[-1] + b) / z)
    return found


def _densities(noise: Noise, heard: _Heard) -> Array:
    """Of all sources at the frequencies at which they act, shape (bands, aliases * sources)."""
    aliases, bands = heard.source.shape
    found = noise.densities(heard.record, heard.source.ravel()).reshape(-1, aliases, bands)
    return found.transpose(2, 1, 0).reshape(bands, -1)


def _likelihood(heard: _Heard, density: Array) -> tuple[float, Complex]:
    """-2 log L, and the inverse of the spectral density, shape (bands, channels, channels)."""
    V, band = heard.response, heard.band
    Phi = (V * density[:, None, :]) @ V.conj().swapaxes(1, 2)
    _, log_det = np.linalg.slogdet(Phi)
    inverse = np.linalg.inv(Phi)
    trace = np.einsum("qij,qji->q", inverse, band.power).real
    return float(band.values @ (log_det + trace)), inverse

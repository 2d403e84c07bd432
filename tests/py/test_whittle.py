"""The likelihood of a noise by spectra, held against that of replays under each noise."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.innovations import GreyBox, Point, Variant, first_noise, least_noise
from dualdrive.innovations.noise import Logarithms, Noise
from dualdrive.innovations.whittle import WhittleLikelihood, averaged
from test_innovations import bench

SAMPLES = 4000
TICKS = {"": {}, "ticks": {"controller.position_sample": 4e-3, "controller.speed_sample": 2e-3}}
STEP = 0.1  # of a logarithm

Array = NDArray[np.float64]


@functools.cache
def grey(ticks: str) -> GreyBox:
    machine, true = Machine.load("bench"), bench()
    true.set("table.J", 1.06 * true.get("table.J"))
    for path, value in TICKS[ticks].items():
        machine.set(path, value)
        true.set(path, value)
    return grey_box(machine, true, SAMPLES, seed=3)


@functools.cache
def beside(ticks: str, torque: bool = True) -> tuple[Logarithms, Point, list[Any]]:
    """A machine whose table is heavier, under a noise that has not been fitted."""
    own = grey(ticks)
    noise = first_noise(own.core, own.records, 0.02)
    if not torque:
        noise = replace(noise, torque={}, creep={})
    [found] = own.likelihoods(Variant(own.core), [(own.start(Variant(own.core)), noise)])
    assert found is not None
    floor = least_noise(own.core, own.records, 1e-5)
    return Logarithms(noise, floor), *found


def replayed(ticks: str, noise: Noise) -> float:
    own = grey(ticks)
    variant = Variant(own.core)
    [found] = own.likelihoods(variant, [(own.start(variant), noise)])
    assert found is not None
    return found[0].minus_two_log


@pytest.mark.parametrize("torque", [True, False], ids=["", "sensors alone"])
@pytest.mark.parametrize("ticks", list(TICKS))
def test_slopes_are_those_of_replays_under_every_noise(ticks: str, torque: bool) -> None:
    logs, point, gains = beside(ticks, torque)
    assert gains[0].phases == (4 if ticks else 1)
    H, g = WhittleLikelihood(grey(ticks), point, gains, logs).normal(np.zeros(len(logs)))
    heard = len(logs) - len(logs.unheard)
    assert not g[heard:].any(), "what no spectrum tells has no slope"
    sizes = np.sqrt(np.diag(H)[:heard])
    for k, e in enumerate(np.eye(len(logs))[:heard]):
        ahead, back = (replayed(ticks, logs.at(s * STEP * e)) for s in (1.0, -1.0))
        slope = (ahead - back) / (4.0 * STEP)
        # a part of itself, or what its own scatter makes of it; what a simulation leaves ends
        # elsewhere than it began, which leaks into its periodogram
        part = 0.03 if torque else 0.05
        assert g[k] == pytest.approx(slope, rel=part, abs=0.6 * sizes[k] + 3.0), k


@pytest.mark.parametrize("ticks", list(TICKS))
def test_where_it_is_least_a_replay_is_likelier_by_as_much(ticks: str) -> None:
    logs, point, gains = beside(ticks)
    spectra = WhittleLikelihood(grey(ticks), point, gains, logs)
    x = np.zeros(len(logs))
    there = spectra.minimum(x, *logs.bounds(), held=0.0)
    promised = spectra(x) - spectra(there)
    assert promised > 1000.0
    gained = point.minus_two_log - replayed(ticks, logs.at(there))
    assert gained == pytest.approx(promised, rel=0.03)
    # a damped step goes less far
    near = spectra.minimum(x, *logs.bounds(), held=1000.0)
    assert np.linalg.norm(near) < 0.5 * np.linalg.norm(there)
    assert spectra(there) < spectra(near) < spectra(x)


def test_bands_keep_the_power_of_what_they_average() -> None:
    random = np.random.default_rng(1)
    pieces = [random.normal(0.3, 1.0, (n, 2)) for n in (500, 501, 64)]
    band = averaged(pieces)
    assert band.values.sum() == sum(map(len, pieces))
    power = np.einsum("q,qij->ij", band.values, band.power)
    squares = sum(np.asarray(x.T @ x) for x in pieces)
    assert power.real == pytest.approx(squares, rel=1e-12)
    assert np.all(np.diff(band.frequency) > 0.0)
    assert band.frequency[-1] <= np.pi


def test_densities_hold_the_variance_of_a_sensor() -> None:
    """Summed over all frequencies, of order two and with a zero that drifts as well."""
    own = grey("")
    noise = first_noise(own.core, own.records, 0.02).of_order_two()
    second = dict.fromkeys(noise.second, -0.4)
    noise = Noise(
        noise.drive, noise.memory, noise.torque, noise.course, noise.drift, noise.wander, second
    )
    [record] = own.records
    w = np.linspace(0.0, 2.0 * np.pi, 200_000, endpoint=False)
    found = noise.densities(record, w).mean(axis=1)
    sensors = found[len(noise.torque) :]
    assert sensors == pytest.approx(list(noise.variance(record).values()), rel=1e-6)

"""Effects so strong that the machine without them is far away: noise, starts, coordinates."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.blind.shown import ordered
from tests.blind.shown.ordered import Order

from dualdrive.compare import evened
from dualdrive.diagnose import whitening
from dualdrive.diagnose.confront import Series
from dualdrive.diagnose.evidence import Evidence, evidence
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.diagnose.loop import ClosedLoop
from dualdrive.diagnose.profiled import profile, sharpened
from dualdrive.diagnose.refit import Fitter, Refit
from dualdrive.diagnose.stage import Stage, scale_of
from dualdrive.diagnose.starts import near
from dualdrive.diagnose.work import Clock, Work
from dualdrive.replay import core_of, records

rng = np.random.default_rng(11)


def confronted(order: Order) -> ClosedLoop:
    traces = {name: evened(trace)[0] for name, trace in order.traces().items()}
    machine = order.machine()
    return ClosedLoop(core_of(machine), records(machine, traces, settings=order.settings()))


def test_the_profile_is_the_likelihood_at_the_best_size_of_the_noise() -> None:
    """n log of the mean square, every series by its own size, n those that are independent."""
    n, sizes, alike = 400, (2.0, 0.1), (1.0, 8.0)
    every, t = np.ones(n, dtype=bool), 1e-3 * np.arange(n, dtype=np.float64)
    series = [Series("r", k, "", "", t, t, 1.0, t, every, ~every) for k in ("e", "I_1")]
    confrontation = SimpleNamespace(
        series=series, sigma=np.array([0.5, np.inf]), centre=np.zeros(2), mode="closed_loop"
    )
    whiteners = [whitening.Whitener(np.zeros(0), np.full(n, 3.0), every, own) for own in alike]
    seen = Evidence(confrontation, whiteners, np.zeros(2 * n, dtype=int))
    left = [size * np.where(t % 2e-3 < 1e-3, 1.0, -1.0) for size in sizes]
    refit = SimpleNamespace(u=np.array([1.0, 7.0]), left=left)
    expected = (1.0 / 0.5) ** 2
    expected += sum(n / own * math.log((s / 3.0) ** 2) for s, own in zip(sizes, alike, strict=True))
    assert profile(seen, refit) == pytest.approx(expected, rel=1e-12)  # type: ignore[arg-type]


@pytest.mark.parametrize("effect", ["shaft_compliance", "gearbox_backlash"])
def test_a_stiffness_put_in_is_fitted_as_the_compliance_that_it_adds(effect: str) -> None:
    core = core_of(ordered.drifted("bench", 0, 1.0).machine())
    h = Hypothesis(((effect, "gearboxes"),))
    grown, free = h.put_in(core)
    [p] = [p for p in h.unknowns(grown, free, {}) if p.path.endswith(".stiffness")]
    begin = float(grown.get(p.path))
    assert p.value(p.start) == pytest.approx(begin)
    assert p.value(2.0) == pytest.approx(begin / 2.0), "twice the compliance"
    assert p.coordinate(p.value(0.3)) == pytest.approx(0.3)
    slope = (p.value(1.0 + 1e-6) - p.value(1.0 - 1e-6)) / 2e-6
    assert p.slope(1.0) == pytest.approx(slope, rel=1e-6)
    low, high = p.bounds
    assert 0.0 < low < p.start < high
    assert p.value(0.0) == p.high, "rigid"


def test_a_number_open_at_zero_stays_above_it_however_far_a_step_goes() -> None:
    """A stiffness of bristles that nothing holds: a step of a thousand e-folds is no stiffness."""
    core = core_of(ordered.drifted("bench", 0, 1.0).machine())
    h = Hypothesis((("lugre", "table"),))
    grown, free = h.put_in(core, {"torque": 1.0, "speed": 1.0, "travel": 1.0})
    [p] = [p for p in h.unknowns(grown, free, {}) if p.path.endswith(".stiffness")]
    assert p.logarithmic, "else this shows nothing"
    for u in (-1000.0, 1000.0):
        assert 0.0 < p.value(u) < math.inf
        assert math.isfinite(p.slope(u))
        grown.set(p.path, p.value(u))
    assert p.value(0.5) == pytest.approx(p.scale * math.exp(0.5))


def test_a_strong_dead_time_is_fitted_though_the_machine_without_it_hunts() -> None:
    """The usual zone of current is read off the records: 0.5 A would be ten times too wide."""
    order = ordered.hiding("dead_time", "bench", 3, 1.0, count=1)
    [hidden] = order.hidden["fast"]
    c = confronted(order)
    seen, base = evidence(c, whitening.plain(c.series)), None
    for _ in range(2):
        base = Fitter(seen).nominal(c.start)
        assert base is not None
        seen = evidence(c, whitening.sized(c.series, base.left))
    assert base is not None
    assert over_floor(c, base).max() > 10.0, "else this shows nothing"
    wanted = Hypothesis((("dead_time", "motors"),))
    stage = Stage(c, base.u, base.left, [scale_of(seen, base)], Work(Clock(math.inf)))
    [score] = stage.scores([wanted])
    fitter = Fitter(seen)
    trial = fitter.tried(wanted, near(score, base.u), slopes=base.slopes)
    assert trial is not None
    found = sharpened(fitter, fitter(trial, base.slopes))
    values = found.values()
    real = hidden.parameters
    assert values["dead_time@motors.voltage"] == pytest.approx(real["voltage"], rel=0.1)
    assert values["dead_time@motors.current"] == pytest.approx(real["current"], rel=0.2)
    assert over_floor(c, found).max() < 2.5


def over_floor(c: ClosedLoop, refit: Refit) -> np.ndarray:
    return np.array([np.std(x) / s.floor for s, x in zip(c.series, refit.left, strict=True)])

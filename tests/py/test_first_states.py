"""Records begun while tension builds up, sampled loops, and noise with a long memory.

Three things that a filter must know before anything else may be called missing: the true machine
leaves white innovations in all of them.
"""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from dualdrive import Machine, _core
from dualdrive.innovations import (
    GreyBox,
    Noise,
    Point,
    Variant,
    drive_torque,
    first_noise,
    inflation,
    least_noise,
    maximum_likelihood,
    predictable,
    simulated,
)
from dualdrive.replay import core_of, records
from dualdrive.traces import Trace
from test_innovations import CHANNELS, REVERSALS, SENSORS, STEP, bench, coloured, record, run
from test_linear import three_drives

Array = NDArray[np.float64]

LEAD, SAMPLES = 3.0, 5000
#: as many samples as a component of the noise remembers
MEMORIES = 4.0 ** np.arange(6)


def sampled(machine: Any) -> Any:
    """Loops of a control of a few hundred Hz, and an equaliser that takes seconds."""
    for loop, period in (("speed", 2e-3), ("position", 4e-3), ("tension", 4e-3)):
        machine.set(f"controller.{loop}_sample", period)
    for path, value in (("T_E", 2.0), ("g_E", 0.4), ("tau_t", 0.8)):
        machine.set(f"controller.{path}", value)
    return machine


def pink(random: np.random.Generator, samples: int) -> Array:
    """1/f noise, twice what drives the bench's sensors, shape (samples, channels)."""
    found = []
    for drive, *_ in SENSORS:
        parts = [
            lfilter([np.sqrt(1.0 - a * a)], [1.0, -a], random.normal(size=samples + 8192))[8192:]
            for a in np.exp(-1.0 / MEMORIES)
        ]
        found.append(2.0 * drive * np.sum(parts, axis=0) / np.sqrt(len(parts)))
    return np.column_stack(found)


def trace(core: Any, lead: float, noise: Array) -> Trace:
    """What a machine shows that was switched on `lead` seconds before."""
    waiting = _core.shift(REVERSALS, lead) if lead else REVERSALS
    before = round(lead / STEP)
    clean = run(core, {"theta_ref": waiting}, before + len(noise))[before:]
    t = STEP * np.arange(len(noise), dtype=np.float64)
    columns = dict(zip(CHANNELS, (clean + noise).T, strict=True))
    return Trace(t, {"theta_ref": REVERSALS.value(t), **columns}, name="record")


@functools.cache
def grey_box(loop: str, lead: float, noise: str) -> GreyBox:
    machine = Machine.load("bench")
    if loop == "sampled":
        sampled(machine)
    random = np.random.default_rng(5)
    added = (coloured if noise == "coloured" else pink)(random, SAMPLES)
    seen = trace(core_of(machine), lead, added)
    played = records(machine, {"record": seen}, start="settled" if lead else "rest")
    core = core_of(machine)
    return GreyBox(core, predictable(core, played), [])


def likeliest(own: GreyBox) -> tuple[Point, Noise, list[Any]]:
    wide = first_noise(own.core, own.records, 0.1)
    floor = least_noise(own.core, own.records, 1e-5)
    nothing = Variant(own.core)
    start = own.start(nothing)
    found = maximum_likelihood(own, nothing, start, wide, floor=floor, steps=30, guessed=True)
    assert found is not None
    return found


def missing(own: GreyBox, point: Point, gains: list[Any]) -> float:
    """Largest share of a torque of unknown course in the drives' own."""
    scale = drive_torque(own.core, own.records)
    torques = own.filtered(point, gains)[0].torques
    return max(float(np.sqrt(np.mean(x**2))) / scale[body] for body, x in torques.items())


@pytest.mark.long
@pytest.mark.parametrize(
    ("loop", "lead", "noise"),
    [
        ("continuous", 0.0, "pink"),
        ("continuous", LEAD, "coloured"),
        ("sampled", 0.0, "coloured"),
        ("sampled", LEAD, "pink"),
    ],
)
def test_the_true_machine_leaves_noise_alone(loop: str, lead: float, noise: str) -> None:
    own = grey_box(loop, lead, noise)
    point, _, gains = likeliest(own)
    assert inflation(point) < 1.4
    assert missing(own, point, gains) < 0.01


@pytest.mark.parametrize("loop", ["continuous", "sampled"])
def test_the_noise_found_is_as_likely_as_the_true_one(loop: str) -> None:
    """Gains of ticks spread over the samples fell short by 380, and by more with other noise."""
    own = grey_box(loop, 0.0, "coloured")
    point, found, _ = likeliest(own)
    true = dict(zip(own.records[0].kinds, SENSORS, strict=True))
    sensors = replace(
        found,
        drive={kind: drive for kind, (drive, _, _) in true.items()},
        memory={kind: memory for kind, (_, memory, _) in true.items()},
        drift={kind: 1e-4 * drive for kind, (drive, _, _) in true.items()},
    )
    [there] = own.likelihoods(point.variant, [(own.start(point.variant), sensors)])
    assert there is not None
    assert point.minus_two_log < there[0].minus_two_log + 20.0


def test_the_likelihood_has_no_jumps() -> None:
    """First gains that gave way to the steady ones sooner or later made it jump by 200."""
    machine = Machine.load("bench")
    machine.add("coulomb", "table", torque=0.8)
    core = core_of(machine)
    seen = trace(core, 0.0, coloured(np.random.default_rng(3), SAMPLES))
    [whole] = predictable(core, records(machine, {"record": seen}, start="rest"))
    at = 2200
    begins = [{}, {"theta_m": float(seen["theta_m"][at])}]
    own = GreyBox(core, [whole.stretches([(0, 500), (at, 500)], begins)], [])
    nothing, wide = Variant(core), first_noise(core, [whole], 0.1)
    places = [(own.start(nothing), wide.with_torque(x)) for x in np.geomspace(1e-3, 1e-1, 200)]
    found = own.likelihoods(nothing, places)
    values = np.array([f[0].minus_two_log for f in found if f])
    assert len(values) == len(places)
    assert np.abs(np.diff(values, 2)).max() < 3.0


def test_gains_repeat_with_the_ticks() -> None:
    """1.37 ms and samples of 1 ms meet too late: those ticks are spread."""
    phases = {}
    for period in (0.0, 2e-3, 4e-3, 1.37e-3):
        core = bench()
        for loop in ("speed", "position", "tension"):
            core.set(f"controller.{loop}_sample", period)
        seen = record({"theta_ref": REVERSALS}, np.zeros((10, len(CHANNELS))))
        gains = _core.kalman_gains(core, seen, SENSORS, {"table": (2e-3, 0.99)})
        phases[period] = gains.phases
        assert np.isfinite([gains.log_det(k) for k in range(gains.phases)]).all()
    assert phases == {0.0: 1, 2e-3: 2, 4e-3: 4, 1.37e-3: 1}


def test_a_simulation_begins_with_the_tension_that_was_there() -> None:
    own = grey_box("sampled", LEAD, "coloured")
    left = simulated(own, Variant(own.core), own.start(Variant(own.core)))
    assert left is not None
    noise = coloured(np.random.default_rng(5), SAMPLES)
    assert np.std(left.missed[0], axis=0) == pytest.approx(np.std(noise, axis=0), rel=0.2)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_simulation_believes_a_first_angle_as_well_as_an_encoder_tells_it(seed: int) -> None:
    """A first reading is off by as much as any: held to it, the true machine left its error."""
    machine = Machine.load("bench")
    white = np.random.default_rng(seed).normal(size=(SAMPLES, len(CHANNELS)))
    scale = [1000.0 * drive / np.sqrt(1.0 - memory**2) for drive, memory, _ in SENSORS]
    noise = white * scale
    core = core_of(machine)
    played = records(machine, {"record": trace(core, 0.0, noise)}, start="rest")
    own = GreyBox(core, predictable(core, played), [])
    left = simulated(own, Variant(core), own.start(Variant(core)))
    assert left is not None
    assert np.std(left.missed[0], axis=0) == pytest.approx(np.std(noise, axis=0), rel=0.05)


def test_what_nothing_feels_may_walk_away() -> None:
    """Two slaves' equalisers act on the master alike: their difference is seen by nothing."""
    core = three_drives(0.5)
    core.set_controller(equaliser="master", current="cascade")
    seen = record({"theta_ref": REVERSALS}, np.zeros((10, len(CHANNELS))))
    torque = dict.fromkeys(("table", "motor_1", "motor_2", "motor_3"), (0.0001, 0.99))
    gains = _core.kalman_gains(core, seen, SENSORS, torque)
    assert np.isfinite(gains.K()).all()


def test_gains_that_are_kept_are_those_worked_out_on_the_way() -> None:
    core = bench()
    core.set("controller.T_ten", 0.0)  # flanks open and close
    seen = record({"theta_ref": REVERSALS}, run(core, {"theta_ref": REVERSALS}, 3000))
    gains = _core.kalman_gains(core, seen, SENSORS, {"table": (2e-3, 0.99)})
    forgotten = _core.predict(core, seen, gains)
    assert gains.learned == 0
    kept = _core.predict(core, seen, gains, learn=True)
    learned = gains.learned
    assert learned > 4, "one after another, as the flanks open and close"
    again = _core.predict(core, seen, gains)
    assert gains.learned == learned
    assert kept["switches"] > 4
    for other in (kept, again):
        assert np.array_equal(forgotten["residuals"], other["residuals"])
        assert forgotten["log_det"] == other["log_det"]


def test_a_little_other_machine_takes_the_gains_that_are_known() -> None:
    """It leaves its sojourns at other samples; residuals change smoothly, nothing is learned."""
    core = bench()
    core.set("controller.T_ten", 0.0)
    seen = record({"theta_ref": REVERSALS}, run(core, {"theta_ref": REVERSALS}, 3000))
    gains = _core.kalman_gains(core, seen, SENSORS, {"table": (2e-3, 0.99)})
    _core.predict(core, seen, gains, learn=True)
    own = gains.learned
    J, found = core.get("table.J"), []
    for off in (-1e-3, 0.0, 1e-3):
        core.set("table.J", J * (1.0 + off))
        found.append(_core.predict(core, seen, gains)["residuals"])
    assert gains.learned == own
    slope, bend = found[2] - found[0], found[2] - 2.0 * found[1] + found[0]
    assert np.linalg.norm(bend) < 0.1 * np.linalg.norm(slope)


def test_gains_are_held_where_a_law_with_modes_of_its_own_is_tried() -> None:
    """A friction next to nought changes next to nothing, though the table rests under it."""
    plain = bench()
    inputs = {"theta_ref": REVERSALS}
    seen = record(inputs, run(plain, inputs, 3000) + coloured(np.random.default_rng(2), 3000))
    gains = _core.kalman_gains(plain, seen, SENSORS, {"table": (1e-2, 0.99)})
    before = _core.predict(plain, seen, gains, learn=True)
    learned = gains.learned
    tried = bench({"coulomb@table": {"torque": 1e-6}})
    found = _core.predict(tried, seen, gains)
    assert found["switches"] > before["switches"], "it comes to rest"
    assert gains.learned == learned
    assert np.linalg.norm(found["residuals"] - before["residuals"]) < 2.0
    assert found["log_det"] == before["log_det"], "not those of a table at rest"
    with pytest.raises(ValueError, match="only the gains' own machine can learn"):
        _core.predict(tried, seen, gains, learn=True)


def test_loops_that_tick_fast_have_the_gains_of_continuous_ones() -> None:
    """An independent way to the same limit: no tick, or twenty in a sample."""
    gains = []
    for period in (0.0, 5e-5):
        core = bench()
        for loop in ("speed", "position", "tension"):
            core.set(f"controller.{loop}_sample", period)
        seen = record({"theta_ref": REVERSALS}, np.zeros((10, len(CHANNELS))))
        torque = {"table": (2e-3, 0.99), "motor_1": (1e-4, 0.99), "motor_2": (1e-4, 0.99)}
        gains.append(_core.kalman_gains(core, seen, SENSORS, torque))
    # loops that hold for ever differ by 0.2 in contact
    continuous, fast = (g.log_det() for g in gains)
    assert fast == pytest.approx(continuous, abs=0.01)


def test_a_record_begins_where_its_encoder_errs_from() -> None:
    """What the law of an encoder adds to the first reading is no angle of the table."""
    reading, amplitude, phase = 0.01, 4e-4, 0.3
    law = {"encoder_eccentricity@table": {"amplitude": amplitude, "phase": phase}}
    seen = np.full((SAMPLES, len(CHANNELS)), reading) + coloured(np.random.default_rng(2), SAMPLES)
    seen[0] = reading
    t = STEP * np.arange(SAMPLES, dtype=np.float64)
    trace = Trace(t, {"theta_ref": 0.0 * t, **dict(zip(CHANNELS, seen.T, strict=True))}, name="r")
    plain = Machine.load("bench")
    [own] = predictable(core_of(plain), records(plain, {"r": trace}, start="rest"))
    [without], [first] = (own.initial(core, {}) for core in (core_of(plain), bench(law)))
    assert without["theta_m"] == reading
    angle = first["theta_m"]
    assert angle + amplitude * np.cos(angle + phase) == pytest.approx(reading, abs=1e-15)
    assert angle < reading - 0.9 * amplitude
    ratio = bench().get("mesh_1.ratio")
    wound = first["mesh_1.twist"] - without["mesh_1.twist"]
    assert wound == pytest.approx(ratio * (reading - angle))

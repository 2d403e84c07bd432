"""The predictor against the engines, against scipy's Riccati equation, and against its own noise.

A record is simulated by the exact engine with a torque of unknown course as a held input, and
sensors' noise of a recursion of its own is added: under the right model its innovations must be
white with variance 1, in contact, in play and at rest alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are
from scipy.signal import lfilter

from dualdrive import Machine, _core
from dualdrive.linear.small_signal import push, small_signal
from dualdrive.replay import core_of

Array = NDArray[np.float64]

STEP, CHANNELS = 1e-3, ("theta_m", "theta_1", "theta_2", "I_1", "I_2")
SENSORS = [(1e-6, 0.9, 0.0), (1e-5, 0.5, 0.0), (1e-5, 0.5, 0.0), (5e-3, 0.9, 0.0), (5e-3, 0.9, 0.0)]
TORQUE = {"table": (2e-3, 0.99)}
QUIET = dict.fromkeys(("motor_1", "motor_2", "table"), (0.0, 0.99))
OVERDAMPED = {
    "shaft_compliance@gearboxes": {"stiffness": 1.2e5},
    "mesh_damping@gearboxes": {"coefficient": 50.0},
}
REVERSALS = _core.cycle_of_moves([0.0, 0.05, -0.05, 0.0], 0.1, 1.0, 20.0)


def bench(
    effects: Mapping[str, Mapping[str, float]] | None = None, gap: float | None = None
) -> Any:
    machine = Machine.load("bench")
    for label, numbers in (effects or {}).items():
        machine.add(*label.split("@"), **numbers)
    if gap is not None:
        machine.set("meshes.gap", gap)
    return core_of(machine)


def run(core: Any, inputs: Mapping[str, Any], samples: int) -> Array:
    """Signals at the samples, by the exact engine, shape (samples, channels)."""
    times = STEP * np.arange(samples)
    found = _core.simulate(core, inputs, end=times[-1], times=list(times), signals=list(CHANNELS))
    column = {name: k for k, name in enumerate(found.names)}
    return np.column_stack([found.values[:, column[c]] for c in CHANNELS])


def record(inputs: Mapping[str, Any], measured: Array) -> Any:
    channels = [(c, [c]) for c in CHANNELS]
    times = STEP * np.arange(len(measured), dtype=np.float64)
    return _core.SampledRecord(dict(inputs), times, channels, np.ascontiguousarray(measured))


def coloured(random: np.random.Generator, samples: int) -> Array:
    """Noise of the sensors, stationary from the first sample on, shape (samples, channels)."""
    columns = []
    for drive, memory, _ in SENSORS:
        first = random.normal(0.0, drive / np.sqrt(1.0 - memory**2))
        w = drive * random.normal(size=samples)
        columns.append(lfilter([1.0], [1.0, -memory], np.r_[first, w[1:]]))
    return np.column_stack(columns)


def predicted(
    core: Any, seen: Any, torque: Mapping[str, tuple[float, float]], **options: Any
) -> Any:
    gains = _core.kalman_gains(core, seen, SENSORS, dict(torque))
    return _core.predict(core, seen, gains, **options)


@pytest.mark.parametrize(
    ("effects", "error"),
    [
        ({}, 2e-5),
        ({"coulomb@table": {"torque": 0.5}}, 2e-5),
        ({"torque_ripple@motors": {"amplitude": 0.03}}, 2e-4),
        ({"stribeck@table": {"torque": 0.5}}, 2e-4),
        ({"eccentricity@table": {"amplitude": 1e-4}}, 2e-5),
        # rings at 2.4 kHz where it carries: it opens and closes between two samples
        ({"gearbox_backlash@gearboxes": {"gap": 1e-3, "stiffness": 4e4}}, 5e-3),
        # relaxes within a 300th of a sample: to its switches the way is gone by halves of one
        (OVERDAMPED, 2e-5),
        ({"sensor_delay@motors": {"time": 5e-5}}, 2e-5),
        ({"sensor_delay@motors": {"time": 2e-3}}, 5e-5),
        ({"sensor_delay@table": {"time": 3e-3}}, 2e-5),
        ({"transport_delay@controller": {"delta_c": 2e-3}}, 5e-5),
        ({"transport_delay@controller": {"delta_t": 2e-3}}, 5e-5),
        ({"sensor_delay@motors": {"time": 1e-3}, "torque_ripple@motors": {}}, 2e-4),
    ],
    ids=[
        *("plain", "coulomb", "ripple", "stribeck", "eccentricity", "play", "overdamped"),
        *("hardly late", "late motors", "late table", "late command", "late slave"),
        "late and ripple",
    ],
)
def test_without_unknown_torque_it_is_a_simulation(
    effects: dict[str, dict[str, float]], error: float
) -> None:
    """Against the exact engine, RMS; the worst are currents in the sample of an impact."""
    core, inputs = bench(effects), {"theta_ref": REVERSALS}
    core.set("controller.T_ten", 0.0)  # flanks open and close
    truth = run(core, inputs, 3000)
    found = predicted(core, record(inputs, truth), {}, states=True)
    assert found["finite"]
    off = np.sqrt(np.mean(found["innovations"] ** 2, axis=0)) / np.std(truth, axis=0)
    assert np.max(off) < error
    assert np.max(off[:3]) < 0.05 * error, "angles"
    assert found["switches"] > 4, "the meshes' flanks open and close in this record"


@pytest.mark.parametrize(("stiffness", "damping"), [(4e5, 0.0), (4e6, 0.36)])
def test_a_rattle_is_followed_bounce_by_bounce(stiffness: float, damping: float) -> None:
    """Up to 28 contacts open and close within a sample, of two drives that are not quite alike.

    One bounce that is missed or put in the wrong order feeds the rattle.
    """
    play = {"gap": 3e-4, "stiffness": stiffness}
    core = bench(
        {
            "gearbox_backlash@gearboxes": play,
            "mesh_damping@gearboxes": {"coefficient": damping},
        }
    )
    inputs, samples = {"theta_ref": REVERSALS}, 300
    core.set("controller.T_ten", 0.0)
    core.set("motor_2.J", 1.001 * core.get("motor_2.J"))
    events = _core.simulate(
        core, inputs, end=STEP * samples, times=[0.0], signals=["theta_m"]
    ).events
    truth = run(core, inputs, samples)
    found = predicted(core, record(inputs, truth), {}, states=True)
    off = np.sqrt(np.mean(found["innovations"] ** 2, axis=0)) / np.std(truth, axis=0)
    assert np.max(off[:3]) < 1e-6
    assert found["switches"] == pytest.approx(len(events), rel=0.01)


def test_the_error_of_its_steps_falls_with_their_square() -> None:
    """Cogging of 24 periods a turn, which a step of a sample turns by a good part of one."""
    core = bench({"cogging@motors": {"amplitude": 0.02, "order": 24.0}})
    inputs = {"theta_ref": _core.sine(0.1, 1.0)}
    seen = record(inputs, run(core, inputs, 1000))
    one, two, eight = (
        np.abs(predicted(core, seen, QUIET, states=True, substeps=k)["innovations"][:, 0]).max()
        for k in (1, 2, 8)
    )
    assert one / two > 3.0
    assert two / eight > 10.0


@pytest.mark.parametrize(("amplitude", "order"), [(0.02, 24.0), (0.02, 48.0), (0.005, 96.0)])
def test_steps_are_as_short_as_noise_of_sensors_asks_for(amplitude: float, order: float) -> None:
    """A law that passes fast: what steps leave out is far less than the noise."""
    core = bench({"cogging@motors": {"amplitude": amplitude, "order": order}})
    inputs = {"theta_ref": REVERSALS}
    noisy = run(core, inputs, 3000) + coloured(np.random.default_rng(8), 3000)
    seen = record(inputs, noisy)
    own, fine = (predicted(core, seen, TORQUE, substeps=k)["residuals"] for k in (1, 64))
    assert np.sum((own - fine) ** 2) < 1.0  # of 15,000


@pytest.mark.parametrize("stiffness", [2e3, 2e4, 2e5])
def test_bristles_stiffer_than_a_sample_are_replayed(stiffness: float) -> None:
    """At full speed they relax by up to e^-30 from one sample to the next."""
    law = {
        "torque": 0.7,
        "static_ratio": 1.4,
        "speed": 0.02,
        "stiffness": stiffness,
        "damping": 2.0,
    }
    core, inputs = bench({"lugre@table": law}), {"theta_ref": REVERSALS}
    truth = run(core, inputs, 3000)
    found = predicted(core, record(inputs, truth), {}, states=True)
    assert found["finite"]
    off = np.sqrt(np.mean(found["innovations"] ** 2, axis=0)) / np.std(truth, axis=0)
    assert np.max(off) < 1e-3


def test_loops_that_tick_read_a_corner_as_the_engine_does() -> None:
    """Straight lines between samples, and loops that tick at them: the rate is that of the next."""
    core = bench()
    for loop in ("position", "speed"):
        core.set(f"controller.{loop}_sample", STEP)
    core.set("controller.f_v", 1.0)
    t = STEP * np.arange(1500, dtype=np.float64)
    corners = np.interp(t, [0.0, 0.2003, 0.6107, 0.9002, 1.5], [0.0, 0.0, 0.02, -0.01, -0.01])
    inputs = {"theta_ref": _core.sampled(t, corners, _core.Interpolation.linear)}
    truth = run(core, inputs, len(t))
    found = predicted(core, record(inputs, truth), {}, states=True)
    off = np.max(np.abs(found["innovations"]), axis=0) / np.std(truth, axis=0)
    assert np.max(off) < 1e-3


def test_gains_are_those_of_a_riccati_equation() -> None:
    """In contact, against scipy: the torque of unknown course is a state with a memory."""
    core = bench()
    system = small_signal(core, (1, 1))
    n, m = len(system.states), len(CHANNELS)
    column = system.B[:, system.inputs.index("torque@table")]
    C = np.array([system.C[system.signals.index(c)] for c in CHANNELS])
    drive, memory = TORQUE["table"]
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n] = system.A, column
    flow = expm(STEP * whole)
    F, Q, H = np.zeros((n + 1 + m, n + 1 + m)), np.zeros((n + 1 + m,) * 2), np.zeros((m, n + 1 + m))
    F[: n + 1, : n + 1] = flow
    F[n, n], Q[n, n] = memory, drive**2
    H[:, :n], H[:, n + 1 :] = C, np.eye(m)
    R = np.zeros((m, m))
    for j, (d, rho, white) in enumerate(SENSORS):
        F[n + 1 + j, n + 1 + j], Q[n + 1 + j, n + 1 + j] = rho, d**2
        R[j, j] = white**2 + (1e-3 * d) ** 2
    seen = record({"theta_ref": REVERSALS}, np.zeros((10, m)) + np.arange(10)[:, None])
    gains = _core.kalman_gains(core, seen, SENSORS, TORQUE)
    # scaled: scipy's solver is not balanced for states between 1e-6 rad and 1e2 V
    s = np.r_[np.full(n, 1e-3), 1e-2, [d for d, _, _ in SENSORS]]
    P = solve_discrete_are(
        (F / s[:, None] * s).T, (H * s).T, Q / np.outer(s, s), R, balanced=True
    ) * np.outer(s, s)
    S = H @ P @ H.T + R
    K = np.linalg.solve(S, H @ P).T
    W = gains.whitening()
    assert np.max(np.abs(W @ S @ W.T - np.eye(m))) < 1e-6
    assert gains.log_det() == pytest.approx(np.linalg.slogdet(S)[1], abs=1e-6)
    scaled = (gains.K() - K) / s[:, None] * np.sqrt(np.diag(S))
    assert np.max(np.abs(scaled)) < 1e-5


@pytest.mark.parametrize("friction", [0.0, 0.4], ids=["no friction", "coulomb"])
def test_innovations_of_a_right_model_are_white(friction: float) -> None:
    """Mean square 1, no correlation: the unknown torque is known by its statistics alone."""
    samples, random = 8000, np.random.default_rng(5)
    own = {"coulomb@table": {"torque": friction}} if friction else {}
    core, pushed = bench(own), bench(own)
    name = push(pushed, "table")
    drive, memory = TORQUE["table"]
    torque = lfilter([1.0], [1.0, -memory], drive * random.normal(size=samples))
    times = STEP * np.arange(samples)
    held = _core.sampled(times, torque, _core.Interpolation.hold)
    inputs = {"theta_ref": REVERSALS}
    truth = run(pushed, {**inputs, name: held}, samples)
    seen = record(inputs, truth + coloured(random, samples))
    found = predicted(core, seen, TORQUE, states=True)
    r = found["residuals"][1000:]
    assert np.mean(r**2, axis=0) == pytest.approx(np.ones(r.shape[1]), abs=0.1)
    for lag in (1, 2, 10):
        correlation = np.mean(r[lag:] * r[:-lag], axis=0)
        most = 0.1 if friction else 5.0 / np.sqrt(len(r))  # what rests creeps, to the filter
        assert np.max(np.abs(correlation)) < most, f"lag {lag}"
    if not friction:
        course = found["torques"][1000:, found["bodies"].index("table")]
        assert np.corrcoef(course, torque[1000:])[0, 1] > 0.8, "the torque itself is told"


@pytest.mark.parametrize("law", ["coulomb@table", "stribeck@table"])
def test_friction_bears_what_a_torque_of_unknown_course_adds(law: str) -> None:
    """It sets a body moving, or holds it, as any torque does.

    Moved by what only one side of the rule knew, a body that was stopped slid on and was stopped
    again at the same instant, twelve times a sample.
    """
    core = bench({law: {"torque": 0.5}})
    motion = {"theta_ref": _core.cycle_of_moves([0.0, 2e-3, -2e-3, 0.0], 0.02, 0.5, 20.0)}
    truth = run(core, {**motion, "T_load": _core.constant(0.35)}, 4000)
    seen = record({**motion, "T_load": _core.constant(0.0)}, truth)
    found = predicted(core, seen, {"table": (2e-2, 0.99)}, states=True)
    assert found["finite"]
    assert found["switches"] < 50, (
        "four moves, each with a start and a stop, and some while it creeps"
    )


def test_they_are_white_through_every_change_of_contact() -> None:
    """The covariance goes along: steady gains of each pattern left 12 sigma."""
    samples, random = 8000, np.random.default_rng(9)
    core = bench()
    core.set("controller.T_ten", 0.0)
    inputs = {"theta_ref": REVERSALS}
    seen = record(inputs, run(core, inputs, samples) + coloured(random, samples))
    found = predicted(core, seen, {"table": (1e-3, 0.99)}, states=True)
    assert len(set(found["pattern"])) > 1
    r = found["residuals"][100:]
    assert np.sqrt(np.mean(r**2, axis=0)) == pytest.approx(np.ones(r.shape[1]), abs=0.05)
    assert np.max(np.abs(r)) < 6.0


@pytest.mark.parametrize("tension", [0.12, 0.0])
@pytest.mark.parametrize("stiffness", [4e3, 4e5, 4e6])
def test_they_are_small_where_a_contact_rings_between_samples(
    stiffness: float, tension: float
) -> None:
    """A play that rattles without loss; with its rebounds in the filter they explode.

    What rebounds it has no correction could follow; what it does on the whole is told.
    """
    core = bench({"gearbox_backlash@gearboxes": {"gap": 3e-4, "stiffness": stiffness}})
    core.set("controller.T_ten", tension)
    inputs = {"theta_ref": REVERSALS}
    seen = record(inputs, run(core, inputs, 3000) + coloured(np.random.default_rng(1), 3000))
    torque = {"motor_1": (1e-3, 0.99), "motor_2": (1e-3, 0.99), **TORQUE}
    assert np.mean(predicted(core, seen, torque, learn=True)["residuals"] ** 2) < 1.2


def test_a_wrong_model_is_not_white() -> None:
    samples, random = 3000, np.random.default_rng(6)
    inputs = {"theta_ref": REVERSALS}
    truth = run(bench({"coulomb@table": {"torque": 0.4}}), inputs, samples)
    seen = record(inputs, truth + coloured(random, samples))
    found = predicted(bench(), seen, TORQUE)
    assert np.mean(found["residuals"] ** 2) > 2.0


def test_it_returns_from_a_wrong_start() -> None:
    """The record pulls the state back: the first angle is off by a hundred times the noise."""
    samples, random = 3000, np.random.default_rng(7)
    inputs = {"theta_ref": REVERSALS}
    core = bench()
    seen = record(inputs, run(core, inputs, samples) + coloured(random, samples))
    off = predicted(core, seen, TORQUE, initial=[{"theta_m": 1e-3}])
    assert np.mean(off["residuals"][500:] ** 2) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"sensors": SENSORS[:3]}, "3 noises for 5 channels"),
        ({"torque": {"flywheel": (1.0, 0.9)}}, "no body flywheel"),
        ({"initial": [{"theta_x": 1.0}]}, "no state theta_x"),
        ({"offsets": [0.0]}, "one offset per channel"),
        ({"channel": "theta_9"}, "no signal theta_9"),
        ({"times": np.array([0.0, 1e-3, 1e-3])}, "time does not increase at sample 2"),
        ({"measured": np.zeros((3, 2))}, "another shape"),
    ],
)
def test_bad_input_is_told(change: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        of_three_samples(**change)


def of_three_samples(
    channel: str = "theta_m",
    times: Array | None = None,
    measured: Array | None = None,
    sensors: Any = SENSORS,
    torque: Any = TORQUE,
    **options: Any,
) -> None:
    core, channels = bench(), [(c, [c]) for c in (channel, *CHANNELS[1:])]
    even, zeros = STEP * np.arange(3, dtype=np.float64), np.zeros((3, 5))
    seen = _core.SampledRecord(
        {"theta_ref": REVERSALS},
        even if times is None else times,
        channels,
        zeros if measured is None else measured,
    )
    _core.predict(core, seen, _core.kalman_gains(core, seen, sensors, torque), **options)


def test_same_input_same_bits() -> None:
    random = np.random.default_rng(8)
    core, inputs = bench({"stribeck@table": {"torque": 0.5}}), {"theta_ref": REVERSALS}
    seen = record(inputs, run(core, inputs, 1000) + coloured(random, 1000))
    first, second = (predicted(core, seen, TORQUE) for _ in range(2))
    assert np.array_equal(first["residuals"], second["residuals"])
    assert first["log_det"] == second["log_det"]

"""First-order changes of a replay against differences of replays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bench_record import grey_box
from dualdrive import Machine, _core
from dualdrive.diagnose.closed_loop import nominal_unknowns
from dualdrive.innovations import (
    GreyBox,
    Variant,
    changes,
    first_noise,
    predictable,
    prediction,
    slopes,
)
from dualdrive.replay import core_of, records
from dualdrive.traces import Trace
from recorded import demo, sheet
from test_innovations import (
    CHANNELS,
    REVERSALS,
    SENSORS,
    STEP,
    bench,
    coloured,
    record,
    run,
)

Array = NDArray[np.float64]

TORQUE = {"motor_1": (1e-3, 0.98), "motor_2": (1e-3, 0.98), "table": (2e-3, 0.99)}
GIVEN = 500  # till then flanks meet that lay apart, and that is forgotten
SECOND, DRIFTS = [0.1] * 5, [(1e-8, 0.999)] * 5


def seen(core: Any, samples: int = 3000) -> Any:
    """A record of the bench, noise in it."""
    inputs = {"theta_ref": REVERSALS}
    measured = run(core, inputs, samples) + coloured(np.random.default_rng(1), samples)
    return record(inputs, measured)


def with_law(law: str, numbers: Mapping[str, float]) -> Any:
    return bench({law: numbers})


def both(
    core: Any,
    other: Any,
    record: Any,
    offsets: Mapping[str, float] | None = None,
    **gains: Any,
) -> tuple[Array | None, Array]:
    """By the recursion, and by a replay of the other machine."""
    held = _core.kalman_gains(core, record, SENSORS, TORQUE, **gains)
    now = _core.predict(core, record, held, given=GIVEN, learn=True)["residuals"]
    adds = [(offsets or {}).get(c, 0.0) for c in CHANNELS]
    after = _core.predict(other, record, held, given=GIVEN, offsets=adds)["residuals"]
    [told] = _core.sensitivities(
        core, record, held, [(other, [], adds)], given=GIVEN, at_any_cost=True
    )
    return told, after - now


def apart(told: Array | None, change: Array) -> float:
    assert told is not None
    return float(np.linalg.norm(told - change) / np.linalg.norm(change))


@pytest.mark.parametrize("more", [{}, {"second": SECOND, "drifts": DRIFTS}], ids=["one", "more"])
@pytest.mark.parametrize(
    ("path", "share"),
    [
        ("table.J", 1e-6),
        ("motors.R", 1e-2),  # hardly felt: the current is controlled
        ("meshes.stiffness", 1e-6),
        ("meshes.gap", 1e-6),
        ("motor_1.K_d", 1e-6),
        ("controller.K_v", 1e-6),
    ],
)
def test_a_number_that_moves(path: str, share: float, more: dict[str, Any]) -> None:
    core = bench()
    other = core.copy()
    other.set(path, core.get(path) * (1.0 + share))
    assert apart(*both(core, other, seen(core), **more)) < 2e-3


@pytest.mark.parametrize("law", ["sensor_delay@motors", "sensor_delay@table"])
@pytest.mark.parametrize("path", ["table.J", "controller.K_v", "time"])
def test_a_loop_that_is_late(law: str, path: str) -> None:
    core = with_law(law, {"time": 1.3e-3})
    other, own = core.copy(), f"{law}.{path}" if path == "time" else path
    other.set(own, core.get(own) * (1.0 + 1e-6))
    assert apart(*both(core, other, seen(core))) < 1e-3


def test_a_sensor_that_adds() -> None:
    core = bench()
    assert apart(*both(core, core, seen(core), offsets={"theta_1": 1e-6, "I_2": 1e-4})) < 1e-4


def test_where_a_stretch_begins() -> None:
    core, whole = bench(), seen(bench())
    held = _core.kalman_gains(core, whole, SENSORS, TORQUE)
    found = _core.predict(core, whole, held, states=True)
    begins = dict(zip(found["states"], map(float, found["trajectory"][1000]), strict=True))
    moved = begins | {"theta_m": begins["theta_m"] + 1e-8}
    here = whole.stretches([(1000, 500)])
    now, after = (
        _core.predict(core, here, held, initial=[begin])["residuals"] for begin in (begins, moved)
    )
    [told] = _core.sensitivities(core, here, held, [(core, [moved], [])], initial=[begins])
    assert apart(told, after - now) < 2e-3


@pytest.mark.parametrize(
    ("path", "error"),
    [("table.J", 5e-3), ("mesh_1.gap", 2e-2), ("meshes.stiffness", 5e-3), ("controller.K_v", 1e-3)],
)
def test_through_every_change_of_contact(path: str, error: float) -> None:
    """256 changes in 3 s, most of two flanks that touch and part: neither at the same instant."""
    core = bench()
    core.set("controller.T_ten", 0.0)
    other = core.copy()
    other.set(path, core.get(path) * (1.0 + 1e-6))
    assert apart(*both(core, other, seen(core))) < error


def test_an_encoder_s_zero_where_flanks_part() -> None:
    core = bench()
    core.set("controller.T_ten", 0.0)
    assert apart(*both(core, core, seen(core), offsets={"theta_1": 1e-8})) < 2e-2


@pytest.mark.parametrize(
    "creep", [{}, {"creep": {"table": (1e-4, 0.99)}}], ids=["held", "creeping"]
)
@pytest.mark.parametrize("path", ["coulomb@table.torque", "table.J", "motors.J"])
def test_where_a_table_stops_and_breaks_away(path: str, creep: dict[str, Any]) -> None:
    """What comes to rest does so in both, a little earlier in one."""
    core = with_law("coulomb@table", {"torque": 0.5})
    other = core.copy()
    other.set(path, core.get(path) * (1.0 + 1e-6))
    assert apart(*both(core, other, seen(core), **creep)) < 1e-2


@pytest.mark.parametrize(
    ("law", "numbers", "error"),
    [
        ("torque_ripple@motor_1", {"amplitude": 1e-5, "order": 6.0}, 0.05),
        ("cogging@motor_1", {"amplitude": 1e-7, "order": 6.0, "phase": 1.0}, 0.01),
        ("eccentricity@table", {"amplitude": 1e-9}, 1e-3),
        ("torque_constant_saturation@motors", {"loss": 1e-5}, 0.1),
        ("encoder_eccentricity@table", {"amplitude": 1e-6}, 0.01),
        ("hydrostatic_drag@table", {"quadratic": 1e-4}, 5e-3),
        ("position_dependent_inertia@table", {"amplitude": 1e-6}, 0.02),
        ("mesh_damping@meshes", {"coefficient": 1e-4}, 1e-3),
        ("tension_mismatch@motor_2", {"error": 1e-5}, 1e-4),
    ],
)
def test_a_law_that_is_let_in(law: str, numbers: dict[str, float], error: float) -> None:
    """What it adds to rates is held over a sample, and felt before the sample corrects it."""
    core = bench()
    assert apart(*both(core, with_law(law, numbers), seen(core))) < error


@pytest.mark.parametrize(
    ("law", "numbers"),
    [
        ("coulomb@table", {"torque": 0.1}),  # one switch more
        ("gearbox_backlash@gearboxes", {"gap": 1e-4}),  # states more
        ("sensor_delay@theta_1", {"time": 1e-4}),
    ],
)
def test_what_it_cannot_tell(law: str, numbers: dict[str, float]) -> None:
    core = bench()
    other = with_law(law, numbers)
    here = seen(core, 200)
    held = _core.kalman_gains(core, here, SENSORS, TORQUE)
    assert _core.sensitivities(core, here, held, [(other, [], []), (core, [], [])])[0] is None
    assert _core.has_sensitivities(core, here)


@pytest.mark.parametrize("law", ["stribeck@table", "torque_ripple@motors"])
def test_none_beside_a_law_that_is_not_affine(law: str) -> None:
    core = with_law(law, {})
    here = seen(bench(), 200)
    assert not _core.has_sensitivities(core, here)


@pytest.mark.parametrize(("depth", "told"), [(1e-9, True), (1e-3, False)])
def test_flanks_that_part_elsewhere_are_no_small_change(depth: float, told: bool) -> None:
    core = bench()
    core.set("controller.T_ten", 0.0)
    other = core.copy()
    other.add_effect("wear", "table")
    other.set("wear@table.depth", depth)
    here = seen(core)
    held = _core.kalman_gains(core, here, SENSORS, TORQUE)
    near: list[tuple[Any, list[Any], list[float]]] = [(other, [], [])]
    [found] = _core.sensitivities(core, here, held, near, most_apart=0.1, at_any_cost=True)
    assert (found is not None) == told
    assert _core.sensitivities(core, here, held, near, at_any_cost=True)[0] is not None


@pytest.mark.parametrize(("tension", "told"), [(0.12, True), (0.0, False)])
def test_where_replays_cost_less(tension: float, told: bool) -> None:
    """Flanks that part and meet 85 times a second: each time the way is gone piece by piece."""
    core = bench()
    core.set("controller.T_ten", tension)
    here = seen(core)
    held = _core.kalman_gains(core, here, SENSORS, TORQUE)
    assert (_core.sensitivities(core, here, held, [(core, [], [])])[0] is not None) == told


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_differences_are_short_where_innovations_jump(seed: int) -> None:
    """Corrections part flanks, or do not: by longer ones some slopes were off by themselves."""
    slack = Machine.load("bench")
    slack.set("controller.T_ten", 0.0)
    own = grey_box(slack, core_of(slack), 3000, seed)
    nothing = Variant(own.core)
    here, [record] = own.of_the_data_sheet(nothing), own.records
    gains = own.gains(nothing, here, first_noise(own.core, own.records, 1e-3))
    [point] = own.points([nothing], [here], gains)
    few = 1e-3 * np.minimum(own.sigma, 1.0)
    moved = here + np.diag(few)

    def begun(theta: Array) -> tuple[Any, list[dict[str, float]], list[float]]:
        core, adds = own.machine(nothing, theta), own.constants(theta)
        return core, record.initial(core, adds), [adds.get(c, 0.0) for c in record.channels]

    core, initial, adds = begun(here)
    told = _core.sensitivities(
        core, record.sampled, gains[0], [begun(x) for x in moved],
        initial=initial, offsets=adds, given=prediction.GIVEN, at_any_cost=True,
    )  # fmt: skip
    for k, exact in enumerate(told):
        [found] = slopes(own, point, [k], gains)  # of so few by differences
        assert exact is not None
        assert apart(found, exact.ravel() / few[k]) < 0.02


def test_neighbours_do_not_see_each_other() -> None:
    """One alone, or among others: the same bits."""
    core = bench()
    others: list[tuple[Any, list[Any], list[float]]] = []
    for k in range(5):
        own = core.copy()
        own.set("table.J", core.get("table.J") * (1.0 + 1e-5 * (k + 1)))
        others.append((own, [], []))
    others.insert(2, (with_law("torque_ripple@motor_1", {"amplitude": 1e-4}), [], []))
    # one that acts on the control, and one that does not
    others.append((with_law("encoder_eccentricity@table", {"amplitude": 1e-4}), [], []))
    others.append((with_law("torque_constant_saturation@motors", {"loss": 0.1}), [], []))
    here = seen(core, 500)
    held = _core.kalman_gains(core, here, SENSORS, TORQUE)
    together = _core.sensitivities(core, here, held, others, at_any_cost=True)
    for own, among in zip(others, together, strict=True):
        [alone] = _core.sensitivities(core, here, held, [own], at_any_cost=True)
        np.testing.assert_array_equal(alone, among)


def test_what_grows_without_bound_is_told_by_replays() -> None:
    """A change beyond what a lost replay counts is none of first order: here of a sensor's zero."""
    core = core_of(sheet())
    grey = GreyBox(core, predictable(core, records(sheet(), {"fit": demo("fit")})), [], threads=1)
    nothing = Variant(core)
    here = grey.start(nothing)
    gains = grey.gains(nothing, here, first_noise(core, grey.records, 0.1))
    [point] = grey.points([nothing], [here], gains)
    little, much = here.copy(), here.copy()
    little[0], much[0] = 1e-3, 1e6
    told = changes(grey, point, [(nothing, little), (nothing, much)], gains)
    assert told[0] is not None
    assert told[1] is None
    [meant] = changes(grey, point, [(nothing, much)], gains, share=1e-9)
    assert meant is not None
    np.testing.assert_allclose(meant, 1e9 * told[0], rtol=1e-6, atol=1e-6 * np.max(np.abs(meant)))


def test_differences_only_of_the_record_that_no_first_order_tells_of() -> None:
    """Of two records, one of a sensor that was late by a part of a sample then."""
    machine = Machine.load("bench")
    machine.add("sensor_delay", "theta_m", time=0.0)
    times = STEP * np.arange(1500, dtype=np.float64)
    measured = run(bench(), {"theta_ref": REVERSALS}, len(times))
    measured += coloured(np.random.default_rng(2), len(times))
    columns = dict(zip(CHANNELS, measured.T, strict=True))
    trace = Trace(times, {"theta_ref": REVERSALS.value(times), **columns})
    settings = {"late": {"sensor_delay@theta_m.time": 0.3 * STEP}}
    traces = {"prompt": trace, "late": replace(trace, name="late")}
    core = core_of(machine)
    played = predictable(core, records(machine, traces, settings=settings, start="rest"))
    numbers = [p for p in nominal_unknowns(core, None) if "sensor_delay" not in p.path]
    grey = GreyBox(core, played, numbers, threads=1)
    nothing = Variant(core)
    theta = grey.start(nothing)
    gains = grey.gains(nothing, theta, first_noise(core, grey.records, 0.01))
    [point] = grey.points([nothing], [theta], gains)
    every, begun = range(len(theta)), grey.counter.replays
    found = np.stack(slopes(grey, point, every, gains))
    n = len(theta)
    assert grey.counter.replays - begun < 4 * n, "asked of both, then differences of one"
    parts = np.split(found, [point.residuals[0].size], axis=1)
    for k, part in enumerate(parts):
        here = replace(point, residuals=(point.residuals[k],))
        alone = np.stack(slopes(grey.on([grey.records[k]]), here, every, [gains[k]]))
        np.testing.assert_allclose(part, alone, rtol=1e-3, atol=1e-3 * np.abs(alone).max())


def test_a_joint_too_stiff_for_series_is_told_by_replays() -> None:
    """At any cost: to a switch they would be ten thousand millions."""
    joint = {
        "shaft_compliance@gearboxes": {"stiffness": 1.2e5},
        "mesh_damping@gearboxes": {"coefficient": 1e10},
    }
    core = bench(joint)
    core.set("controller.T_ten", 0.0)
    here = seen(core, 300)
    held = _core.kalman_gains(core, here, SENSORS, TORQUE)
    near: list[tuple[Any, list[Any], list[float]]] = [(core, [], [])]
    assert _core.predict(core, here, held)["switches"] > 4
    assert _core.sensitivities(core, here, held, near, at_any_cost=True) == [None]

"""Fits through the closed loop: an independent model, the demo, a real rig, and what goes wrong."""

from __future__ import annotations

import dataclasses
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dualdrive import Machine, replay
from dualdrive.estimation.unknowns import default_free, unknowns
from dualdrive.identify import BalanceFit, Fit, FitError, Progress, evaluate, fit
from dualdrive.identify.closed_loop import Problem, channels_to_fit
from dualdrive.identify.evaluation import state_unknowns
from dualdrive.replay import records
from dualdrive.traces import Trace
from measured import emps
from recorded import clean, demo, emps_rig, maker, sheet

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))
import four_drives

# --- an independent model: the answer is known and there is no noise ------------------------------


def test_numbers_put_into_an_independent_model_come_back() -> None:
    machine = sheet(torque=3000.0)
    off = {"table.J": 0.93, "motors.J": 1.06, "meshes.stiffness": 1.15, "table.b": 0.7}
    true = {path: machine.get(path) for path in off} | {"coulomb@table.torque": 12000.0}
    for path, factor in off.items():
        machine.set(path, factor * true[path])
    found = fit(machine, clean(), list(true), tolerance=1.0)
    assert found.ok
    assert found.error["nominal"] > 0.1
    assert found.error["refitted"] < 1e-3
    for path, value in true.items():
        assert found.parameters[path].value == pytest.approx(value, rel=2e-3), path
        assert found.machine.get(path) == found.parameters[path].value
    assert machine.get("table.J") == pytest.approx(0.93 * true["table.J"]), "fits do not change"
    assert "table.J" in found.machine.history[-1]["change"]


def test_an_effect_that_is_not_there_ends_at_its_bound() -> None:
    machine = sheet()
    machine.add("coulomb", "table")
    found = fit(machine, clean(friction=0.0), ["coulomb@table.torque", "table.b"])
    torque = found.parameters["coulomb@table.torque"]
    assert torque.value < 20.0, "a thousandth of what the demo hides"
    assert torque.low == 0.0
    assert torque.bound.startswith("at its lower bound")


def test_a_late_recorder_is_fitted_beside_the_machine() -> None:
    trace, late = clean(), 0.013
    skewed = trace.with_channel("theta_1", np.interp(trace.t - late, trace.t, trace["theta_1"]))
    machine = sheet(torque=12000.0)
    machine.add("sensor_delay", "theta_1")
    machine.add("sensor_offset", "I_2")
    paths = ["sensor_delay@theta_1.time", "sensor_offset@I_2.value"]
    wrong = skewed.with_channel("I_2", skewed["I_2"] + 0.3)
    found = fit(machine, wrong, paths, offsets="encoders")
    assert found.parameters[paths[0]].value == pytest.approx(late, rel=2e-2)
    assert found.parameters[paths[1]].value == pytest.approx(0.3, rel=1e-2)


# --- the demo -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def refitted() -> Fit:
    result: Fit = fit(sheet(), demo("fit"))
    return result


@pytest.fixture(scope="module")
def improved() -> Fit:
    machine = sheet()
    machine.add("coulomb", "table")
    result: Fit = fit(machine, demo("fit"))
    return result


def floor(record: str) -> float:
    """Headline error that the noise put into a record leaves by itself."""
    trace, noise = demo(record), maker.truth()["noise"]
    angle = noise["theta_m"]["rms"] * maker.ARCSEC
    e = angle / np.std(trace["theta_ref"] - trace["theta_m"])
    current = np.mean([noise[n]["rms"] / np.std(trace[n]) for n in ("I_1", "I_2")])
    twist = np.hypot(noise["theta_1"]["rms"] / 150.0, 20.0 * angle)
    x = [np.std(trace[f"theta_{n}"] / 150.0 - 20.0 * trace["theta_m"]) for n in (1, 2)]
    return float(np.mean([e, current, np.mean(twist / np.array(x))]))


def test_refitting_numbers_alone_does_not_reach_the_noise(refitted: Fit) -> None:
    assert refitted.ok
    assert refitted.error["refitted"] < refitted.error["nominal"]
    assert refitted.error["refitted"] > 5 * floor("fit")


def test_with_the_missing_effect_the_fit_reaches_the_noise(improved: Fit) -> None:
    assert improved.ok
    assert improved.error["refitted"] < 1.05 * floor("fit")


@pytest.mark.parametrize("start", ["auto", "rest"])
def test_held_out_record_is_met_as_well(improved: Fit, refitted: Fit, start: str) -> None:
    held_out = evaluate(improved.machine, demo("held_out"), start=start)
    assert held_out.error < 1.05 * floor("held_out")
    assert evaluate(refitted.machine, demo("held_out"), start=start).error > 0.1


def test_intervals_of_the_demo_hold_the_truth(improved: Fit) -> None:
    truth = maker.truth()
    true = {path: factor * maker.nominal()[path] for path, factor in truth["factors"].items()}
    true["coulomb@table.torque"] = truth["effect"]["torque"]
    true["coulomb@table.asymmetry"] = 0.0
    for path, value in true.items():
        found = improved.parameters[path]
        assert found.low <= value <= found.high, path
    torque = improved.parameters["coulomb@table.torque"]
    assert torque.value == pytest.approx(true["coulomb@table.torque"], rel=0.01)
    assert (torque.high - torque.low) / torque.value < 0.05


def test_what_the_record_does_not_tell_is_named(improved: Fit) -> None:
    """Motor and pinion turn as one body: their inertias show as one, J_d i² + J_c."""
    assert improved.parameters["pinions.J"].verdict == "prior"
    assert improved.parameters["table.J"].verdict == "identified"
    weakest = improved.directions[0].shares
    assert {"meshes.gap", "offset of x_1 in fit", "offset of x_2 in fit"} <= set(weakest)
    assert "barely determined" in improved.table()


# --- a real rig; that it leaves a sixth of the force without dry friction: test_real_data_cli.py --


@pytest.fixture(scope="module")
def rig() -> Trace:
    return emps()


def force_error(found: Fit, trace: Trace) -> float:
    """RMS residual over RMS force, as published."""
    left = found.fitted.residual(trace.name, "T_1")
    return float(np.sqrt(np.mean(left**2) / np.mean(trace["T_1"] ** 2)))


@pytest.mark.long
def test_dry_friction_accounts_for_it(rig: Trace) -> None:
    """Published: M 95.109, Fv 203.50, Fc 20.39, offset -3.165, found from force alone."""
    paths = ["table.J", "table.b", "coulomb@table.torque"]
    found = fit(emps_rig(10.0), rig, paths, tolerance=1.0, channels=["T_1"])
    assert found.ok
    assert force_error(found, rig) < 0.055
    assert found.parameters["table.J"].value == pytest.approx(95.109, rel=0.01)
    assert found.parameters["table.b"].value == pytest.approx(203.5, rel=0.05)
    assert found.parameters["coulomb@table.torque"].value == pytest.approx(20.39, rel=0.05)
    assert found.fitted.offsets["DATA_EMPS", "T_1"] == pytest.approx(-3.165, abs=0.1)
    assert found.parameters["table.J"].unit == "kg"


@pytest.mark.long
def test_friction_by_direction_explains_the_constant_force(rig: Trace) -> None:
    """The constant force is real, not the sensor's: the following error shows it as well."""
    paths = ["table.J", "table.b", "coulomb@table.torque"]
    even = fit(emps_rig(20.39), rig, paths, tolerance=1.0)
    uneven = fit(emps_rig(20.39), rig, [*paths, "coulomb@table.asymmetry"], tolerance=1.0)
    asymmetry = uneven.parameters["coulomb@table.asymmetry"]
    assert asymmetry.value * 20.39 == pytest.approx(-3.165, abs=0.3)
    assert asymmetry.high < 0.0
    assert abs(uneven.fitted.offsets["DATA_EMPS", "T_1"]) < 0.3
    assert uneven.fitted.errors["e"] < 0.7 * even.fitted.errors["e"]
    assert force_error(uneven, rig) < 0.046


def test_an_unknown_controller_goes_through_the_balance(rig: Trace) -> None:
    found = fit(emps_rig(10.0), rig.without("theta_ref"), ["table.J", "coulomb@table.torque"])
    assert isinstance(found, BalanceFit)
    assert found.parameters["table.J"].value == pytest.approx(95.109, rel=0.01)


# --- derivatives ----------------------------------------------------------------------------------


def problem(machine: Machine, trace: Trace, free: list[str], **options: Any) -> Problem:
    played = records(machine, {"r": trace})
    core = machine.core
    return Problem(
        core,
        played,
        unknowns(core, free, None, {}),
        state_unknowns(core, played),
        channels=channels_to_fit(played, None),
        **options,
    )


def test_jacobian_is_the_derivative_of_the_residual() -> None:
    machine = sheet(torque=9000.0, asymmetry=0.05)
    machine.add("sensor_delay", "theta_2", time=0.004)
    own = problem(machine, demo("fit"), default_free(machine.core), rtol=1e-11)
    u = own.levelled(own.start)
    jacobian = own.jacobian(u)
    for k in range(own.size):
        step = np.zeros(own.size)
        step[k] = 1e-4 * own.scale[k]
        numeric = (own.residual(u + step) - own.residual(u - step)) / (2 * step[k])
        size = np.linalg.norm(numeric)
        off = np.linalg.norm(jacobian[:, k] - numeric)
        # grazing contacts and the spline behind a delay leave little, never a wrong column
        assert off < 0.03 * size + 1e-9 * np.linalg.norm(jacobian), k


@pytest.mark.parametrize("slope", [1e200, np.inf, np.nan])
def test_slopes_that_explode_are_an_error_not_a_crash(
    slope: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = problem(sheet(), demo("fit"), ["table.J"])
    real = own.replays(own.start, slopes=True)
    assert real is not None
    wild = [
        dataclasses.replace(r, slopes={name: 0.0 * x + slope for name, x in r.slopes.items()})
        for r in real
    ]
    monkeypatch.setattr(own, "replays", lambda *_, **__: wild)
    with pytest.raises(FitError, match=r"r: the sensitivities of \w+ overflow"):
        own.jacobian(own.start)


# --- where a fit begins ---------------------------------------------------------------------------


@pytest.mark.long
def test_four_drives_are_fitted_from_afar() -> None:
    """A simulated error alone leads to 1.39 kg*m^2 and 3.27 N*m: what predicts leads on."""
    true, guess = four_drives.machine(), four_drives.machine()
    inertia = four_drives.HEAVIER * true.get("table.J")
    true.set("table.J", inertia)
    for machine, friction in ((true, four_drives.FRICTION), (guess, 1.0)):
        machine.add_effect("coulomb", "table")
        machine.set("coulomb@table.torque", friction)
    record = four_drives.records(true)["reversals"]
    found = fit(guess, record, ["table.J", "coulomb@table.torque"])
    assert found.parameters["table.J"].value == pytest.approx(inertia, rel=2e-3)
    friction = found.parameters["coulomb@table.torque"].value
    assert friction == pytest.approx(four_drives.FRICTION, rel=2e-3)


# --- how a fit ends -------------------------------------------------------------------------------


def test_ctrl_c_keeps_the_best_point() -> None:
    machine, seen = sheet(), []
    machine.add("coulomb", "table")

    def stop(now: Progress) -> None:
        seen.append(now)
        if len(seen) == 3:
            raise KeyboardInterrupt

    found = fit(machine, demo("fit"), progress=stop)
    assert found.status == "interrupted"
    assert "best point so far" in found.message
    assert found.machine.history[-1]["change"].startswith("fitted to fit (interrupted): ")
    assert found.error["refitted"] < found.error["nominal"]
    assert seen[-1].best <= seen[0].cost


@pytest.mark.parametrize("limit", range(3, 19, 3))
def test_too_few_simulations_are_said(limit: int) -> None:
    """Wherever the limit strikes: in the first descent or between rounds of new weights."""
    found = fit(sheet(), demo("fit"), ["table.J", "table.b"], max_simulations=limit)
    if found.status == "success":
        assert found.simulations <= limit + 1
        return
    assert found.status == "not_converged"
    assert f"max_simulations = {limit}" in found.message
    assert np.isfinite(found.error["refitted"])


def test_failed_trials_are_stepped_round_and_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every third trial fails as a chattering machine would."""
    count, real = [0], replay.play_all

    def troubled(core: Any, several: Any, asked: Any = (), *args: Any, **options: Any) -> Any:
        replays = real(core, several, asked, *args, **options)
        if not asked:
            count[0] += 1
            if count[0] % 3 == 0:
                failed = replays[0].__class__(several[0], "chattering", "at t = 1 s: too much")
                return [failed, *replays[1:]]
        return replays

    monkeypatch.setattr("dualdrive.identify.closed_loop.play_all", troubled)
    machine = sheet()
    machine.add("coulomb", "table")
    found = fit(machine, demo("fit"), ["table.J", "coulomb@table.torque"])
    assert found.failures
    assert "chattering" in found.failures[0]
    assert found.parameters["coulomb@table.torque"].value == pytest.approx(12000.0, rel=0.05)
    assert np.isfinite([p.high for p in found.parameters.values()]).all()


@pytest.mark.long
def test_a_machine_that_never_simulates_is_an_error_with_its_status() -> None:
    machine = sheet(torque=12000.0)
    machine.set("controller.k_p", 1e12)
    with pytest.raises(FitError, match="fit: ") as failure:
        fit(machine, demo("fit"), ["table.J"], start="rest")
    assert "\n" not in str(failure.value)


@pytest.mark.long
def test_several_starts_keep_the_best() -> None:
    machine = sheet()
    machine.add("coulomb", "table")
    paths = ["table.J", "motors.J", "coulomb@table.torque"]
    one = fit(machine, demo("fit"), paths)
    more = fit(machine, demo("fit"), paths, starts=3, seed=4)
    assert more.error["refitted"] <= 1.001 * one.error["refitted"]
    assert more.simulations > one.simulations


@pytest.mark.parametrize(
    ("free", "options", "words"),
    [
        (["table.mass"], {}, "table.mass"),
        (["meshes.gap", "mesh_1.gap"], {}, "both move mesh_1.gap"),
        (["meshes.ratio"], {}, "counted or set"),
        (["table.J"], {"tolerance": {"table.b": 0.1}}, "not among the free"),
        (["table.J"], {"tolerance": 0.0}, "must be positive"),
        (["table.J"], {"tolerance": 1e-308}, "must be positive, 1e-06 at least"),
        (["table.J"], {"mode": "open"}, "closed_loop"),
        (["table.J"], {"channels": ["omega_9"]}, "omega_9"),
        ([], {}, "nothing to fit"),
    ],
)
def test_what_makes_no_sense_is_refused(
    free: list[str], options: dict[str, Any], words: str
) -> None:
    with pytest.raises((ValueError, FitError), match=words) as refusal:
        fit(sheet(), demo("fit"), free, **options)
    assert "\n" not in str(refusal.value)


def test_default_is_what_data_sheets_state_with_a_tolerance(improved: Fit) -> None:
    assert set(improved.parameters) == {
        *("motors.J", "motors.b", "pinions.J", "pinions.b", "table.J", "table.b"),
        *("meshes.stiffness", "meshes.gap", "mesh_damping@meshes.coefficient"),
        *("coulomb@table.torque", "coulomb@table.asymmetry"),
    }


def test_json_has_plain_numbers(improved: Fit) -> None:
    figures = json.loads(improved.to_json())
    assert figures["error"]["refitted"] == pytest.approx(improved.error["refitted"])
    torque = figures["parameters"]["coulomb@table.torque"]
    assert torque["low"] < torque["value"] < torque["high"]
    assert torque["tolerance"] is None
    assert torque["unit"] == "N*m"

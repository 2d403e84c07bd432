"""Effects that are parts of the machine: one value with two paths, one mechanism with two names."""

from __future__ import annotations

import pickle
import tomllib
from typing import Any

import numpy as np
import pytest

from dualdrive import Machine, MachineError, _core
from dualdrive.diagnose.candidates import candidates
from dualdrive.estimation.unknowns import unknowns
from dualdrive.identify import default_free, fit
from dualdrive.motion import move
from dualdrive.simulation import simulate
from dualdrive.traces import Trace

QUICK = move(0.3, v=1.5, a=5.0, j=50.0, end=0.6)
KINDS = {"gearbox_backlash": "gap", "shaft_compliance": "compliant"}


def bench(**settings: float) -> Machine:
    machine = Machine.load("bench")
    for path, value in settings.items():
        machine.set(path.replace("__", "."), value)
    return machine


def with_effect(effect: str, place: str, **numbers: Any) -> Machine:
    machine = bench()
    machine.add(effect, place, **numbers)
    return machine


def loose(kind: str, **numbers: float) -> Machine:
    """The bench with another kind of gearbox, as its file would have it."""
    lines = [f'kind = "{kind}"', *(f"{name} = {value}" for name, value in numbers.items())]
    return Machine.from_toml(bench().toml().replace('kind = "rigid"', "\n".join(lines)), "bench")


def values(machine: Machine) -> dict[str, float]:
    return {p.path: p.value for p in machine.core.parameters()}


CASES = [
    ("current_limit", "motors", {"T_max": 0.06}, "motors"),
    ("voltage_limit", "motors", {"U_max": 8.0}, "motors"),
    ("transport_delay", "controller", {"delta_t": 2e-3}, "controller"),
]


# --- the same machine by hand ---------------------------------------------------------------------


@pytest.mark.parametrize(("effect", "place", "numbers", "part"), CASES)
def test_a_limit_or_lag_is_the_controllers_own(
    effect: str, place: str, numbers: dict[str, float], part: str
) -> None:
    machine, by_hand = with_effect(effect, place, **numbers), bench()
    for name, value in numbers.items():
        by_hand.set(f"{part}.{name}", value)
    assert values(machine) == values(by_hand)
    here, there = (simulate(m, QUICK) for m in (machine, by_hand))
    assert here.values.tobytes() == there.values.tobytes()
    plain = simulate(bench(), QUICK)
    assert np.abs(here["e"] - plain["e"]).max() > 1e-5  # the case does bite


@pytest.mark.parametrize("effect", KINDS)
def test_a_joint_is_a_connection_of_that_kind(effect: str) -> None:
    numbers = {"stiffness": 500.0} | ({"gap": 2e-3} if effect == "gearbox_backlash" else {})
    machine = with_effect(effect, "gearboxes", **numbers)
    by_hand = loose(KINDS[effect], **numbers)
    assert values(machine) == values(by_hand)
    here, there = (simulate(m, QUICK) for m in (machine, by_hand))
    assert here.names == there.names
    assert here.values.tobytes() == there.values.tobytes()
    assert here.events == there.events
    assert len(here.events) > len(simulate(bench(), QUICK).events) or effect != "gearbox_backlash"


def test_a_late_command_is_a_late_sensor_under_a_late_motion() -> None:
    """The position loop as a whole answers that much later; nothing else in it knows the time."""
    late = 3e-3
    machine = with_effect("transport_delay", "controller", delta_c=late)
    again = with_effect("sensor_delay", "table", time=late)
    shifted = move(0.3, v=1.5, a=5.0, j=50.0, start=late, end=0.6)
    here, there = simulate(machine, QUICK, rtol=1e-10), simulate(again, shifted, rtol=1e-10)
    for name in ("theta_m", "I_1", "I_2"):
        assert np.abs(here[name] - there[name]).max() < 1e-6 * np.abs(here[name]).max()
    inside = here.t > 0.1
    before = np.interp(here.t[inside] - late, here.t, here["Omega_0"])
    assert np.abs(here["Omega_1"][inside] - before).max() < 1e-3 * np.abs(before).max()


def test_added_and_not_yet_sized_it_changes_next_to_nothing() -> None:
    plain = simulate(bench(), QUICK)
    for effect, place in (
        ("current_limit", "motors"),
        ("voltage_limit", "motors"),
        ("transport_delay", "controller"),
    ):
        run = simulate(with_effect(effect, place), QUICK)
        assert run.values.tobytes() == plain.values.tobytes(), effect
    for effect in KINDS:
        machine = with_effect(effect, "gearboxes")
        stiffness = machine.get(f"{effect}@gearboxes.stiffness")
        i, motor, pinion = (machine.get(f"{p}_1.{n}") for p, n in (
            ("gearbox", "ratio"), ("motor", "J"), ("pinion", "J")))  # fmt: skip
        both = 1 / (1 / (i**2 * motor) + 1 / pinion)
        assert np.sqrt(stiffness / both) == pytest.approx(2 * np.pi * 1000)
        run = simulate(machine, QUICK)
        assert np.abs(run["theta_m"] - plain["theta_m"]).max() < 2e-3 * np.abs(plain["e"]).max()


# --- one value, two paths -------------------------------------------------------------------------


def test_the_two_paths_are_one_value() -> None:
    machine = with_effect("current_limit", "motors")
    assert machine.core.members("current_limit@motors.T_max") == ["motor_1.T_max", "motor_2.T_max"]
    machine.set("current_limit@motors.T_max", "80%")  # of the rated torque, as at the motor
    assert machine.get("motor_2.T_max") == pytest.approx(0.8 * machine.get("motor_2.T_rated"))
    machine.set("motor_1.T_max", 3.0)
    with pytest.raises(MachineError, match="its members differ"):
        machine.get("current_limit@motors.T_max")
    assert machine.parameter("current_limit@motors.T_max").unit == "N*m"
    with pytest.raises(MachineError, match=r"did you mean current_limit@motors\.T_max"):
        machine.get("current_limit@motors.Tmax")


def test_play_may_be_given_in_any_frame() -> None:
    machine = with_effect("gearbox_backlash", "gearboxes")
    play = {"value": 1e-2, "frame": "motor", "measure": "full"}
    machine.set("gearbox_backlash@gearboxes.gap", play)
    assert machine.get("gearbox_2.gap") == pytest.approx(0.5e-2 / machine.get("gearboxes.ratio"))


def every_one() -> Machine:
    machine = bench()
    machine.add("gearbox_backlash", "gearbox_1", gap=1e-3)
    machine.add("shaft_compliance", "gearboxes", stiffness=700.0)
    machine.add("current_limit", "motors", T_max=2.0)
    machine.add("voltage_limit", "motor_2", U_max=100.0)
    machine.add("transport_delay", "controller", delta_c="2 ms")
    return machine


def test_it_survives_file_pickle_and_copy() -> None:
    machine = every_one()
    kinds = [machine.core.kind(f"gearbox_{n}") for n in (1, 2)]
    assert kinds == ["gap", "compliant"]
    machine.set("motor_1.T_max", 1.5)  # the members differ now: only the parts can say so
    machine.set("shaft_compliance@gearboxes.stiffness", 900.0)
    for again in (
        Machine.from_toml(machine.toml()),
        pickle.loads(pickle.dumps(machine)),
        machine.copy(),
    ):
        assert values(again) == values(machine)
        assert again.effects == machine.effects
        assert [again.core.kind(f"gearbox_{n}") for n in (1, 2)] == kinds
        assert again.toml() == machine.toml()
        again.remove("gearbox_backlash@gearbox_1")
        again.remove("shaft_compliance@gearboxes")
        assert [again.core.kind(f"gearbox_{n}") for n in (1, 2)] == ["rigid", "rigid"]


def test_a_changed_number_is_written_where_the_effect_states_it() -> None:
    machine = Machine.from_toml(every_one().toml())
    machine.set("gearbox_1.stiffness", 900.0)
    machine.set("gearbox_2.stiffness", 900.0)  # both effects at gearbox_1 state it
    machine.set("current_limit@motors.T_max", np.inf)  # and this one states it no more
    stated = tomllib.loads(machine.toml())
    assert stated["gearboxes"] == {"kind": "rigid", "ratio": 10}
    assert [e.get("stiffness") for e in stated["effects"][1:3]] == [900.0, 900.0]
    assert values(Machine.from_toml(machine.toml())) == values(machine)


def test_taken_out_it_is_off() -> None:
    machine = every_one()
    machine.remove("gearbox_backlash@gearbox_1")
    assert machine.core.kind("gearbox_1") == "compliant"  # still asked for by the other one
    assert machine.get("gearbox_1.stiffness") == 700.0
    for label in machine.effects[:]:
        if _core.effect_type(label.partition("@")[0]).structural:
            machine.remove(label)
    assert machine.core.kind("gearbox_1") == "rigid"
    assert np.isinf(machine.get("motors.T_max"))
    assert np.isinf(machine.get("motor_2.U_max"))
    assert np.isfinite(machine.get("motor_1.U_max"))  # that one was not asked for
    assert machine.get("controller.delta_c") == 0.0


def test_a_step_of_the_history_takes_it_back() -> None:
    machine = bench()
    before = values(machine)
    machine.add("current_limit", "motors", T_max=2.0)
    machine.note("a limit")
    machine.add("gearbox_backlash", "gearboxes", gap=1e-3)
    machine.note("play")
    again = Machine.from_toml(machine.toml())
    again.undo()
    assert again.get("motors.T_max") == 2.0
    assert again.core.kind("gearbox_1") == "rigid"
    again.undo()
    assert values(again) == before


def test_a_joint_that_gave_before_goes_back_to_what_it_was() -> None:
    machine = loose("compliant", stiffness=444.0)
    machine.add("gearbox_backlash", "gearboxes", gap=1e-3)
    assert machine.get("gearbox_backlash@gearboxes.stiffness") == 444.0
    machine.remove("gearbox_backlash@gearboxes")
    assert machine.core.kind("gearbox_1") == "compliant"
    assert machine.get("gearboxes.stiffness") == 444.0


# --- refusals -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("effect", "place", "rule"),
    [
        ("gearbox_backlash", "table", "no gearbox named table"),
        ("gearbox_backlash", "mesh_1", "play of its own"),
        ("current_limit", "table", "no motor named table"),
        ("transport_delay", "motors", "it sits at controller"),
    ],
)
def test_places_that_have_no_such_part(effect: str, place: str, rule: str) -> None:
    with pytest.raises(MachineError, match=rule):
        bench().add(effect, place)


def test_no_second_one_of_the_same() -> None:
    machine = with_effect("current_limit", "motor_1", T_max=2.0)
    with pytest.raises(MachineError, match=r"motor_1 has it already, as current_limit@motor_1"):
        machine.add("current_limit", "motors")


def test_a_motor_on_its_pinion_has_no_gearbox() -> None:
    core = _core.Machine()
    core.add_body("pinion_1")
    core.add_motor("motor_1", body="pinion_1", kind="direct")
    with pytest.raises(ValueError, match="sits on its pinion directly"):
        core.add_effect("shaft_compliance", "gearboxes")
    with pytest.raises(ValueError, match="this machine has none"):
        core.add_effect("current_limit", "motors")


def test_a_refused_number_leaves_the_machine_as_it_was() -> None:
    machine = bench()
    before = values(machine)
    with pytest.raises(MachineError, match="out of bounds"):
        machine.add("current_limit", "motors", T_max=-5.0)
    assert values(machine) == before
    assert machine.effects == bench().effects


# --- derivatives, fits, screening -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("effect", "place", "name", "value", "step"),
    [
        ("gearbox_backlash", "gearboxes", "gap", 2e-3, 1e-6),
        ("shaft_compliance", "gearboxes", "stiffness", 500.0, 1e-2),
        ("current_limit", "motors", "T_max", 0.06, 1e-6),
        ("transport_delay", "controller", "delta_c", 3e-3, 1e-7),
    ],
)
def test_derivatives_by_its_own_path(
    effect: str, place: str, name: str, value: float, step: float
) -> None:
    path = f"{effect}@{place}.{name}"
    short = move(0.3, v=1.5, a=5.0, j=50.0, end=0.2)

    def e(at: float, **options: Any) -> Any:
        machine = with_effect(effect, place, stiffness=500.0, gap=at) if name == "gap" else (
            with_effect(effect, place, **{name: at}))  # fmt: skip
        return simulate(machine, short, rtol=1e-11, engine="cvode", **options)

    slope = e(value, sensitivities=[path]).sensitivity("e", path)
    difference = (e(value + step)["e"] - e(value - step)["e"]) / (2 * step)
    assert np.abs(slope - difference).max() < 2e-3 * np.abs(difference).max()


def recorded(machine: Machine) -> Trace:
    run = simulate(machine, QUICK, rtol=1e-10)
    names = ("theta_ref", "theta_1", "theta_2", "theta_m", "I_1", "I_2")
    return Trace(np.array(run.t), {name: np.array(run[name]) for name in names}, name="made")


@pytest.mark.parametrize(
    ("effect", "place", "numbers", "start"),
    [
        ("transport_delay", "controller", {"delta_c": 4e-3}, {"delta_c": 1e-3}),
        ("current_limit", "motors", {"T_max": 0.06}, {}),  # from no limit at all
        ("shaft_compliance", "gearboxes", {"stiffness": 500.0}, {}),  # from nearly rigid
    ],
)
def test_it_is_fitted_under_its_own_path(
    effect: str, place: str, numbers: dict[str, float], start: dict[str, float]
) -> None:
    ((name, truth),) = numbers.items()
    trace = recorded(with_effect(effect, place, **numbers))
    suspect = with_effect(effect, place, **start)
    if name == "T_max":
        suspect.set(f"{effect}@{place}.{name}", np.inf)
    path = f"{effect}@{place}.{name}"
    found = fit(suspect, trace, free=[path], offsets="none", max_simulations=40)
    assert found.machine.get(path) == pytest.approx(truth, rel=1e-3)


def test_what_an_effect_lends_is_free_once_and_believed_nothing_of() -> None:
    machine = every_one()
    machine.set("motors.T_max", np.inf)
    free = default_free(machine.core)
    own = {path for path in free if "@" in path and "mesh_damping" not in path}
    assert own == {
        "gearbox_backlash@gearbox_1.gap",
        "shaft_compliance@gearboxes.stiffness",  # both effects lend it; this one has more of it
        "current_limit@motors.T_max",
        "voltage_limit@motor_2.U_max",
        "transport_delay@controller.delta_c",
        "transport_delay@controller.delta_t",
    }
    assert not any(path.startswith("gearbox") and "@" not in path for path in free)
    found = {
        x.path: x for x in unknowns(machine.core, free, None, {"current_limit@motors.T_max": 2})
    }
    assert found["current_limit@motors.T_max"].nominal == 2  # a limit that is off begins somewhere
    assert all(np.isinf(found[path].sigma) for path in own)


def test_candidates_leave_out_what_the_machine_has() -> None:
    machine = bench()

    def offered() -> set[str]:
        return {h.label for h in candidates(machine.core)}

    assert {"gearbox_backlash@gearboxes", "shaft_compliance@gearboxes"} <= offered()
    assert "transport_delay@controller" in offered()
    assert "quantisation@table" not in offered()  # a continuous loop can't
    assert "coulomb@table" in offered()
    machine.add("coulomb", "table", torque=0.01)
    assert "coulomb@table" not in offered()
    machine.set("pinions.J", 0.0)
    assert "shaft_compliance@gearboxes" not in offered()
    machine = loose("compliant", stiffness=444.0)
    assert "shaft_compliance@gearboxes" not in offered()
    assert "gearbox_backlash@gearboxes" in offered()
    machine = loose("gap", stiffness=444.0, gap=1e-3)
    assert not {"shaft_compliance@gearboxes", "gearbox_backlash@gearboxes"} & offered()

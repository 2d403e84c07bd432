"""The screening names what was left out, on records of machines that the core made itself.

What it does on data of another program is the demo's matter (test_demo_story.py).
"""

from __future__ import annotations

import numpy as np
import pytest

import dualdrive
from dualdrive.identify import candidates_of, screen
from dualdrive.traces import Trace

SHEET = dualdrive.demo.sheet()


#: white noise of good sensors, SI
NOISE = {"theta_m": 3e-8, "theta_1": 5e-6, "theta_2": 5e-6, "I_1": 0.02, "I_2": 0.02}


#: a few that explain much alike
RIVALS = [
    ("viscous", "table"),
    ("coulomb", "table"),
    ("coulomb", "pinions"),
    ("coulomb", "motors"),
    ("angle_dependent_friction", "pinions"),
    ("eccentricity", "pinions"),
    ("cogging", "motors"),
    ("torque_ripple", "motors"),
    ("sensor_delay", "table"),
    ("sensor_delay", "motors"),
    ("transport_delay", "controller"),
]


def record_of(machine: dualdrive.Machine) -> Trace:
    """What sensors of this machine would show of two moves; a late one is late in its record."""
    for effect in machine.copy().core.effects if "sensor_delay@motors" in machine.effects else ():
        if effect["label"] == "sensor_delay@motors":
            machine = machine.copy()
            for n in (1, 2):
                machine.add(
                    "sensor_delay", f"theta_{n}", time=machine.get("sensor_delay@motors.time")
                )
    motion = dualdrive.motion.cycle([0.0, 0.02, 0.0], v=0.02, a=0.012, j=0.05, dwell=0.5, start=1.0)
    run = dualdrive.simulate(machine, motion, output_step=1e-2)
    assert run.ok
    random = np.random.default_rng(7)
    channels = {}
    for name in ("theta_ref", "omega_ref", "theta_m", "theta_1", "theta_2", "I_1", "I_2"):
        values = np.array(run[name])
        if not name.endswith("_ref"):
            values += NOISE[name] * random.standard_normal(len(values))
        channels[name] = values
    units = {"theta_ref": "rad", "omega_ref": "rad/s", "I_1": "A", "I_2": "A"}
    return Trace(run.t, channels, units={n: units.get(n, "rad") for n in channels})


@pytest.mark.parametrize(
    ("effect", "place", "sizes"),
    [
        ("coulomb", "table", {"torque": 4000.0}),
        ("coulomb", "pinions", {"torque": 200.0}),
        ("torque_ripple", "motors", {"amplitude": 0.05}),
        ("sensor_delay", "motors", {"time": 4e-3}),
    ],
)
def test_it_ranks_the_missing_effect_first_and_sizes_it(
    effect: str, place: str, sizes: dict[str, float]
) -> None:
    true = SHEET.copy()
    true.add(effect, place, **sizes)
    everything = (effect, place) == ("coulomb", "table")  # once, for it takes its time
    ranked = screen(SHEET, record_of(true), None if everything else RIVALS)
    best = ranked[0]
    twins = {best.label} | {c.label for c in ranked if c.same_as == best.label}
    assert f"{effect}@{place}" in twins
    assert best.explained > 0.5
    strength, size = next(iter(sizes.items()))
    found = next(c for c in ranked if c.label == f"{effect}@{place}")
    assert found.expected[f"{found.label}.{strength}"] == pytest.approx(size, rel=0.5)


@pytest.mark.parametrize(
    ("effect", "place", "number", "size"),
    [
        ("transport_delay", "controller", "delta_c", 8e-3),
        ("shaft_compliance", "gearboxes", "stiffness", 2e7),
        ("current_limit", "motors", "T_max", 19.0),
    ],
)
def test_a_part_of_the_machine_is_tried_at_a_size(
    effect: str, place: str, number: str, size: float
) -> None:
    suspect = SHEET.copy()
    suspect.set("motors.T_max", np.inf)
    true = suspect.copy()
    true.add(effect, place, **{number: size})
    tried = [
        ("transport_delay", "controller"),
        ("shaft_compliance", "gearboxes"),
        ("current_limit", "motors"),
        ("coulomb", "table"),
    ]
    best, *others = screen(suspect, record_of(true), tried)
    assert best.label == f"{effect}@{place}"
    assert best.explained > 0.5 + others[0].explained
    assert best.expected[f"{best.label}.{number}"] == pytest.approx(size, rel=0.1)


def test_nothing_missing_explains_nothing() -> None:
    ranked = screen(SHEET, record_of(SHEET))
    assert ranked[0].explained < 0.05


def test_a_friction_behind_a_rigid_reducer_is_named_a_twin() -> None:
    true = SHEET.copy()
    true.add("coulomb", "motors", torque=1.0)
    ranked = {c.label: c for c in screen(SHEET, record_of(true), RIVALS)}
    pair = {ranked["coulomb@motors"].same_as, ranked["coulomb@pinions"].same_as}
    assert pair & {"coulomb@motors", "coulomb@pinions"}


def test_candidates_fit_the_machine() -> None:
    labels = candidates_of(SHEET.core)
    assert ("mesh_damping", "meshes") not in labels  # it has that already
    assert ("coulomb", "table") in labels


def test_an_unknown_candidate_is_refused() -> None:
    with pytest.raises(ValueError, match="frictoin"):
        screen(SHEET, record_of(SHEET), [("frictoin", "table")])

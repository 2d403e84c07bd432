"""Records simulated whole: which a simulation can follow, and what the errors then count."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from dualdrive import Machine
from dualdrive.diagnose.simulated_errors import of_the_data_sheet
from dualdrive.innovations import GreyBox, Noise, predictable
from dualdrive.replay import core_of, records
from test_first_states import trace
from test_innovations import SENSORS, coloured

SAMPLES = 5000
SLACK, TIGHT = "slack", "tight"
TENSION = {SLACK: 0.0, TIGHT: 0.3}


@functools.cache
def grey_box(detents: float, names: tuple[str, ...]) -> GreyBox:
    """The bench with detents of its motors in N*m, its records made by the exact engine."""
    machine = Machine.load("bench")
    if detents:
        machine.add("cogging", "motors", amplitude=detents, order=24, phase=0.3)
    settings = {name: {"controller.T_ten": TENSION[name]} for name in names}
    traces = {}
    for name in names:
        own = machine.copy()
        own.set("controller.T_ten", TENSION[name])
        seed = int(TENSION[name] > 0.0)
        traces[name] = trace(core_of(own), 0.0, coloured(np.random.default_rng(seed), SAMPLES))
    core = core_of(machine)
    return GreyBox(core, predictable(core, records(machine, traces, settings=settings)), [])


def sensors(own: GreyBox) -> Noise:
    [first, *_] = own.records
    known = dict(zip(first.kinds, SENSORS, strict=True))
    return Noise({k: s[0] for k, s in known.items()}, {k: s[1] for k, s in known.items()}, {})


def test_detents_without_tension_are_followed_by_no_simulation() -> None:
    own = grey_box(0.02, (SLACK, TIGHT))
    loop = of_the_data_sheet(own)
    assert loop.unfollowed(sensors(own)) == {SLACK}


def test_play_alone_is_followed() -> None:
    own = grey_box(0.0, (SLACK, TIGHT))
    assert of_the_data_sheet(own).unfollowed(sensors(own)) == set()


def test_an_error_without_a_record_is_that_of_the_others() -> None:
    both, alone = grey_box(0.02, (SLACK, TIGHT)), grey_box(0.02, (TIGHT,))
    whole = of_the_data_sheet(both)
    # 5 %: constants of the sensors are fitted to both records
    assert whole.error({SLACK}) == pytest.approx(of_the_data_sheet(alone).error(), rel=0.05)
    assert np.isnan(whole.error({SLACK, TIGHT}))

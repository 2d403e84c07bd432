"""A load in time: its hour is found in records that the blind suite's own model made."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from dualdrive.diagnose import whitening
from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.diagnose.evidence import Evidence, evidence
from dualdrive.diagnose.loads import sought
from dualdrive.diagnose.refit import Fitter, Refit, Start
from dualdrive.replay import core_of

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.blind.shown import ordered
from tests.blind.shown.ordered import Order

LOAD = "cutting_torque@table"
FREQUENCY = f"{LOAD}.frequency"
HOUR = 0.03  # s: two samples of the filtered balance
END = 0.08  # s: its end is told less sharply; two machines found it 56 ms apart


def balanced(order: Order) -> tuple[Evidence, Refit]:
    """The machine of the sheet, refitted in the torque balance, under the noise that it leaves."""
    c = TorqueBalance(core_of(order.machine()), order.traces(), order.settings())
    left = c.left(c.core, c.start)
    assert left is not None
    base = Fitter(evidence(c, whitening.sized(c.series, left))).nominal(c.levelled(c.core, c.start))
    assert base is not None
    return evidence(c, whitening.sized(c.series, base.left)), base


def test_the_hour_of_a_cut_is_found_and_refitted() -> None:
    order = ordered.hiding("cutting_torque", "bench", 0, 1.0)
    [[hidden], *_] = order.hidden.values()
    truth = hidden.parameters
    seen, base = balanced(order)
    [load, *_] = sought(seen, base)
    begins = {path.rpartition(".")[2]: value for path, value in load.begins.items()}
    end = truth["start"] + truth["duration"]
    assert begins["start"] == pytest.approx(truth["start"], abs=HOUR)
    assert begins["start"] + begins["duration"] == pytest.approx(end, abs=END)
    fitter = Fitter(seen)
    starts = [Start(base.u, {"cutting_torque@table.mean": 0.8 * truth["mean"]})]
    trial = fitter.tried(load, starts)
    assert trial is not None
    told = {path.rpartition(".")[2]: x for path, x in fitter(trial, base.slopes).values().items()}
    assert told["mean"] == pytest.approx(truth["mean"], rel=0.1)
    assert told["start"] == pytest.approx(truth["start"], abs=HOUR)
    assert told["start"] + told["duration"] == pytest.approx(end, abs=END)


def test_the_harmonic_of_a_cut_is_found_and_its_frequency_refitted() -> None:
    """The grid of frequencies is five steps per 1 / duration: over the cut that is a radian off."""
    order = ordered.hiding("cutting_torque", "heavy", 1, 1.0)
    [[hidden], *_] = order.hidden.values()
    truth = hidden.parameters
    seen, base = balanced(order)
    load, *others = sought(seen, base)
    apart = [abs(h.begins[FREQUENCY] - load.begins[FREQUENCY]) for h in others]
    assert all(step * truth["duration"] > 1.0 for step in apart), "other peaks, not the same one"
    grid = abs(load.begins[FREQUENCY] - truth["frequency"])
    assert 0.0 < grid < 0.2 / truth["duration"]
    fitter = Fitter(seen)
    starts = [
        Start(base.u, {f"{LOAD}.mean": truth["mean"], f"{LOAD}.amplitude": 0.5 * truth["mean"]})
    ]
    trial = fitter.tried(load, starts)
    assert trial is not None
    told = fitter(trial, base.slopes).values()
    assert abs(told[FREQUENCY] - truth["frequency"]) < 0.3 * grid
    assert told[f"{LOAD}.amplitude"] == pytest.approx(truth["amplitude"], rel=0.1)


def test_no_load_is_found_where_a_number_drifted() -> None:
    assert sought(*balanced(ordered.drifted("bench", 1, 0.75))) == []

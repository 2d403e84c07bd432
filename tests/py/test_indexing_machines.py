"""Positioning tests that machines make: known sensors, hunting, three drive trains, the tables."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from dualdrive import Machine
from dualdrive.indexing import (
    LOADS,
    PRINTED,
    IndexingError,
    cycle_for,
    evaluate_trace,
    loaded,
    measure,
)
from dualdrive.simulation import simulate
from dualdrive.traces import Trace
from dualdrive_cli.main import main

ARCSEC = np.pi / 648000
#: targets close to each other, for short runs
NEAR = np.radians([0.0, 5.0, 10.0])
COLUMNS = ("traditional", "double motors")
TRAINS = ("heavy-table-single-motor", "heavy-table-double-pinion", "heavy-table-dual-servo")


@pytest.fixture
def dualdrive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Result]:
    monkeypatch.chdir(tmp_path)

    def run(line: str) -> Result:
        return CliRunner().invoke(main, shlex.split(line))

    return run


# --- known answers --------------------------------------------------------------------------------


def test_an_eccentric_grating_is_followed_and_shows_in_full() -> None:
    """The loop brings q + a cos q to the target, so that the table stands off by -a cos q."""
    machine = Machine.load("bench")
    machine.add("encoder_eccentricity@table", amplitude=1e-4)
    test = cycle_for(machine, repeats=1)
    result = measure(machine, test, rtol=1e-8)
    expected = -1e-4 * np.cos(result.targets)
    np.testing.assert_allclose(result.up[:, 0], expected, atol=2e-8)
    figures = result.figures()
    assert figures["E"] == pytest.approx(2e-4, rel=1e-3)
    assert figures["B"] == pytest.approx(0, abs=2e-8)
    assert figures["A"] is None, "one approach"


def test_a_reading_in_steps_leaves_half_a_step_either_way() -> None:
    step = 1e-3
    machine = Machine.load("bench")
    machine.set("controller.position_sample", "1 ms")
    machine.add("quantisation@table", step=step)
    test = cycle_for(machine, step * np.array([500.0, 1000.0]), repeats=1, still=1e-4)
    result = measure(machine, test, rtol=1e-8)
    assert result.down is not None
    assert np.abs([result.up, result.down]).max() <= step / 2 + 1e-4
    assert np.abs([result.up, result.down]).max() > 1e-6, "the step does nothing"


def test_a_recorded_cycle_gives_what_the_simulated_one_gave() -> None:
    machine = Machine.load("heavy-table-550t")
    test = cycle_for(machine, NEAR, repeats=2)
    run = simulate(machine, test.motion, signals=["theta_m", "theta_ref"], output_step=0.01)
    trace = Trace(run.t, {name: run[name] for name in ("theta_m", "theta_ref")})
    measured, simulated = evaluate_trace(trace, window=1.0), measure(machine, test)
    np.testing.assert_allclose(measured.up, simulated.up, atol=0.01 * ARCSEC)
    assert measured.down is not None
    assert simulated.down is not None
    np.testing.assert_allclose(measured.down, simulated.down, atol=0.01 * ARCSEC)


# --- machines that can't be read ------------------------------------------------------------------


def test_a_hunting_table_has_no_position() -> None:
    """Peak to peak 51.7 arcsec at 550 t without tension: an independent study's figure."""
    machine = Machine.load("heavy-table-550t")
    machine.set("controller.T_ten", 0)
    test = cycle_for(machine, NEAR, repeats=1, window=2.0)
    with pytest.raises(IndexingError, match="does not stand still") as told:
        measure(machine, test)
    found = re.search(r"moves by ([\d.]+) arcsec", str(told.value))
    assert found
    assert float(found[1]) == pytest.approx(51.7, abs=1.0)


def test_an_unstable_loop_has_no_position() -> None:
    machine = Machine.load("linear-axis")
    machine.set("controller.K_v", 3000)
    with pytest.raises(IndexingError, match="no position"):
        measure(machine, cycle_for(machine, repeats=1))


def test_a_cycle_that_cannot_be() -> None:
    machine = Machine.load("bench")
    with pytest.raises(IndexingError, match="two or more, increasing"):
        cycle_for(machine, [1.0])
    with pytest.raises(IndexingError, match="no longer than the dwell"):
        cycle_for(machine, window=5.0, dwell=2.0)
    machine.set("controller.kind", "none")
    with pytest.raises(IndexingError, match="no controller"):
        cycle_for(machine)


# --- drive trains ---------------------------------------------------------------------------------


@pytest.mark.parametrize("train", TRAINS)
def test_every_command_works_on_every_drive_train(
    train: str, dualdrive: Callable[[str], Result]
) -> None:
    move = "--motion move:0.01,v=0.03,a=0.01,j=0.05,start=1,end=6"
    run = dualdrive(f"simulate {train} {move} --json -")
    assert run.exit_code == 0, run.output
    assert json.loads(run.stdout)["status"] == "success"
    swept = dualdrive(f"sweep {train} --delta 0,1mrad {move} --jobs 1 -o s.h5 --json s.json")
    assert swept.exit_code == 0, swept.output
    assert "failed" not in swept.output
    line = f"indexing {train} --targets 0:20deg:3 --repeats 2 --dwell 8 --window 1 --json -"
    indexed = dualdrive(line)
    assert indexed.exit_code == 0, indexed.output
    content = json.loads(indexed.stdout)
    assert content["name"] == train
    # the loop closes on the table's own encoder: a fraction of an arc second is left
    assert 0 <= content["figures"]["A"] < 1.0 * ARCSEC
    assert len(content["targets"]) == 3


def test_the_printed_numbers_and_the_loads() -> None:
    """Tables 1 and 2 as printed, arc seconds; inertias as the presets were designed."""
    table_2 = {load: [PRINTED[load, c]["A"] for c in COLUMNS] for load in ("100t", "250t", "550t")}
    assert table_2 == {"100t": [8, 3], "250t": [9, 4], "550t": [10, 4]}
    assert [PRINTED["empty", c] for c in COLUMNS] == [
        {"A": 8, "R": 5, "B": 4},
        {"A": 4, "R": 4, "B": 3},
    ]
    inertias = [loaded("heavy-table-double-pinion", load).get("table.J") for load in LOADS]
    assert inertias == pytest.approx([3.0e6, 4.95e6, 9.6e6, 16.8e6])


# --- the command ----------------------------------------------------------------------------------


def test_the_example_of_the_help_works(dualdrive: Callable[[str], Result]) -> None:
    text = " ".join(dualdrive("indexing --help").output.split())
    example = re.search(r"Example: dualdrive (.+)$", text)
    assert example
    done = dualdrive(example[1])
    assert done.exit_code == 0, done.output
    assert Path("chart.png").read_bytes()[:4] == b"\x89PNG"
    assert re.search(r"B +reversal error +0\.\d+", done.output)
    again = dualdrive(example[1])
    assert (again.exit_code, again.stderr.count("\n")) == (1, 1)
    assert "chart.png: exists already" in again.stderr


def test_a_measured_table_is_evaluated_and_drawn(dualdrive: Callable[[str], Result]) -> None:
    rows = ["target [deg],up_1 [deg],down_1 [deg]"]
    rows += [f"{t},{t + 1e-3},{t - 1e-3}" for t in range(0, 360, 45)]
    Path("table.csv").write_text("\n".join(rows))
    done = dualdrive("indexing table.csv -o chart.pdf --json figures.json")
    assert done.exit_code == 0, done.output
    assert Path("chart.pdf").read_bytes()[:4] == b"%PDF"
    content = json.loads(Path("figures.json").read_text())
    assert content["figures"]["B"] == pytest.approx(np.radians(2e-3))
    assert content["figures"]["R"] is None
    assert "note: one approach per target and side: no spread, so no s, R and A" in done.output


def test_what_indexing_cannot_use_is_refused_in_one_line(
    dualdrive: Callable[[str], Result],
) -> None:
    Path("up.csv").write_text("t,theta_ref,theta_m\n" + _climb())
    Path("log.csv").write_text("a,b\n1,2\n2,3\n")
    for line, words in (
        ("up.csv", "no reversals"),
        ("up.csv --set table.J=3", "--set changes a machine"),
        ("nowhere", "nowhere"),
        ("bench --dwell 2deg", "--dwell"),
        ("bench --targets 1", "two or more"),
        ("log.csv --pulls none.toml", "none.toml: there is no such file"),
    ):
        done = dualdrive(f"indexing {line}")
        assert done.exit_code == 2, done.output
        assert words in done.stderr.splitlines()[-1], done.stderr


def _climb() -> str:
    """Three targets upwards, 2 s each: no reversal."""
    t = np.arange(0, 9, 0.05)
    angle = np.interp(t, [0, 2, 3, 5, 6, 9], [0, 0, 1, 1, 2, 2])
    return "\n".join(f"{a:.2f},{b:.6f},{b:.6f}" for a, b in zip(t, angle, strict=True))

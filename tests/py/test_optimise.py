"""Least tension against the static law, the front against hand cases, what is refused."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from dualdrive.machine import Machine
from dualdrive.motion import move
from dualdrive.optimise import (
    OptimiseError,
    corners,
    evaluate,
    least_tension,
    non_dominated,
    optimise,
)
from dualdrive_cli.main import main

TENSION = "controller.T_ten"


def heavy(load: str = "100t") -> Machine:
    return Machine.load(f"heavy-table-{load}")


# --- the front ------------------------------------------------------------------------------------


def test_non_dominated_by_hand() -> None:
    points: list[list[float]] = [
        [1, 5],
        [2, 4],
        [2, 3],
        [3, 3],
        [4, 1],
        [5, 1],
        [math.inf, 0],
        [0.5, math.nan],
    ]
    assert non_dominated(points).tolist() == [True, False, True, False, True] + [False] * 3
    close: list[list[float]] = [[1, 5], [2, 4.999], [3, 4]]
    assert non_dominated(close, least=1e-3).tolist() == [True, False, True]
    assert non_dominated(np.empty((0, 2))).tolist() == []


def test_no_design_beats_one_on_the_front() -> None:
    front = optimise(heavy(), over={TENSION: np.linspace(0, 50, 6), "controller.K_v": [4.0, 6.0]},
                     cases=corners(heavy(), {}))  # fmt: skip
    assert len(front.designs) == 12
    for place in front.best:
        one = front.designs[place]
        assert one.heat is not None
        assert one.peak_error is not None
        for other in front.designs:
            assert other.heat is not None
            assert other.peak_error is not None
            better = other.peak_error < one.peak_error * (1 - 1e-3) and other.heat <= one.heat
            assert not better
    assert json.dumps(front.figures(), allow_nan=False)
    head, *rows = front.rows()
    hunting = [row[head.index("hunting")].partition(" ") for row in rows]
    assert len({unit for _, _, unit in hunting}) == 1
    assert all(size == "0" or float(size) > 1e-6 for size, _, _ in hunting)
    assert f"the best {len(rows)} of 12 designs" in front.table()


def test_heat_at_rest_is_that_of_the_tension() -> None:
    """Standing still each motor holds T_ten/2: sum of R I², I = T/K_d, by hand."""
    machine = heavy()
    machine.set("table.J", 3e6)
    (design,) = evaluate(
        machine, move(1e-6, 0.03, 0.01, 0.05, start=2.0, settle=3.0), [{TENSION: 60.0}],
        corners(machine, {}),
    )  # fmt: skip
    assert design.heat == pytest.approx(2 * 0.15 * (30.0 / 1.155) ** 2, rel=0.03)
    assert design.torque_rms == pytest.approx(30.0, rel=0.15)  # friction parts the two


# --- least tension --------------------------------------------------------------------------------


@pytest.mark.parametrize("way", [1, -1])
def test_least_tension_is_the_static_law_of_a_gentle_move(way: int) -> None:
    """A flank opens where the ring's need at the motors exceeds T_ten (figure 2, stage 2).

    The pinions' own inertia and friction load both drives alike and drop out.
    """
    machine = heavy("empty")
    motion = move(way * 0.06, 0.03, 0.01, 0.008, start=3.0, settle=4.0)
    found = least_tension(machine, motion, cases=corners(machine, {}))
    t = np.linspace(3.0, motion.waveform.end(), 4001)
    speed = np.asarray(motion.waveform.rate(t))
    need = (
        3.0e6 * np.asarray(motion.waveform.acceleration(t)) + 1e5 * speed + 2000.0 * np.sign(speed)
    )
    assert found.tension == pytest.approx(np.abs(need).max() / (150 * 20), rel=0.03)
    assert found.best is not None
    assert found.best.apart
    assert found.tension is not None
    below = [d for d in found.designs if d.values[TENSION] < found.tension - 0.2]
    assert below
    assert not any(d.apart for d in below)


@pytest.mark.long
def test_a_heavier_corner_needs_more() -> None:
    machine = heavy("empty")
    alone = least_tension(machine, cases=corners(machine, {}))
    robust = least_tension(machine, cases=corners(machine, {"table.J": (3e6, 4.95e6)}))
    heavier = heavy()
    same = least_tension(heavier, robust.motion, cases=corners(heavier, {}))
    assert alone.tension is not None
    assert robust.tension is not None
    assert alone.tension < robust.tension
    assert robust.tension == same.tension  # the heavy corner is the 100 t table
    assert "table.J 165 %" in robust.reason


def test_the_machine_with_the_least_tension_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    line = "optimise heavy-table-100t --no-corners --over controller.T_ten=0,50 -o quiet.toml"
    done = CliRunner().invoke(main, [*line.split(), "--json", "front.json"])
    assert done.exit_code == 0, done.output
    assert "least tension that keeps every flank closed" in done.output
    least = json.loads(Path("front.json").read_text())["least_tension"]["value"]
    quiet = Machine.load("quiet.toml")
    assert quiet.get(TENSION) == least
    assert "least tension" in quiet.history[-1]["change"]
    moving = "--motion move:0.02,v=0.03,a=0.02,j=0.2,start=2"
    line = f"optimise heavy-table-550t --no-corners --over controller.T_ten=50 {moving} -o no.toml"
    none = CliRunner().invoke(main, line.split())
    assert none.exit_code == 1
    assert "no.toml is not written: a flank opens at every tension" in none.stderr
    assert not Path("no.toml").exists()


def test_where_no_tension_is_enough_it_is_said() -> None:
    machine = heavy("550t")
    found = least_tension(
        machine, move(0.02, 0.03, 0.02, 0.2, start=2.0), cases=corners(machine, {})
    )
    assert found.tension is None
    assert found.best is None
    assert "at every tension up to 100 N·m" in found.reason


# --- instability and refusals ---------------------------------------------------------------------


def test_unstable_designs_have_no_figures() -> None:
    machine = heavy("550t")
    front = optimise(machine, over={TENSION: [60.0], "controller.K_v": [5.0, 40.0]},
                     cases=corners(machine, {}))  # fmt: skip
    good, bad = front.designs
    assert good.stable
    assert not bad.stable
    assert bad.growth > 0
    assert (bad.heat, bad.peak_error, bad.margin) == (None, None, None)
    assert front.best == (0,)
    assert "1 designs are unstable" in front.table()


def test_an_unstable_loop_is_refused() -> None:
    machine = heavy("550t")
    machine.set("controller.K_v", 60.0)
    for ask in (least_tension, lambda m: optimise(m, over={TENSION: [60.0]})):
        with pytest.raises(OptimiseError, match=r"the loop is unstable at .*lower controller\.K_v"):
            ask(machine)


@pytest.mark.parametrize("name", ["heavy-table-single-motor", "linear-axis"])
def test_one_motor_has_no_tension(name: str) -> None:
    with pytest.raises(OptimiseError, match="tension acts between two motors"):
        least_tension(Machine.load(name))


def test_no_play_and_no_constant_tension() -> None:
    machine = heavy()
    machine.set("meshes.gap", 0.0)
    with pytest.raises(OptimiseError, match="no play to close"):
        least_tension(machine)
    machine = heavy()
    machine.set("controller.tension", "off")
    with pytest.raises(OptimiseError, match="must be constant"):
        optimise(machine)


def test_corners() -> None:
    machine = heavy()
    found = corners(machine, {"table.J": ("50%", 6e6), "meshes.gap": ("20arcsec", "1mrad")})
    assert found[0].name == "as it is"
    values = [(c.values["table.J"], c.values["meshes.gap"]) for c in found]
    small, large = 20 * math.pi / 648000, 1e-3
    assert values[1:] == [
        (pytest.approx(4.95e6 / 2), pytest.approx(small)),
        (pytest.approx(4.95e6 / 2), large),
        (6e6, pytest.approx(small)),
        (6e6, large),
    ]
    with pytest.raises(OptimiseError, match="low below high"):
        corners(machine, {"table.J": (6e6, 5e6)})
    assert len(corners(machine, {})) == 1

"""ISO 230-2: its figures against a hand case and real reports, its rules, its files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dualdrive.indexing import (
    IndexingError,
    Iso230,
    evaluate,
    evaluate_trace,
    least_targets,
    lost_motion,
    read_lost_motion,
    read_positions,
    read_report,
)
from dualdrive.traces import Trace
from measured import EXAMPLES, measured_file

ARCSEC = np.pi / 648000
#: deviations worked out by hand; from them B 3, R 7, E 5, M 2.5, A 9
UP, DOWN = np.array([[1.0, 2, 3], [4, 5, 6]]), np.array([[-1.0, 0, 1], [1, 2, 3]])
TARGETS = np.array([10.0, 20.0])
BY_HAND = {"B": 3, "B_mean": 2.5, "R": 7, "E": 5, "M": 2.5, "A": 9}
ONE_SIDED = {"E_up": 3, "A_up": 7, "R_up": 4, "E_down": 2, "A_down": 6, "R_down": 4}


def hand_case() -> Iso230:
    return evaluate(TARGETS, TARGETS[:, None] + UP, TARGETS[:, None] + DOWN, unit="")


# --- the definition -------------------------------------------------------------------------------


def test_the_hand_case() -> None:
    assert hand_case().figures() == pytest.approx(BY_HAND | ONE_SIDED)
    with pytest.raises(AttributeError, match="its figures are A, A_up"):
        hand_case().C  # noqa: B018
    first, second = hand_case().rows
    assert (first.mean_up, first.mean_down, first.mean, first.B) == pytest.approx((2, 0, 1, 2))
    assert (second.s_up, second.s_down) == pytest.approx((1, 1))
    assert (second.R_up, second.R_down, second.R) == pytest.approx((4, 4, 7))


def test_a_wide_spread_on_one_side_is_the_repeatability() -> None:
    """R_i = 4 s down, where that exceeds 2 s up + 2 s down + |B|."""
    result = evaluate([0.0], [[0.0, 0.0, 0.0]], [[-3.0, 0.0, 3.0]], unit="")
    assert result.figures()["R"] == pytest.approx(12)


def test_an_eccentric_scale_has_no_reversal_error() -> None:
    places = np.arange(8) * np.pi / 4
    seen = (places + 1e-5 * np.cos(places))[:, None] + np.zeros(5)
    result = evaluate(places, seen, seen)
    figures = result.figures()
    assert [figures[name] for name in "BR"] == pytest.approx([0, 0], abs=1e-15)
    assert [figures[name] for name in "MEA"] == pytest.approx([2e-5] * 3)
    assert result.notes == ()


# --- the rules ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("unit", "travel", "count"),
    [
        ("rad", np.pi / 2, 3),
        ("rad", np.pi / 2 + 0.01, 5),
        ("rad", np.pi, 5),
        ("rad", 2 * np.pi, 8),
        ("m", 0.3, 5),
        ("m", 2.0, 10),
    ],
)
def test_how_many_targets(unit: str, travel: float, count: int) -> None:
    assert least_targets(unit, travel) == count


def test_too_few_targets_and_approaches_are_noted() -> None:
    places = np.radians([0.0, 90.0, 180.0])
    result = evaluate(places, np.tile(places[:, None], 3), np.tile(places[:, None], 3))
    assert "3 targets; the standard asks for 5" in result.notes[0]
    assert "3 approaches per target and side; the standard asks for 5" in result.notes[1]
    assert result.A == 0


def test_one_approach_gives_no_spread() -> None:
    result = evaluate(
        TARGETS, TARGETS[:, None] + UP[:, :1], TARGETS[:, None] + DOWN[:, :1], unit=""
    )
    assert result.figures()["A"] is result.figures()["R"] is result.rows[0].s_up is None
    assert result.figures()["B"] == pytest.approx(3)
    assert "one approach" in result.notes[0]


def test_beyond_a_turn_no_spread_is_evaluated() -> None:
    places = np.arange(9) * np.pi / 2
    seen = places[:, None] + 1e-5 * np.arange(5)
    result = evaluate(places, seen, seen)
    assert (result.A, result.R, result.A_up) == (None, None, None)
    assert result.figures()["E"] == pytest.approx(0, abs=1e-15)
    assert "beyond 360 degrees" in result.notes[0]
    within = evaluate(places[:4], seen[:4], seen[:4], travel=7.0)
    assert within.A is None


def test_one_side_gives_one_sided_figures() -> None:
    result = evaluate(TARGETS, TARGETS[:, None] + UP, unit="")
    given = {name: value for name, value in result.figures().items() if value is not None}
    assert given == pytest.approx({"E_up": 3, "A_up": 7, "R_up": 4})
    assert "from below only" in result.notes[-1]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (([0, 1], [[0, 0], [1]], [[0, 0], [1, 1]]), "target 1: 1 approaches upwards, others 2"),
        (([0, 1], [[0], [1]], [[0, 0], [1, 1]]), "1 approaches upwards, 2 downwards"),
        (([0, 0], [[0], [0]], [[0], [0]]), "finite and increasing"),
        (([0, 1], [[0]], [[0]]), "2 targets, 1 rows"),
        (([0], [[float("nan")]], [[0]]), "target 0, approach 1 upwards: nan"),
    ],
)
def test_what_cannot_be_evaluated(arguments: Any, told: str) -> None:
    with pytest.raises(IndexingError, match=told):
        evaluate(*arguments)


# --- real reports ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "scale", "agreed", "departed"),
    [
        (
            "ESS__mcu1025_fat_sat__report.md",
            1e-3,
            {"B": 0.04346, "M": 0.04809, "R": 0.20476, "A": 0.20476}
            | {"E_up": 0.07477, "E_down": 0.04612, "A_up": 0.08927, "R_up": 0.0183},
            {"E": (0.06514, 0.07477, "largest mean upwards less the smallest downwards")},
        ),
        (
            "test__fat_sat__report.md",
            1e-3,
            {"B": 1.22e-5, "M": 2.77e-5, "A": 8.881e-5, "E_up": 2.46e-5, "E_down": 3.3e-5},
            {"E": (2.46e-5, 3.68e-5, "E_up"), "R": (6.29e-5, 6.882e-5, "R_down")},
        ),
    ],
)
def test_real_reports(
    name: str, scale: float, agreed: dict[str, float], departed: dict[str, Any]
) -> None:
    """Printed figures; E and R as SOURCE.md and the reports' own rows have them."""
    report = read_report(measured_file(f"iso230_2_reports_ecmc/{name}_ISO230.dat"))
    figures = report.result.figures()
    digit = 1e-5 if "ESS" in name else 1e-8
    for letter, printed in agreed.items():
        assert figures[letter] == pytest.approx(printed * scale, abs=0.6 * digit * scale), letter
    assert {d.figure for d in report.departures} == set(departed)
    for departure in report.departures:
        printed, defined, also = departed[departure.figure]
        assert departure.printed == pytest.approx(printed * scale)
        assert departure.defined == pytest.approx(defined * scale, abs=0.6 * digit * scale)
        assert also in departure.also
    assert report.swapped, "report and data file call opposite directions forward"
    assert "the sign of B_i is open" in report.words()[-1]


def test_a_report_that_keeps_to_the_definition(tmp_path: Path) -> None:
    lines = ["UNIT=mm", "DEC=4"]
    for i, (target, up, down) in enumerate(zip(TARGETS, UP, DOWN, strict=True), start=1):
        lines.append(f"TGT_DATA[{i}]={target}")
        for j in range(3):
            lines.append(f"REF_DATA_FWD[{i},{j + 1}]={target + up[j]}")
            lines.append(f"REF_DATA_BWD[{i},{j + 1}]={target + down[j]}")
    (tmp_path / "report.md_ISO230.dat").write_text("\n".join(lines))
    assert read_report(tmp_path / "report.md_ISO230.dat").printed == {}
    (tmp_path / "report.md").write_text("1|10.0|11.0|\nA = 9.0 [mm]\nR = 7.0 [mm]\n**E = 5 [mm]**")
    report = read_report(tmp_path / "report.md_ISO230.dat")
    assert report.departures == []
    assert report.swapped is False
    assert set(report.printed) == {"A", "R", "E"}
    (tmp_path / "report.md_ISO230.dat").write_text("\n".join(lines[:4]))
    with pytest.raises(IndexingError, match=r"REF_DATA_BWD\[1"):
        read_report(tmp_path / "report.md_ISO230.dat")


# --- tables of positions --------------------------------------------------------------------------


def test_a_long_table(tmp_path: Path) -> None:
    rows = [
        f"{10 * j},{way},{target},{target + deviation[i, j]}"
        for i, target in enumerate(TARGETS)
        for j in range(3)
        for way, deviation in (("down", DOWN), ("up", UP))
    ]
    file = tmp_path / "long.csv"
    file.write_text("cycle,direction,target [mm],position [mm]\n" + "\n".join(rows[::-1]))
    result = read_positions(file)
    assert result.unit == "m"
    in_mm = {n: v / 1e-3 for n, v in result.figures().items() if v is not None}
    assert in_mm == pytest.approx(BY_HAND | ONE_SIDED)
    np.testing.assert_allclose(result.up, UP * 1e-3, atol=1e-12)  # sorted by cycle


def test_a_wide_table_of_deviations(tmp_path: Path) -> None:
    head = ["target [deg]"]
    head += [f"deviation {way} {j} [arcsec]" for way in ("fwd", "bwd") for j in (1, 2, 3)]
    rows = [[t, *u, *d] for t, u, d in zip(TARGETS, UP, DOWN, strict=True)]
    file = tmp_path / "wide.csv"
    file.write_text("\n".join(",".join(map(str, row)) for row in [head, *rows]))
    result = read_positions(file)
    in_seconds = {n: v / ARCSEC for n, v in result.figures().items() if v is not None}
    assert in_seconds == pytest.approx(BY_HAND | ONE_SIDED, rel=1e-6)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("target [mm],position [mm]\n1,2\n2,3\n", "it takes columns target, direction, position"),
        ("target,up_1,down_1\n1,1,1\n2,2,2\n", r"no unit; write it in the header, target \[deg\]"),
        ("target [A],up_1 [A]\n1,1\n2,2\n", "must be an angle or a length"),
        ("target [mm],up_1 [deg]\n1,1\n2,2\n", "must be a length"),
        ("target [mm],up_1 [mm],up_2 [mm]\n1,1,1\n2,2,\n", "row 3: up_2: no number"),
        (
            "target [mm],direction,position [mm]\n1,up,1\n2,up,2\n1,down,1\n",
            "target 0.002 m was approached from below only",
        ),
        (
            "target [mm],direction,position [mm]\n1,up,1\n1,up,1\n1,down,1\n1,down,1\n2,up,2\n"
            "2,down,2\n",
            "target 0.002: 1 approaches upwards, others 2",
        ),
        ("target [mm],direction,position [mm]\n1,north,1\n2,up,2\n", "direction 'north'"),
    ],
)
def test_what_a_table_lacks(tmp_path: Path, text: str, told: str) -> None:
    file = tmp_path / "table.csv"
    file.write_text(text)
    with pytest.raises(IndexingError, match=told):
        read_positions(file)


# --- traces ---------------------------------------------------------------------------------------


def driven(visits: list[tuple[float, float]], hunting: float = 0.0) -> Trace:
    """A trace that goes to (target, where it comes to stand) in turn, with dwells of 2 s."""
    dt, ramp, rest = 0.01, 100, 200
    command, seen = [np.zeros(rest)], [np.zeros(rest)]
    at, stood = 0.0, 0.0
    for target, stands in visits:
        way = (1 - np.cos(np.linspace(0, np.pi, ramp))) / 2  # it sets out gently
        command += [at + (target - at) * way, np.full(rest, target)]
        seen += [stood + (stands - stood) * way, np.full(rest, stands)]
        at, stood = target, stands
    t = np.arange(sum(map(len, seen)), dtype=float) * dt
    position = np.concatenate(seen) + hunting * np.sin(10 * t)
    return Trace(t, {"theta_ref": np.concatenate(command), "theta_m": position}, name="trace")


def two_way() -> list[tuple[float, float]]:
    """Three cycles of the hand case in arc seconds, with overruns."""
    visits = []
    for j in range(3):
        for target, wobble in ((-0.1, 0.0), (1.0, UP[0, j]), (2.0, UP[1, j]), (2.1, 0.0)):
            visits.append((target, target + wobble * ARCSEC))
        for target, wobble in ((2.0, DOWN[1, j]), (1.0, DOWN[0, j])):
            visits.append((target, target + wobble * ARCSEC))
    return visits


@pytest.mark.parametrize("commanded", [True, False])
def test_positions_are_read_in_the_dwells_of_a_trace(commanded: bool) -> None:
    trace = driven(two_way())
    if not commanded:
        trace = Trace(trace.t, {"theta_m": trace["theta_m"]})
    result = evaluate_trace(trace, None if commanded else [-0.1, 0, 1, 2, 2.1])
    np.testing.assert_allclose(result.targets, [1, 2])
    in_seconds = {n: v / ARCSEC for n, v in result.figures().items() if v is not None}
    assert in_seconds == pytest.approx(BY_HAND | ONE_SIDED, rel=1e-6)
    assert "2 turning points left out" in result.notes


def test_a_trace_that_is_no_test() -> None:
    upwards = [(1.0, 1.0), (2.0, 2.0), (3.0, 3.0)]
    with pytest.raises(IndexingError, match=r"trace: no reversals: \d dwells"):
        evaluate_trace(driven(upwards))
    with pytest.raises(IndexingError, match="it hunts, or has not settled"):
        evaluate_trace(driven(two_way(), hunting=20 * ARCSEC))
    with pytest.raises(IndexingError, match=r"target 1: 3 approaches upwards|counts must agree"):
        evaluate_trace(driven([*two_way(), (0.5, 0.5), (1.0, 1.0)]))
    with pytest.raises(IndexingError, match="no rest of 5 s"):
        evaluate_trace(driven(two_way()), dwell=5.0)
    two = np.array([0.0, 1.0])
    alone = Trace(two, {"theta_m": two}, name="alone")
    with pytest.raises(IndexingError, match="neither theta_ref nor targets"):
        evaluate_trace(alone)


# --- lost motion ----------------------------------------------------------------------------------


def test_lost_motion_as_published() -> None:
    """B. Kotov's counts: a single servo, and two of them coupled back to back."""
    folder = "dual_sts3215_backlash"
    (single,) = read_lost_motion(
        measured_file(f"{folder}/motor_telemetry_single.csv"),
        EXAMPLES / "sts3215_single.pulls.toml",
    )
    assert (single.loaded, single.released) == pytest.approx((14.78, 7.03), abs=0.005)
    assert single.means[0] == pytest.approx((2040.00, 2054.78), abs=0.005)
    assert single.means[1] == pytest.approx((2043.97, 2051.00), abs=0.005)
    coupled = read_lost_motion(
        measured_file(f"{folder}/motor_telemetry_nocomp2.csv"),
        EXAMPLES / "sts3215_coupled.pulls.toml",
    )
    assert [c.loaded for c in coupled] == pytest.approx([7.00, 7.67], abs=0.005)
    assert [c.released for c in coupled] == pytest.approx([5.33, 5.25], abs=0.005)
    assert coupled[0].pulls == (6, 6)


def test_lost_motion_of_a_known_shaft(tmp_path: Path) -> None:
    position = np.array([0.0, 5, 5, 2, 2, -3, -3, -1, -1])
    one = np.array([0, 1, 1, 0, 0, 0, 0, 0, 0], bool)
    other = np.array([0, 0, 0, 0, 0, 1, 1, 0, 0], bool)
    found = lost_motion(position, [one, other], ~(one | other))
    assert (found.loaded, found.released, found.pulls) == (8, 3, (1, 1))
    with pytest.raises(IndexingError, match="never pulled the other way"):
        lost_motion(position, [one, one & False], ~one)
    (tmp_path / "bad.toml").write_text("shafts = []\n")
    with pytest.raises(IndexingError, match="it takes shafts, hold"):
        read_lost_motion(tmp_path / "log.csv", tmp_path / "bad.toml")

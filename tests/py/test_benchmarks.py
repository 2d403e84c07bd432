"""What the benchmark compares is what it says; how long anything takes is never tested."""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from dualdrive import _core

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

import cascade
import case
import costs
import dop853
import effects
import ensembles
import equations
import laws
import linear
import measure
import ours
import page
import peers
import plain
import report
import run
from measure import Engine, Point, Program, at_equal_error

NUMBA = "numba is not installed; pip install -e '.[bench]'"


def point(error: float, ms: float, name: str = "engine", rtol: float = 1e-6) -> Point:
    return Point(name, rtol, ms, error, 0)


# ----------------------------------------------------------------------- how figures are made


def test_time_at_equal_error_lies_on_the_line_between_two_runs() -> None:
    points = [point(1e-2, 10.0), point(1e-6, 1000.0)]
    assert at_equal_error(points, 1e-4) == pytest.approx(100.0)
    assert at_equal_error(points, 1e-6) == pytest.approx(1000.0)
    assert at_equal_error(points, 1e-1) == 10.0  # its coarsest run is better than asked for
    assert at_equal_error(points, 1e-7) is None
    assert at_equal_error([point(np.inf, np.nan)], 1e-3) is None


def test_time_at_equal_error_is_no_single_lucky_run() -> None:
    points = [point(10.0**-k, 10.0 ** (k / 2)) for k in (3, 4, 5, 6, 7)]
    assert at_equal_error(points, 1e-5) == pytest.approx(10**2.5)
    lucky = [*points[:2], point(1e-6, 10**2.5), *points[3:]]  # at 1e-5 by rights
    assert at_equal_error(lucky, 1e-6) == pytest.approx(10**3, rel=0.4)


def test_engines_take_turns_and_their_best_run_counts() -> None:
    order: list[str] = []

    def engine(name: str) -> Engine:
        def run(rtol: float) -> tuple[case.Array, int]:
            order.append(name)
            return case.finest(), 7

        return Engine(name, (1e-6,), run)

    found = measure.measure([engine("a"), engine("b")], rounds=2, share=0.0)
    assert order == ["a", "b", "a", "b"]
    assert [(p.engine, p.error, p.events) for p in found] == [("a", 0.0, 7), ("b", 0.0, 7)]


def test_an_engine_that_gives_up_is_told_as_one() -> None:
    def fails(rtol: float) -> tuple[case.Array, int]:
        raise RuntimeError("too stiff")

    (found,) = measure.measure([Engine("a", (1e-6,), fails)], rounds=2)
    assert found.note == "too stiff"
    assert at_equal_error([found], 1.0) is None
    assert "failed: too stiff" in report.points_text([found])


def test_targets_are_told_as_met_or_not() -> None:
    def verdict(value: float | None, *, at_least: bool) -> str:
        return report.Wanted("x", value, 25.0, at_least=at_least).cells()[3]

    assert [verdict(v, at_least=True) for v in (26.0, 24.0, None)] == ["met", "not met", ""]
    assert [verdict(v, at_least=False) for v in (26.0, 24.0, None)] == ["not met", "met", ""]


def test_ratios_are_those_of_equal_error() -> None:
    fast, slow = f"{ours.NATIVE}, avx2", "SciPy LSODA"
    points = [point(1e-12, 2.0, fast), point(1e-5, 900.0, slow), point(1e-7, 1600.0, slow)]
    assert report.ratio(points, slow, fast, 1e-6) == pytest.approx(600.0)
    (told,) = (w for w in report.wanted(points) if slow in w.what and "1e-06" in w.what)
    assert told.cells()[1:] == ("600 times", "≥ 1000", "not met")


def test_slope_of_a_straight_line_is_one() -> None:
    x = [0.01, 1.0, 3.0, 10.0]  # what is small does not count
    assert linear.slope(x, [99.0, 2.0, 6.0, 20.0]) == pytest.approx(1.0)


# -------------------------------------------------------------------- what is compared is equal


def test_the_reference_agrees_with_the_independent_solution() -> None:
    assert case.error_of(case.finest()) == 0.0
    assert case.agreement() < 1e-10
    assert case.spread() < 1e-8


@pytest.mark.parametrize(
    ("which", "rtol", "error"),
    [
        ("exact", np.nan, 1e-11),
        ("explicit", 1e-8, 1e-4),
        ("adams", 1e-8, 1e-4),
        ("bdf", 1e-8, 1e-3),
    ],
)
def test_the_product_reaches_the_error_that_the_table_will_print(
    which: str, rtol: float, error: float
) -> None:
    X, contacts, _ = ours.engine(which, which, rtol).sample(rtol, 0.0)
    assert contacts == len(case.truth().contacts) == 543
    assert case.error_of(X) < error


@pytest.mark.parametrize("which", costs.RUNS.values())
def test_exact_engine_with_more_to_do_runs_the_same_case(which: str) -> None:
    found = ours.run(which, np.nan)
    assert len(found.contacts) == 543
    assert case.error_of(found.X) < 1e-11


def test_exact_engine_in_a_process_of_its_own() -> None:
    X, contacts, _ = ours.exact("x", "exact", "baseline").sample(np.nan, 0.0)
    assert contacts == 543
    assert case.error_of(X) < 1e-11


def test_peers_integrate_the_same_machine() -> None:
    pytest.importorskip("numba", reason=NUMBA)
    lsoda = peers.scipy_engines()[0]
    X, contacts, _ = lsoda.sample(1e-7, 0.0)
    assert case.error_of(X) < 1e-3
    assert contacts == pytest.approx(543, abs=10)


def test_compiled_dop853_integrates_the_same_machine() -> None:
    pytest.importorskip("numba", reason=NUMBA)
    X, contacts, _ = dop853.engines()[0].sample(1e-12, 0.0)
    assert contacts == 543
    assert case.error_of(X) < 1e-8


def test_casadi_integrates_the_same_machine() -> None:
    pytest.importorskip("casadi", reason="casadi is not installed; pip install -e '.[bench]'")
    X, _, _ = peers.casadi_engines()[0].sample(1e-10, 0.0)
    assert case.error_of(X) < 1e-4


def test_the_plain_program_integrates_the_same_machine() -> None:
    try:
        adams: Program = plain.engines(plain.OPTIMISED, adams=(1e-10,))[0]
    except measure.Absent as absent:
        pytest.skip(str(absent))
    X, contacts, _ = adams.sample(1e-10, 0.0)
    assert contacts == 543
    assert case.error_of(X) < 1e-5


def test_peers_jacobian_is_that_of_their_rates() -> None:
    pytest.importorskip("numba", reason=NUMBA)
    f, jacobian, frozen = equations.compiled()
    y = np.linspace(-0.01, 0.01, equations.STATES)
    y[2:4] = [2e-3, -1e-4]  # a flank closed, one in the gap
    found, asked = np.empty((2, equations.STATES, equations.STATES))
    jacobian(0.3, y, found)

    def rates(at: case.Array) -> case.Array:
        out, same = np.empty((2, equations.STATES))
        f(0.3, at, out)
        frozen(0.3, at, np.array([1, 0]), same)
        np.testing.assert_array_equal(out, same)
        return np.asarray(out)

    for k in range(equations.STATES):
        step = np.zeros(equations.STATES)
        step[k] = 1e-5
        asked[:, k] = (rates(y + step) - rates(y - step)) / 2e-5
    np.testing.assert_allclose(found, asked, rtol=1e-6, atol=1e-9 * np.abs(asked).max())


@pytest.mark.parametrize(
    "absent",
    [
        ("pitch_error", "lugre", "hertzian_stiffness"),
        ("eccentricity", "stribeck", "angle_dependent_friction", "time_varying_mesh_stiffness"),
    ],
)
def test_peers_have_the_same_laws(absent: tuple[str, ...]) -> None:
    """All that do not meet: a ring has one error here, a table one friction, a flank one K."""
    pytest.importorskip("numba", reason=NUMBA)
    name, end = "heavy-table-550t", 3.0
    there = [law for law in cascade.LAWS if law not in absent]
    made, sine = laws.machine(name, *there), laws.MACHINES[name]
    raw = _core.simulate(
        made, {"theta_ref": _core.sine(sine.amplitude, sine.frequency)}, end=end, rtol=1e-11,
        engine="explicit", signals=effects.STATES, energy=False,
    )  # fmt: skip
    true = np.asarray(raw.values)
    switches = len({event[0] for event in raw.events})  # what breaks away at a contact is one
    problem = cascade.problem(made, sine.amplitude, sine.frequency)
    ways = {1e-7: dop853.integrator(problem)}
    with suppress(measure.Absent):  # no compiler, or no SUNDIALS
        ways[1e-5] = plain.integrator(problem, "bdf")
    times, peak = np.asarray(raw.t), np.abs(true).max(axis=0)
    atol = 1e-11 * np.append(peak, np.full(problem.states - len(peak), 1e-4))
    for error, way in ways.items():
        y, found, evaluations = way(1e-11, atol, times)
        assert laws.error(cascade.shown(y), true) < error
        assert found == switches
        assert evaluations > 1000


def test_cost_over_time_and_switches_is_that_of_the_case() -> None:
    one = linear.cost(1.0, _core.sine(case.AMPLITUDE, case.FREQUENCY), 1e-3)
    assert one.switches == sum(contact[0] <= 1.0 for contact in case.truth().contacts)
    some, more = (linear.cost(2.0, linear.late(share, 2.0), 1e-2) for share in (0.0, 1.0))
    assert some.switches < more.switches


# ------------------------------------------------------------------------------- how it is told


@pytest.mark.long
def test_quick_leaves_out_what_is_slow() -> None:
    engines, _ = run.available(quick=True)
    assert not any("BDF" in one.name or "Radau" in one.name for one in engines)
    assert all(one.rtols for one in engines)


def test_table_is_markdown_with_every_row() -> None:
    text = report.table(("engine", "ms"), [("a", "1.0"), ("longer name", "22.0")])
    head, rule, *rows = text.splitlines()
    assert head == "| engine      |   ms |"
    assert rule == "|-------------|-----:|"
    assert rows == ["| a           |  1.0 |", "| longer name | 22.0 |"]


def test_figures_go_between_their_own_markers() -> None:
    text = "a\n<!-- x: begin -->\nold\n<!-- x: end -->\nb\n<!-- y: begin -->\n<!-- y: end -->\n"
    written = page.between(text, "x", "new")
    assert written == text.replace("\nold\n", "\n\nnew\n\n")
    assert page.between(written, "x", "new") == written
    with pytest.raises(ValueError, match="z: begin"):
        page.between(text, "z", "new")
    of_run = ("ensembles", "points", "equal-error", "wanted", "costs", "linear", "presets")
    of_laws = (*(f"laws {name}" for name in laws.MACHINES), "law peers", "work-precision")
    for name in (*of_run, *of_laws):
        assert page.between(page.PAGE.read_text(), name, "").count(f"{name}: begin") == 1


def test_a_part_of_a_table_does_not_go_into_the_page(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    parser = page.command_line("Some.")
    parser.add_argument("--only", nargs="+", default=["a", "b"])
    monkeypatch.setattr("sys.argv", ["some.py", "--write", "--only", "a", "b"])
    assert page.told(parser, "only").write
    monkeypatch.setattr("sys.argv", ["some.py", "--write", "--only", "a"])
    with pytest.raises(SystemExit):
        page.told(parser, "only")
    assert "leave out --only" in capsys.readouterr().err


def test_the_ensemble_has_the_case_in_its_middle() -> None:
    runs = ensembles.begin(3, 1, keep=["theta_m", "I_2"], energy=False)
    assert runs.parameters["meshes.gap"][1] == pytest.approx(case.machine().drives[0].gap)
    middle = next(one for one in runs if one.run == 1)
    assert middle.figures["contact_events"] == len(case.truth().contacts)
    assert middle.signals is not None
    for name in ("theta_m", "I_2"):
        true = case.truth()[name]
        np.testing.assert_allclose(middle.signals[name], true, atol=1e-6 * np.abs(true).max())


def test_scaling_compares_the_same_work() -> None:
    def row(what: str, jobs: int, wall: float, processor: float) -> ensembles.Row:
        return ensembles.Row(what, 10, jobs, wall, processor)

    found = [row("a", 1, 9.0, 9.0), row("b", 1, 4.0, 3.9), row("b", 2, 2.5, 4.0)]
    assert ensembles.scaling(found) == pytest.approx((1.6, 1.95))
    assert ensembles.scaling(found[:2]) is None

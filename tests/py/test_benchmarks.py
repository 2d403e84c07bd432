"""What the benchmark compares is what it says; how long anything takes is never tested."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

import case
import ensembles
import ours
import page
import peers
import report


def point(error: float, ms: float) -> case.Point:
    return case.Point("engine", 1e-6, ms, error, 0)


def test_time_at_equal_error_lies_on_the_line_between_two_runs() -> None:
    points = [point(1e-2, 10.0), point(1e-6, 1000.0)]
    assert case.at_equal_error(points, 1e-4) == pytest.approx(100.0)
    assert case.at_equal_error(points, 1e-6) == pytest.approx(1000.0)
    assert case.at_equal_error(points, 1e-1) == 10.0  # its coarsest run is better than asked for
    assert case.at_equal_error(points, 1e-7) is None
    assert case.at_equal_error([point(np.inf, np.nan)], 1e-3) is None


def test_the_product_reaches_the_error_that_the_table_will_print() -> None:
    adams = ours.engines()[0]
    X, contacts = adams.run(1e-8)
    assert contacts == len(case.truth().contacts) == 543
    assert case.error_of(X) < 1e-4
    assert case.error_of(case.truth().X) == 0.0
    assert case.spread() < 1e-8


def test_peers_integrate_the_same_machine() -> None:
    pytest.importorskip("numba", reason="numba is not installed; pip install -e '.[bench]'")
    lsoda = peers.scipy_engines(slow=False)[0]
    X, contacts = lsoda.run(1e-7)
    assert case.error_of(X) < 1e-3
    assert contacts == pytest.approx(543, abs=10)


def test_peers_jacobian_is_that_of_their_rates() -> None:
    pytest.importorskip("numba", reason="numba is not installed; pip install -e '.[bench]'")
    _, jacobian, f = peers.compiled()
    y = np.linspace(-0.01, 0.01, peers.STATES)
    y[2:4] = [2e-3, -1e-4]  # a flank closed, one in the gap
    found, asked = np.empty((2, peers.STATES, peers.STATES))
    jacobian(0.3, y, found)
    for k in range(peers.STATES):
        step = np.zeros(peers.STATES)
        step[k] = 1e-5
        asked[:, k] = (f(0.3, y + step) - f(0.3, y - step)) / 2e-5
    np.testing.assert_allclose(found, asked, rtol=1e-6, atol=1e-9 * np.abs(asked).max())


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
    for name in ("ensembles",):
        assert page.between(page.PAGE.read_text(), name, "").count(f"{name}: begin") == 1


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

"""What an engineer reads: numbers with units, reasons that hold, nothing that says nothing."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dualdrive.compare.orders import Order
from dualdrive.compare.time_skew import Skew
from dualdrive.diagnose.decision import MissingTorque
from dualdrive.diagnose.judge import Reason
from dualdrive.diagnose.paragraph import paragraph
from dualdrive.diagnose.result import Candidate, Diagnosis, Interval, Shape, Verdict

ROOT = Path(__file__).resolve().parents[2]
ERROR = {"nominal": 0.3, "refitted": 0.2, "noise_floor": 0.01}


def candidate(label: str = "cogging@motors", **numbers: Any) -> Candidate:
    effect, place = label.split("@")
    rest = {"explained": 0.95, "note": "", **numbers}
    parameters = rest.pop("parameters", {})
    return Candidate(((effect, place),), 0.9, parameters, 0.02, 0.02, 900.0, **rest)


def shape(explained: float) -> Shape:
    none = np.zeros(2)
    return Shape("table", "speed", "rad/s", "N*m", none, none, none, none, explained)


def said(verdict: Verdict, *candidates: Candidate, why: Reason = "", **more: Any) -> str:
    told = {"mode": "balance", "groups": (), "warnings": (), "command": "dualdrive add", **more}
    return paragraph(
        Diagnosis(
            machine="axis",
            records=("r",),
            verdict=verdict,
            candidates=candidates,
            error=ERROR,
            seconds=0.0,
            **told,
        ),
        why,
    )


def test_numbers_have_units_what_was_counted_no_interval_and_what_is_held_at_nothing_no_word() -> (
    None
):
    text = said(
        "effect",
        candidate(
            parameters={
                "transport_delay@controller.delta_c": Interval(3e-3, 2e-3, 4e-3, "s"),
                "transport_delay@controller.delta_t": Interval(0.0, 0.0, 0.0, "s"),
                "cogging@motors.order": Interval(12.0, 12.0, 12.0, ""),
            }
        ),
    )
    assert "delta_c 3 ms [2 .. 4 ms], order 12." in text
    assert "delta_t" not in text


@pytest.mark.parametrize(
    ("why", "words"),
    [
        ("explains", "too little to name it"),
        ("bound", "too large to be plausible"),
        ("bent", "only bends the curve of the first"),
        ("clipped", "a channel stands at its limit"),
        ("gains", "probability 0.90, too low to name it"),
    ],
)
def test_why_the_best_of_them_gets_no_name(why: Reason, words: str) -> None:
    assert words in said("unknown", candidate(), why=why)


def test_a_coordinate_that_tells_nothing_is_not_recommended() -> None:
    text = said("unknown", shapes=[shape(0.6)])
    assert "60 % of the missing torque of the table depends only on the speed." in text
    text = said("unknown", shapes=[shape(0.0)])
    assert "depends only" not in text
    assert "depends on none of the coordinates that were tried" in text


def test_warnings_are_told_apart() -> None:
    text = said("adequate", warnings=["fast: it jitters.", "slow: it jitters, too"])
    assert text.endswith("Mind: fast: it jitters; slow: it jitters, too.")
    assert "4 warnings" in said("adequate", warnings=["a"] * 4)


def test_sentences_are_those_of_an_engineer() -> None:
    """The issue's table: what was printed, and what an engineer would say."""
    best = candidate("coulomb@table", explained=0.9)
    text = said("unknown", best, why="gains")
    assert (
        "Best candidate: coulomb@table; removes 90 % of the unexplained error; probability 0.90, "
        "too low to name it."
    ) in text
    note = "needs fraction = 0.5, its upper limit: implausible"
    text = said("unknown", candidate("load_dependent_mesh_loss@table", note=note), why="bound")
    assert f"removes 95 % of the unexplained error; {note}." in text
    none = np.zeros(2)
    direction = Shape("table", "direction", "", "N*m", none, none, none, none, 0.47)
    text = said("unknown", best, shapes=[direction], why="gains")
    assert (
        "47 % of the missing torque of the table depends only on the sign of the speed, as dry "
        "friction does."
    ) in text
    text = said("unknown", candidate("viscous@table", explained=0.0), why="gains")
    assert "No candidate helps. Check sign and scale of the torques." in text
    assert "cross-validated 2 %" in said("effect", best)


def in_a_loop(verdict: Verdict, *candidates: Candidate, **more: Any) -> str:
    missing = {"table": MissingTorque(3.0, 0.2)}
    return said(verdict, *candidates, mode="closed_loop", missing_torque=missing, **more)


def test_a_closed_loop_is_told_in_the_same_sentences() -> None:
    best = candidate("coulomb@table", explained=0.9)
    none = np.zeros(2)
    direction = Shape("motor_1", "direction", "", "N*m", none, none, none, none, 0.47)
    text = in_a_loop("unknown", best, shapes=[direction])
    assert "Best candidate: coulomb@table; removes 90 % of the unexplained error; with it" in text
    assert (
        "47 % of the missing torque of the motor 1 depends only on the sign of the speed, as dry "
        "friction does."
    ) in text
    assert "spline" not in text
    assert "The refitted machine leaves 20 % of the drive torque unexplained at the table" in text
    note = "needs fraction = 0.5, its upper limit: implausible"
    text = in_a_loop("unknown", candidate("load_dependent_mesh_loss@table", note=note))
    assert f"removes 95 % of the unexplained error; {note}." in text
    text = in_a_loop("unknown", candidate("viscous@table", explained=0.0))
    assert "No candidate helps. Check signs, scales and units of the channels." in text
    text = in_a_loop("effect", best)
    assert "It removes 90 % of the unexplained error." in text
    assert "Without it, the refitted machine leaves 20 %" in text
    assert "cross-validated 2 %" in text
    assert text.endswith("To add it: dualdrive add")
    cut = in_a_loop("unfinished", best)
    assert "stopped before every law had its turn" in cut
    assert "no effect of the library" not in cut
    assert "To add it" not in cut


def test_a_lag_is_told_with_its_command() -> None:
    lag = Skew("log8", "theta_m", "theta_c1", 0.0348, 0.019, 0.051, 0.01, 0.0, True)
    assert lag.message == (
        "log8: theta_c1 lags theta_m by 34.8 ms (19 to 51 ms; 3.5 samples). Uncorrected, this "
        "looks like compliance or backlash. If it is real: dualdrive add MACHINE "
        "sensor_delay@theta_c1 --set time=34.8ms"
    )


def test_a_ripple_whose_source_no_ratio_tells_is_one_line() -> None:
    seen = Order("r", "total", "pinion 2", 58.5, 0.06, 0.1, "N*m", 9.0, 0.1, 1e-6)
    ripple = replace(seen, alike=("pinion 1",), geared=False)
    assert ripple.spoken == "58.5 per turn (all ratios are 1: its source can't be told)"


def test_no_printed_string_says_foretold() -> None:
    """Cross-validated, or predicted: the words of the trade, in help texts and figures, too."""
    package = [(p, False) for p in (ROOT / "python" / "dualdrive").rglob("*.py")]
    verbs = [(p, True) for p in (ROOT / "cli").glob("*.py")]
    assert {"improvement.py", "cycles.py"} <= {path.name for path, _ in package + verbs}
    said = [
        f"{path.name}: {text}"
        for path, documented in package + verbs
        for text in strings(ast.parse(path.read_text("utf-8")), documented=documented)
        if "foretold" in text
    ]
    assert not said


def strings(tree: ast.Module, *, documented: bool) -> list[str]:
    """Every string of a module, its docstrings only where they are printed."""
    bare = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr) and not documented}
    found = [n for n in ast.walk(tree) if isinstance(n, ast.Constant) and id(n) not in bare]
    return [n.value for n in found if isinstance(n.value, str)]

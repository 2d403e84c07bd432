"""What a notebook shows, and labelled arrays to and from pandas and xarray."""

from __future__ import annotations

import subprocess
import sys
from html.parser import HTMLParser

import numpy as np
import pytest

import dualdrive
from diagnosed import NASTY, diagnosis, ladder
from dualdrive import cycles, ensembles, identify, indexing, linear, optimise, tune
from dualdrive.compare import Comparison
from dualdrive.demo import records, sheet
from dualdrive.identify import fit
from dualdrive.paper import exhibit
from dualdrive.traces import Trace, TraceError, from_pandas, from_xarray


class Closed(HTMLParser):
    """Whether every element is closed in its order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.words = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: object) -> None:
        if tag not in ("meta", "br", "path", "use"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: object) -> None:
        """Closed at once."""

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words += f" {data}"


def test_a_diagnosis_and_a_ladder_show_themselves() -> None:
    for result, said in (
        (diagnosis(), "coulomb@table"),
        (ladder(), "nothing is left that these records could show"),
    ):
        text = result._repr_html_()
        shown = Closed(text)
        assert shown.open == []
        assert said in shown.words
        assert "<svg" in text
        assert "<script>alert" not in text
    assert NASTY in Closed(diagnosis()._repr_html_()).words


def test_a_fit_shows_its_numbers() -> None:
    machine, (fitting, _) = sheet(), records()
    found = fit(machine, fitting.between(0, 4), ["table.J"], max_simulations=3)
    shown = Closed(found._repr_html_())
    assert "table.J" in shown.words
    assert f"{found.parameters['table.J'].value:.6g}" in shown.words


def test_results_that_have_a_picture_show_it() -> None:
    """A response and a positioning test as they are; of the others, that their picture is there."""
    f = np.linspace(1.0, 100.0, 50)
    results = (
        linear.FrequencyResponse(f, (1.0 / (1.0 + 0.1j * f)).astype(complex), "in", "out"),
        indexing.evaluate([0.0, 1.0], [[1e-5, 2e-5], [1.0, 1.00001]], unit="rad"),
    )
    for result in results:
        shown = Closed(result._repr_html_())
        assert shown.open == []
        assert type(result).__name__ in shown.words
    for kind in (
        cycles.Branch, cycles.Orbit, cycles.Survey, identify.PlayEstimate, indexing.Iso230,
        linear.DriveComparison, linear.FrequencyResponse, optimise.Front, tune.Tuning,
    ):  # fmt: skip
        assert callable(getattr(dualdrive.plots, kind._picture))
        assert callable(kind._repr_html_)


def test_results_without_a_picture_show_their_tables() -> None:
    """Angles in engineering units; what comes from outside is escaped."""
    cell = indexing.Cell("light <i>", "table", 1.0, 5.0, 0.5)
    figures = np.array([[1.0, 2.0, 3.0], [3.0, 4.0, 5.0], [np.nan] * 3])
    sheet_ = exhibit.Table("own", ("what", "value"), (("play", 2.5), ("none", None)))
    number = exhibit.Number("deviation", "arcsec", 10.0, 9.0)
    shown = (
        (cycles.Predicted(12.5, 1e-5, 2e-3, 0.5, True, "dry friction"), "2.063 arcsec"),
        (indexing.LostMotion("axis <i>", 0.25, 0.125, (3, 4), ((0, 1), (0, 1))), "axis <i>"),
        (indexing.Crossed({(cell, "traditional"): figures}, 3, {}), "light <i>"),
        (exhibit.Exhibit("fig1", "a <i>", "about", (), (number,), tables=(sheet_,)), "a <i>"),
        (
            ensembles.ensemble(sheet(), values={"table.J": [9e3, 1e4]}, end=0.05),
            "Ensemble of 2 runs",
        ),
    )
    for result, words in shown:
        text = result._repr_html_()
        assert Closed(text).open == []
        assert words in Closed(text).words, text
        assert "<i>" not in text


@pytest.fixture(scope="module")
def compared() -> Comparison:
    found = diagnosis().before
    assert found is not None
    return found


def test_a_comparison_becomes_a_labelled_dataset(compared: Comparison) -> None:
    data = dualdrive.notebook.comparison_dataset(compared)
    q = compared["I_1"]
    assert data["I_1"].attrs["units"] == "A"
    np.testing.assert_array_equal(data["I_1"].sel(what="residual"), q.simulated - q.measured)
    with pytest.raises(KeyError, match="there are fit"):
        dualdrive.notebook.comparison_dataset(compared, "other")


def test_traces_come_back_from_pandas_and_xarray() -> None:
    trace, _ = records()
    for back in (from_pandas(trace.to_pandas()), from_xarray(trace.to_xarray())):
        assert back.name == trace.name
        assert set(back) == set(trace)
        np.testing.assert_array_equal(back.t, trace.t)
        for name in trace:
            np.testing.assert_array_equal(back[name], trace[name])
            assert back.units[name] == trace.units[name]


def test_units_of_a_frame_are_converted_and_others_refused() -> None:
    frame = Trace(t=np.arange(3.0), channels={"theta_m": np.arange(3.0)}).to_pandas()
    degrees = from_pandas(frame, {"theta_m": "deg"})
    np.testing.assert_allclose(degrees["theta_m"], np.radians([0, 1, 2]))
    with pytest.raises(TraceError, match="theta_m: A does not measure rad"):
        from_pandas(frame, {"theta_m": "A"})
    with pytest.raises(TraceError, match="is over x, not over t"):
        from_xarray(
            from_pandas(frame).to_xarray().drop_vars("row").rename(t="x").assign_coords(t=0.0)
        )
    with pytest.raises(TraceError, match="strictly increasing"):
        from_pandas(frame.iloc[::-1])


def test_import_dualdrive_alone_reaches_every_public_name() -> None:
    """In an interpreter of its own, where nothing was imported before."""
    code = """
import dualdrive
for path in ("diagnose.diagnose", "diagnose.improve", "compare.compare", "identify.fit",
             "traces.read", "report.page", "workbench.serve", "notebook.diagnosis", "plots.ladder",
             "Machine.load", "simulate", "sweep", "innovations"):
    found = dualdrive
    for name in path.split("."):
        found = getattr(found, name)
"""
    subprocess.run([sys.executable, "-c", code], check=True)

"""Text tables as recorders write them: what can be told from the file, and what is refused."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dualdrive.traces import ColumnRule, FileLayout, TimeRule, Trace, TraceError, TraceMap, read

ARCSEC = math.pi / 648000
RPM = math.pi / 30

Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def make(text: str, name: str = "log.csv", encoding: str = "utf-8") -> Path:
        path = tmp_path / name
        path.write_bytes(text.encode(encoding))
        return path

    return make


def refused(path: Path, mapping: TraceMap | None = None) -> TraceError:
    with pytest.raises(TraceError) as caught:
        read(path, mapping)
    assert str(caught.value).startswith(path.name)
    assert "\n" not in str(caught.value)
    assert ";" in str(caught.value)  # rule; way out
    return caught.value


def assert_two_rows(trace: Trace) -> None:
    np.testing.assert_allclose(trace.t, [0, 0.001])
    np.testing.assert_allclose(trace["theta_m"], [10 * ARCSEC, 20.5 * ARCSEC], rtol=1e-14)
    np.testing.assert_allclose(trace["omega_1"], [100 * RPM, -150 * RPM], rtol=1e-14)


CANONICAL = "t [s], theta_m [arcsec], omega_1 [rpm]\n0,10,100\n0.001,20.5,-150\n"


def test_canonical_header_with_units(write: Write) -> None:
    trace = read(write(CANONICAL))
    assert_two_rows(trace)
    assert trace.units["theta_m"] == "rad"
    assert trace.rows.tolist() == [2, 3]  # as an editor counts
    assert not trace.log.issues


def test_no_unit_means_si(write: Write) -> None:
    trace = read(write("t,theta_m,T_1\n0,0.1,5\n1,0.2,6\n"))
    np.testing.assert_array_equal(trace["theta_m"], [0.1, 0.2])
    np.testing.assert_array_equal(trace["T_1"], [5, 6])


@pytest.mark.parametrize(
    "text",
    [
        "t [s];theta_m [arcsec];omega_1 [rpm]\n0;10;100\n0,001;20,5;-150\n",
        "t (s)\ttheta_m (arcsec)\tomega_1 (rpm)\n0\t10\t100\n0.001\t20.5\t-150\n",
        "t|theta_m|omega_1\n[s]|[arcsec]|[rpm]\n0|10|100\n0.001|20.5|-150\n",
        "t;theta_m;omega_1\ns;arcsec;rpm\n\n0;10;100\n0,001;20,5;-150\n\n\n",
        't [s];theta_m [arcsec];omega_1 [U/min];\n"0";"10";"100";\n"0,001";"20,5";"-150";\n',
        "t [ms] theta_m [arcsec] omega_1 [1/min]\n 0  10  100\n 1  20.5 -150\n",
        "# t [ms], theta_m [arcsec], omega_1 [rpm]\r\n0,10,1e2\r\n1,20.5,-1.5e2\r\n",
        "Scope export 4.1\nDevice;Axis C\nRate;1,000 kHz\nRows;2\n\n"
        "t [s];theta_m [″];omega_1 [min-1]\n0;10;100\n0,001;20,5;-150\n",
    ],
    ids=["semicolon", "tab", "bar", "units-row", "quoted", "spaces", "comment", "preamble"],
)
def test_layouts(write: Write, text: str) -> None:
    assert_two_rows(read(write(text)))


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
def test_unicode_encodings(write: Write, encoding: str) -> None:
    assert_two_rows(read(write(CANONICAL, encoding=encoding)))


def test_windows_encoding(write: Write) -> None:
    text = "t [s];theta_m [°];Übersetzung\n0;180;3\n1;90;3\n"
    trace = read(write(text, encoding="cp1252"))
    np.testing.assert_allclose(trace["theta_m"], [math.pi, math.pi / 2])
    assert trace.extra == ("Übersetzung",)
    assert trace.source.layout["encoding"] == "cp1252"


def test_stated_layout_wins(write: Write) -> None:
    path = write("1;2\n3;4\n5;6\n")
    mapping = TraceMap(file=FileLayout(names=("t", "theta_m"), delimiter=";"))
    np.testing.assert_array_equal(read(path, mapping)["theta_m"], [2, 4, 6])
    path = write("t,theta_m\nnames,again\n0,1\n1,2\n")
    mapping = TraceMap(file=FileLayout(header_line=1))
    np.testing.assert_array_equal(read(path, mapping)["theta_m"], [1, 2])


def test_blank_rows_are_named(write: Write) -> None:
    trace = read(write("t,theta_m\n0,1\n\n1,2\n,\n2,3\n"))
    assert trace.log["blank_row"][0].rows == (3, 5)
    assert trace.rows.tolist() == [2, 4, 6]


def test_cells_that_are_no_numbers_are_named(write: Write) -> None:
    trace = read(write("t,theta_m,T_1\n0,1,1\n1,#REF!,2\n2,3,3\n3,4,\n4,5,5\n"))
    assert trace.log["non_numeric"][0].rows == (3,)
    assert "#REF!" in str(trace.log)
    assert {row for issue in trace.log["missing"] for row in issue.rows} == {3, 5}
    np.testing.assert_array_equal(trace.t, [0, 2, 4])


def test_column_of_words_is_no_channel(write: Write) -> None:
    trace = read(write("t,theta_m,state\n0,1,ready\n1,2,run\n"))
    assert "state" in str(trace.log["text_column"][0])
    assert trace.extra == ()
    error = refused(write("t,theta_m,T_1\n0,low,1\n1,high,2\n"))
    assert error.kind == "non_numeric"
    assert error.rows == (2, 3)


def test_stand_in_for_missing(write: Write) -> None:
    mapping = TraceMap(file=FileLayout(missing=(-9999.0,)))
    trace = read(write("t,theta_m\n0,1\n1,-9999\n2,3\n"), mapping)
    assert trace.log["missing"][0].rows == (3,)


def test_row_with_too_many_cells(write: Write) -> None:
    error = refused(write("t,theta_m\n0,1\n1,2\n2,3,4\n3,4\n"))
    assert "3 cells" in str(error)
    assert error.rows == (4,)


def test_quotation_mark_that_is_not_closed(write: Write) -> None:
    error = refused(write('t,theta_m,note\n0,1,a\n1,2,"b\n2,3,c"\n3,4,d\n'))
    assert "quotation mark" in str(error)


def test_row_cut_short(write: Write) -> None:
    trace = read(write("t,theta_m,T_1\n0,1,1\n1,2,2\n2,3\n"))
    assert trace.log["missing"][0].rows == (4,)


def test_duplicate_columns(write: Write) -> None:
    assert refused(write("t,theta_m,theta_m\n0,1,1\n1,2,2\n")).kind == "duplicate_column"
    trace = read(write("t,theta_m,temp,temp\n0,1,20,30\n1,2,20,30\n"))
    assert trace.extra == ("temp", "temp (2)")
    assert "duplicate_column" in trace.log
    mapping = TraceMap(columns={"temp": ColumnRule(channel="T_load")})
    assert refused(write("t,theta_m,temp,temp\n0,1,2,3\n1,2,2,3\n"), mapping).kind == (
        "duplicate_column"
    )


def test_two_columns_for_one_channel(write: Write) -> None:
    mapping = TraceMap(columns={"pos": ColumnRule(channel="theta_m")})
    assert "both give theta_m" in str(refused(write("t,pos,theta_m\n0,1,1\n1,2,2\n"), mapping))


def test_missing_column_is_named_with_the_nearest(write: Write) -> None:
    mapping = TraceMap(columns={"Positon": ColumnRule(channel="theta_m")})
    error = refused(write("t,Position\n0,1\n1,2\n"), mapping)
    assert error.kind == "column"
    assert "did you mean 'Position'?" in str(error)


@pytest.mark.parametrize(
    ("header", "mention"),
    [
        ("t [s],theta_m [N*m]", "does not measure rad"),
        ("t [s],theta_m [furlongs]", "furlongs"),
        ("t [s],omega_m [Hz]", "turns per second"),
        ("t [m],theta_m [rad]", "does not measure s"),
        ("t [s],T_1 [%]", 'of = "100 N*m"'),
    ],
)
def test_wrong_unit(write: Write, header: str, mention: str) -> None:
    error = refused(write(f"{header}\n0,1\n1,2\n"))
    assert error.kind == "unit"
    assert mention in str(error)


@pytest.mark.parametrize(
    ("text", "mention"),
    [
        ("", "empty"),
        ("\n\n", "empty"),
        ("t,theta_m\n", "no row of numbers"),
        ("t,theta_m\n0,1\n", "fewer than two"),
        ("0,1\n1,2\n2,3\n", "no header"),
        ("theta_m,T_1\n0,1\n1,2\n", "no column t"),
        ("t,speed\n0,1\n1,2\n", "no column is a known channel"),
        ("t,a,b,c\n0,1\n1,2\n2,3\n", "names 4 columns"),
    ],
)
def test_refused(write: Write, text: str, mention: str) -> None:
    assert mention in str(refused(write(text)))


def test_no_such_file(tmp_path: Path) -> None:
    assert "no such file" in str(refused(tmp_path / "none.csv"))


def test_clock_without_column(write: Write) -> None:
    mapping = TraceMap(time=TimeRule(sample_time="2ms"))
    np.testing.assert_allclose(read(write("theta_m\n1\n2\n3\n"), mapping).t, [0, 0.002, 0.004])

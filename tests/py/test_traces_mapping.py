"""Mapping files: what they may say, how mistakes in them are met, and proposals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dualdrive.traces import (
    ColumnRule,
    RowRule,
    SplitRule,
    TimeRule,
    TraceError,
    TraceMap,
    find_mapping,
    guess_mapping,
    read,
    read_mapping,
    read_parts,
    write_mapping,
)


def refused(tmp_path: Path, text: str) -> str:
    path = tmp_path / "bad.map.toml"
    path.write_text(text)
    with pytest.raises(TraceError) as caught:
        read_mapping(path)
    assert str(caught.value).startswith("bad.map.toml: ")
    assert caught.value.kind == "mapping"
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "mention"),
    [
        ("[tiem]", "did you mean time?"),
        ("[time]\ncolum = 't'", "time.colum: unknown key; did you mean column?"),
        ("[time]\nbackwards = 'ignore'", "time.backwards = 'ignore'"),
        ("[time]\ngap = '5 m'", "does not measure s"),
        ("[time]\ngap = '-5 s'", "must be positive"),
        ("[time]\nzero = 1", "must be true or false"),
        ("[time]\nwrap = 'x'", "must be a finite number"),
        ("time = 3", "must be a table"),
        ("columns = 3", "must be tables"),
        ("[columns.a]\nsign = 2", "write 1 or -1"),
        ("[columns.a]\nsign = true", "write 1 or -1"),
        ("[columns.a]\nscale = 0", "other than zero"),
        ("[columns.a]\nscale = '1/x'", "other than zero"),
        ("[columns.a]\nsign_bit = 1.5", "whole number"),
        ("[columns.a]\nwrap = -1", "raw value of one turn"),
        ("[columns.a]\nchannel = 1", "must be text"),
        ("[columns.a]\nchannel = 'T_1'\n[columns.b]\nchannel = 'T_1'", "both give T_1"),
        ("[rows]\nkeep = [1]", "list of texts"),
        ("[file]\nmissing = ['a']", "list of numbers"),
        ("[file", "not valid TOML"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, text: str, mention: str) -> None:
    assert mention in refused(tmp_path, text)


def test_missing_mapping_file(tmp_path: Path) -> None:
    with pytest.raises(TraceError, match="there is no such file"):
        read_mapping(tmp_path / "none.toml")


def test_mapping_beside_the_file(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("t,pos\n0,1\n1,2\n")
    assert find_mapping(log) is None
    (tmp_path / "traces.map.toml").write_text("[columns.pos]\nchannel = 'theta_m'")
    assert read(log).canonical == ("theta_m",)
    (tmp_path / "log.map.toml").write_text("[columns.pos]\nchannel = 'theta_1'")
    trace = read(log)
    assert trace.canonical == ("theta_1",)
    assert trace.source.mapping_file == "log.map.toml"


@pytest.mark.parametrize(
    ("rows", "left"),
    [
        ({"keep": ("mode == 1",)}, [1, 2]),
        ({"drop": ("mode == 0", "mode == 2")}, [1, 2]),
        ({"keep": ("mode >= 1", "mode < 2")}, [1, 2]),
        ({"keep": ("mode > 0",), "drop": ("state == 'off'",)}, [2, 3]),
        ({"keep": ("state != on",)}, [0, 1]),
        ({"keep": ("mode <= 1",)}, [0, 1, 2]),
        ({"drop": ("mode >= 2",)}, [0, 1, 2]),
    ],
)
def test_row_conditions(tmp_path: Path, rows: dict[str, tuple[str, ...]], left: list[int]) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,theta_m,mode,state\n0,0,0,off\n1,1,1,off\n2,2,1,on\n3,3,2,on\n")
    trace = read(path, TraceMap(rows=RowRule(**rows)))
    np.testing.assert_array_equal(trace["theta_m"], left)


@pytest.mark.parametrize("text", ["mode", "mode = 1", "mode > on", "speed == 1", "mode == 7"])
def test_bad_row_conditions(tmp_path: Path, text: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,theta_m,mode\n0,0,0\n1,1,1\n")
    with pytest.raises(TraceError, match=r"^log\.csv: "):
        read(path, TraceMap(rows=RowRule(keep=(text,))))


def test_split_by_words_numbers_them(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,theta_m,run\n0,0,cold\n1,1,cold\n2,2,hot\n3,3,hot\n")
    parts = read_parts(path, TraceMap(split=SplitRule(by=("run",))))
    assert [part.labels["run"] for part in parts] == [0, 1]
    assert "cold = 0, hot = 1" in str(parts[0].log)


def test_ignored_columns(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,theta_m,temp 1,temp 2,pos\n0,0,1,1,5\n1,1,1,1,6\n")
    mapping = tmp_path / "m.toml"
    mapping.write_text("[file]\nignore = ['temp *']")
    assert read(path, mapping).extra == ("pos",)
    mapping.write_text("[file]\nignore = ['*']\n[columns.pos]\nchannel = 'T_1'")
    assert tuple(read(path, mapping)) == ("T_1",)
    mapping.write_text("[file]\nignore = ['tmp']")
    with pytest.raises(TraceError, match="no such column"):
        read(path, mapping)


words = st.text("abcäΩ 你[](){}.'\"#=\\,;1", min_size=1, max_size=12)
rules = st.builds(
    ColumnRule,
    channel=words,
    unit=st.sampled_from(["", "deg", "N*m", "%"]),
    sign=st.sampled_from([1, -1]),
    scale=st.one_of(st.floats(1e-9, 1e9), st.sampled_from(["1/4096", "-3/7"])),
    offset=st.floats(allow_nan=False, allow_infinity=False),
    wrap=st.one_of(st.booleans(), st.floats(1e-3, 1e6)),
    sign_bit=st.integers(-1, 31),
    reset=st.sampled_from(["split", "continue", "keep"]),
)
mappings = st.builds(
    TraceMap,
    time=st.builds(TimeRule, column=words, gap=st.sampled_from(["", "20ms"]), zero=st.booleans()),
    columns=st.dictionaries(words, rules, max_size=4).filter(
        lambda columns: len({rule.channel for rule in columns.values()}) == len(columns)
    ),
    rows=st.builds(RowRule, keep=st.lists(words, max_size=2).map(tuple)),
)


@given(mappings)
def test_written_mappings_read_back_equal(
    tmp_path_factory: pytest.TempPathFactory, mapping: TraceMap
) -> None:
    path = tmp_path_factory.mktemp("map") / "x.map.toml"
    again = read_mapping(write_mapping(mapping, path))
    assert again.as_dict() == mapping.as_dict()
    assert (again.time, dict(again.columns), again.rows) == (
        mapping.time,
        dict(mapping.columns),
        mapping.rows,
    )


# --- proposals -----------------------------------------------------------------------------------


def test_guess_of_a_german_drive_export(tmp_path: Path) -> None:
    t = np.arange(600) * 0.01
    angle, speed = np.sin(t), np.cos(t)
    head = "Zeit [s];Tisch_Lageistwert;Tisch_Drehzahl;Motor1_Drehmoment [Nm];Motor2_Strom [A_rms]"
    table = np.column_stack([t, np.degrees(angle), speed * 30 / np.pi, 3 * angle, angle])
    rows = [";".join(f"{x:.8f}" for x in row).replace(".", ",") for row in table]
    path = tmp_path / "scope.csv"
    path.write_bytes("\r\n".join(["Oszilloskop Übersicht", "", head, *rows]).encode("cp1252"))
    mapping = guess_mapping(path)
    channels = {name: rule.channel for name, rule in mapping.columns.items()}
    assert channels == {
        "Tisch_Lageistwert": "theta_m",
        "Tisch_Drehzahl": "omega_m",
        "Motor1_Drehmoment": "T_1",
        "Motor2_Strom": "I_2",
    }
    # nobody wrote these units down: they follow from angle and speed agreeing
    assert mapping.columns["Tisch_Lageistwert"].unit == "deg"
    assert mapping.columns["Tisch_Drehzahl"].unit == "rpm"
    assert any("so that they agree" in note for note in mapping.notes)
    write_mapping(mapping, tmp_path / "scope.map.toml")
    trace = read(path)
    np.testing.assert_allclose(trace["theta_m"], angle, atol=1e-7)
    np.testing.assert_allclose(trace["omega_m"], speed, atol=1e-7)
    np.testing.assert_allclose(trace["I_2"], np.sqrt(3) * angle, atol=1e-7)


def test_guess_says_what_it_could_not_tell(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("foo,bar\n0,1\n1,2\n")
    mapping = guess_mapping(path)
    assert not mapping.columns
    assert any("No clock" in note for note in mapping.notes)
    assert any("No channel" in note for note in mapping.notes)
    text = write_mapping(mapping, tmp_path / "guess.toml").read_text()
    assert text.startswith("# Proposal for log.csv")


@pytest.mark.parametrize(
    ("channel", "meant"), [("theta_mm", "theta_m"), ("omega_reff", "omega_ref"), ("bearing", "")]
)
def test_a_slip_in_the_name_of_a_channel_is_told(tmp_path: Path, channel: str, meant: str) -> None:
    """A name of one's own is none; nothing is compared of it."""
    csv = tmp_path / "run.csv"
    csv.write_text("t,a\n" + "\n".join(f"{0.01 * k:.2f},{k}" for k in range(20)))
    (tmp_path / "run.map.toml").write_text(
        f'[time]\ncolumn = "t"\n[columns.a]\nchannel = "{channel}"\nunit = "rad"\n'
    )
    trace = read(csv)
    assert channel in trace.extra
    asked = [str(issue).rpartition("did you mean ")[2] for issue in trace.log["unmapped"]]
    assert asked == ([f"{meant}?"] if meant else [])

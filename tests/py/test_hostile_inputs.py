"""What made tracebacks, wrong words, or was taken in silence: refused in one line that names it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from dualdrive import Machine
from dualdrive.files import FileError
from dualdrive.machine_file.layers import MachineError
from dualdrive.motion import MotionError
from dualdrive.simulation import simulate
from dualdrive.traces import TraceError, read
from dualdrive.traces.mapping_file import mapping_from, read_mapping
from dualdrive_cli._failures import end_with
from dualdrive_cli.main import main


def machine_file(folder: Path, text: str) -> Path:
    path = folder / "m.toml"
    path.write_text(f"schema = 1\nbase = 'bench'\n{text}\n")
    return path


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"[table]\nJ = {'9' * 400}", "table.J: an integer of 400 digits"),
        (f"[table]\nJ = {'9' * 5000}", "an integer of thousands of digits"),
        (f"[table]\nJ = '{'9' * 400}'", "must be finite"),
        ("[meshes]\ngap = {value={}}", r"meshes.gap = \{\}: must be a number"),
        ("[meshes]\ngap = {value=[]}", r"meshes.gap = \[\]: must be a number"),
        (f"x = {'[' * 100}{']' * 100}", "nested deeper than 20 levels"),
        (f"x = {'[' * 50_000}", "nested deeper than 20 levels"),
        (f"{'a.' * 30_000}a = 1", "a key of more than 20 names"),
        ("[table]\nJ = '1 kg^9^9^9^9'", "is not a unit"),
    ],
)
def test_machine_files(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(MachineError, match=words) as caught:
        Machine.load(machine_file(tmp_path, text))
    assert "m.toml: " in str(caught.value)
    assert len(str(caught.value)) < 400


def test_names_that_no_file_can_have(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text('schema = 1\nbase = "a\\u0000b"\n')
    with pytest.raises(FileError, match="no file has the character NUL in its name"):
        Machine.load(path)
    with pytest.raises(FileError, match="File name too long"):
        Machine.load("n" * 300 + ".toml")
    with pytest.raises(TraceError, match=r"\.: a folder, no file"):
        read(".")
    with pytest.raises(FileError, match="longer than 100 MB"):
        Machine.load(Path("/dev/zero"))


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({"file": {"delimiter": "ab"}}, "file.delimiter = 'ab': must be one character"),
        ({"file": {"delimiter": "1"}}, "must be one character that is in no number"),
        ({"file": {"header_line": float("inf")}}, "must be a whole number"),
        ({"columns": {"a": {"scale": "9" * 400}}}, "must be a finite number other than zero"),
        ({"columns": {"a": {"scale": "1_0"}}}, "must be a finite number other than zero"),
        ({"columns": {"a": {"sign_bit": -1}}}, "must be the number of a bit, 0 to 52"),
        ({"columns": {"a": {"sign_bit": 99}}}, "must be the number of a bit, 0 to 52"),
        ({"columns": {"a": {"offset": float("nan")}}}, "must be a finite number"),
        ({"time": {"format": "whenever"}}, "time.format = 'whenever': no pattern of a time"),
        ({"time": {"format": "%Q"}}, "no pattern of a time"),
    ],
)
def test_mappings(tables: dict[str, dict[str, object]], words: str) -> None:
    with pytest.raises(TraceError, match=words):
        mapping_from(tables)


def table(folder: Path, *lines: str) -> Path:
    path = folder / "x.csv"
    path.write_text("\n".join(("t [s],theta_m [deg],I_1 [A],p [%]", *lines)) + "\n")
    return path


ROWS = [f"{k / 10},{k},{k},{k}" for k in range(20)]


@pytest.mark.parametrize(
    ("rules", "words"),
    [
        ({"columns": {"theta_m": {"current": "rms"}}}, "theta_m: current = 'rms' is of a phase"),
        ({"columns": {"theta_m": {"of": "5 kg"}}}, "of = '5 kg' says what 100 % are, and the unit"),
        ({"time": {"format": "%H:%M:%S"}}, "is of texts, and t holds numbers"),
        ({"columns": {"theta_m": {"scale": 1e300}}}, "in rad beyond 1e"),
    ],
)
def test_rules_that_do_not_fit_their_column(
    tmp_path: Path, rules: dict[str, dict[str, object]], words: str
) -> None:
    sound = {"columns": {"p": {"of": "5 N*m"}, "I_1": {"current": "rms"}}}
    read(table(tmp_path, *ROWS), mapping_from(sound))
    rows = [row.replace(",19,", ",1e100,") for row in ROWS]
    with pytest.raises(TraceError, match=words):
        read(table(tmp_path, *rows), mapping_from(rules))


def test_cells_of_a_table(tmp_path: Path) -> None:
    with pytest.raises(
        TraceError, match=r"^x\.csv: no table: a cell of more than 131,072 characters"
    ):
        read(table(tmp_path, "0.1," + "9" * 200_000 + ",1,1", *ROWS))
    trace = read(table(tmp_path, *ROWS, "2,1_0,1,1", "2.1,1e308,1,1", "2.2,21,1,1"))
    assert trace.log["non_numeric"][0].rows == (22,)
    assert trace.log["not_finite"][0].rows == (23,)
    np.testing.assert_allclose(trace["theta_m"][-1], np.radians(21))


def test_a_parameter_of_a_formula_is_no_signal() -> None:
    machine = Machine.load("bench")
    with pytest.raises(MachineError, match=r"parameters\.omega_m: is a signal of this machine"):
        machine.add("expression@table", formula="omega_m", parameters={"omega_m": "3 N*m"})


@pytest.mark.parametrize("engine", ["exact", "explicit"])
def test_a_method_is_of_cvode(engine: str) -> None:
    with pytest.raises(MachineError, match="method is of the cvode engine alone"):
        simulate(Machine.load("bench"), end=0.1, engine=engine, method="bdf")


def typed(*arguments: str) -> Result:
    return CliRunner().invoke(main, arguments)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["simulate", "bench", "--motion", ""], "'' is unknown; choose one of move, "),
        (["simulate", "bench", "--end", ""], "--end = '': not a number with a unit"),
        (["simulate", "bench", "--load", ""], "--load = '': not a number with a unit"),
        (["simulate", "bench", "--end", "9" * 9000], "must be finite"),
        (["simulate", "bench", "--engine", "a" * 9000], "is not one of 'auto'"),
        (["simulate", "a" * 9000], "File name too long"),
        (["machine", "show", "n" * 300], "File name too long; name a machine file"),
        (["simulate", "bench", "--set", f"table.{'x' * 5000}=1"], "xxx...xxx"),
        (["bode", "bench", "--frequencies", "1:2:1000000000000"], "takes about 2e+03 TB"),
        (["indexing", "bench", "--targets", "0:1:1000000000000"], "takes about 64 TB"),
        (["add", "bench", "spline@table", "--curve", "angle=0:1:1000000000", "-o", "grown.toml"],
         "takes about 1 TB"),
    ],
)  # fmt: skip
def test_command_lines(arguments: Sequence[str], words: str) -> None:
    result = typed(*arguments)
    assert result.exit_code == 2
    assert words in result.stderr
    assert len(result.stderr.splitlines()[-1]) < 1100


@pytest.mark.parametrize("verb", [["compare", "bench"], ["play"], ["map"], ["diagnose", "bench"]])
@pytest.mark.parametrize("name", [".", "/", ".."])
def test_a_folder_is_no_recording(verb: list[str], name: str) -> None:
    """`.` ended in the words "PosixPath('.') has an empty name"."""
    result = typed(*verb, name)
    assert result.exit_code == 2
    assert (
        result.stderr.splitlines()[-1] == f"dualdrive: {name}: a folder, no file; name a recording"
    )


def test_a_name_of_any_bytes_is_told(tmp_path: Path) -> None:
    result = typed("simulate", "bench", "--end", "10ms", "-o", f"{tmp_path}/x\udcff.h5")
    assert result.exit_code == 0
    assert result.exception is None


def test_the_channel_list_of_a_mapping_is_read_like_a_machine(tmp_path: Path) -> None:
    path = tmp_path / "x.map.toml"
    path.write_text(f"a = {'[' * 5000}")
    with pytest.raises(TraceError, match=r"^x\.map\.toml: nested deeper than 20 levels"):
        read_mapping(path)


@pytest.mark.parametrize(
    "text",
    [
        "schema = 1\n[gearboxes]\nkind = '{}'\n",
        "schema = 1\n[table]\nJ = '1 {}'\n",
        "schema = 1\n{} = 3\n",
        "schema = 1\n{} = [\n",
    ],
)
@pytest.mark.parametrize("long", ["a" * 5000, "a b " * 3000])
def test_the_library_echoes_no_kilobytes(text: str, long: str) -> None:
    """The command line cut them; who used the library had them whole."""
    with pytest.raises(ValueError, match="machine") as refusal:
        Machine.from_toml(text.format(long))
    assert len(str(refusal.value)) < 1200
    assert "\n" not in str(refusal.value)


def test_threads_that_can_not_be_started_are_told() -> None:
    for error in (RuntimeError("can't start new thread"), BlockingIOError(11, "Resource")):
        with pytest.raises(SystemExit) as end:
            end_with(error)
        assert end.value.code == 1


@pytest.mark.parametrize("count", [-1, 101, 99_999_999, 4_000_000_000, 2**62])
def test_encoder_samples_beyond_use_are_refused(count: int) -> None:
    """Found by fuzzing: one ended in the binding's words, one in 20 GB of states."""
    head = "schema = 1\nbase = 'bench'\n[controller]\nspeed_sample = '1ms'\n"
    with pytest.raises(MachineError, match="speed_samples"):
        Machine.from_toml(f"{head}speed_samples = {count}\n")


@pytest.mark.parametrize(
    ("path", "value"), [("motors.T_max", 1e-320), ("motors.omega_max", 1e-322)]
)
def test_a_machine_that_can_not_move_is_told(path: str, value: float) -> None:
    """Found by fuzzing: it ended in the words of the core's own move."""
    machine = Machine.load("bench")
    machine.set(path, value)
    with pytest.raises(MotionError, match="bench: no motion suits it"):
        simulate(machine, end=0.01)


def test_a_law_that_explodes_ends_and_says_so() -> None:
    """exp(1000 t) ran until the step limit."""
    machine = Machine.load("bench")
    machine.add("expression@table", formula="c*exp(1000*t)", parameters={"c": 1.0})
    found = simulate(machine, end=2.0)
    assert not found.ok
    assert found.status in ("not_finite", "step_too_small", "too_many_steps")
    assert found.statistics["steps"] < 500_000


def test_a_load_of_nothing_is_no_load_to_the_last_bit() -> None:
    machine = Machine.load("bench")
    bare, loaded = (simulate(machine, end=2.0, load=load) for load in (None, 0.0))
    for name in ("theta_m", "I_1", "T_2"):
        assert np.array_equal(bare[name], loaded[name])

"""The verbs machine, simulate, effects and add, as a user types them."""

from __future__ import annotations

import json
import math
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from dualdrive import Machine, load_run
from dualdrive_cli.main import main
from full_disk import full_disk
from patience import PATIENCE

ARCSEC = math.pi / 648000
DUALDRIVE = [sys.executable, "-m", "dualdrive_cli"]
OWN = [
    ["machine", "list"],
    ["machine", "show"],
    ["machine", "new"],
    ["simulate"],
    ["effects"],
    ["add"],
]


@pytest.fixture
def dualdrive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Result]:
    """Run a command line in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def run(line: str) -> Result:
        return CliRunner().invoke(main, shlex.split(line))

    return run


def one_line(result: Result) -> str:
    """The error of a refused command."""
    assert result.stderr.count("\n") == 1, result.stderr
    assert result.stderr.startswith("dualdrive: ")
    return str(result.stderr)


# --- help -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("verb", OWN, ids=" ".join)
def test_the_example_of_the_help_works(verb: list[str], dualdrive: Callable[[str], Result]) -> None:
    shown = dualdrive(f"{' '.join(verb)} --help")
    assert shown.exit_code == 0
    text = " ".join(shown.output.split())
    example = re.search(r"Example: dualdrive (.+)$", text)
    assert example, f"the help of {verb} shows no example"
    done = dualdrive(example[1])
    assert done.exit_code == 0, done.output
    assert example[1].split()[: len(verb)] == verb


# --- what comes out -------------------------------------------------------------------------------


def test_list_and_show(dualdrive: Callable[[str], Result]) -> None:
    names = [m["name"] for m in json.loads(dualdrive("machine list --json -").stdout)]
    assert {"heavy-table-empty", "heavy-table-550t", "bench", "linear-axis"} <= set(names)
    shown = dualdrive("machine show heavy-table-100t --set meshes.gap=20arcsec").output
    assert re.search(r"meshes\.gap +20 arcsec +9\.69\d+e-05 rad +>= 0 ", shown)
    content = json.loads(dualdrive("machine show linear-axis --json -").stdout)
    assert content["parameters"]["table.J"]["unit"] == "kg"
    assert content["parameters"]["motor_1.U_max"]["value"] is None  # no limit


def test_every_number_shown_has_a_unit_or_is_a_ratio(dualdrive: Callable[[str], Result]) -> None:
    content = json.loads(dualdrive("machine show --json -").stdout)
    bare = {path.rpartition(".")[2] for path, p in content["parameters"].items() if not p["unit"]}
    damping = {"filter_pole_damping", "filter_zero_damping"}
    assert bare == {"ratio", "K_d", "f_v", "g_E", "w", "asymmetry", *damping}


def test_new_writes_a_machine_with_its_history(dualdrive: Callable[[str], Result]) -> None:
    done = dualdrive(
        "machine new --preset bench --set table.J=0.3 --set controller.equaliser=slave -o rig.toml"
    )
    assert done.exit_code == 0, done.output
    m = Machine.load("rig.toml")
    assert (m.name, m.get("table.J")) == ("rig", 0.3)
    assert m.core.controller_options["equaliser"] == "slave"
    assert m.history[-1]["change"] == "made from bench, table.J=0.3, controller.equaliser=slave"


def test_simulate_writes_the_run_its_picture_and_its_figures(
    dualdrive: Callable[[str], Result],
) -> None:
    done = dualdrive(
        "simulate heavy-table-550t --set controller.T_ten=0 -o run.h5 --plot run.png --json a.json"
        " --motion move:0.02,v=0.03,a=0.01,j=0.05,start=2,end=14"
    )
    assert done.exit_code == 0, done.output
    run = load_run("run.h5")
    assert run.machine.get("controller.T_ten") == 0
    assert Path("run.png").read_bytes()[:4] == b"\x89PNG"
    content = json.loads(Path("a.json").read_text())
    assert content["status"] == "success"
    amplitude = content["figures"]["standstill_amplitude"]
    assert amplitude["unit"] == "rad"
    assert amplitude["value"] / ARCSEC == pytest.approx(51.7, abs=0.3)  # the study's figure
    assert "51." in done.output
    assert "arcsec" in done.output


def test_simulate_with_a_load(dualdrive: Callable[[str], Result]) -> None:
    """A load at rest: both motors hold i·i_m times less, shared with the tension between them."""
    done = dualdrive(
        "simulate heavy-table-100t --motion step:0,end=20 --load '60 kN*m' -o run.h5"
        " --set 'coulomb@table.torque=0' --set 'coulomb@pinions.torque=0'"
    )
    assert done.exit_code == 0, done.output
    run = load_run("run.h5")
    assert run["T_1"][-1] + run["T_2"][-1] == pytest.approx(60e3 / 3000, rel=1e-3)
    assert run["T_1"][-1] - run["T_2"][-1] == pytest.approx(60, rel=1e-3)


def test_a_failed_run_is_written_and_ends_with_1(
    dualdrive: Callable[[str], Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    verb: Any = import_module("dualdrive_cli.simulate")
    whole = verb.simulate
    monkeypatch.setattr(verb, "simulate", lambda *a, **k: whole(*a, **k, max_steps=50))
    done = dualdrive("simulate bench -o run.h5")
    assert done.exit_code == 1
    assert "too_many_steps" in one_line(done)
    assert load_run("run.h5").status == "too_many_steps"


def test_effects(dualdrive: Callable[[str], Result]) -> None:
    everything = json.loads(dualdrive("effects --json -").stdout)
    assert {"viscous", "coulomb", "mesh_damping"} <= {effect["name"] for effect in everything}
    for effect in everything:
        for key in ("equation", "places", "source", "validity"):
            assert effect[key], (effect["name"], key)
        assert effect["parameters"] or effect["keys"], effect["name"]
    shown = dualdrive("effects coulomb").output
    assert "torque [N*m]" in shown
    assert "confused with" in shown
    shown = dualdrive("effects spline").output
    assert "coordinate" in shown
    assert "Catmull" in shown


def test_add_writes_a_new_machine_file(dualdrive: Callable[[str], Result]) -> None:
    done = dualdrive("add bench coulomb@motors --set torque=20mN*m --set table.J=0.3 -o rig.toml")
    assert done.exit_code == 0, done.output
    m = Machine.load("rig.toml")
    assert m.get("coulomb@motors.torque") == pytest.approx(0.02)
    assert m.get("table.J") == 0.3
    assert m.history[-1]["change"] == "added coulomb@motors"
    done = dualdrive(
        "add rig.toml expression@table --formula '-c*omega_m' --set 'c=3 N*m*s/rad' -o two.toml"
    )
    assert done.exit_code == 0, done.output
    assert Machine.load("two.toml").get("expression@table.c") == 3.0
    assert [h["change"] for h in Machine.load("two.toml").history] == [
        "added coulomb@motors",
        "added expression@table",
    ]


# --- what is refused ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("simulate heavy-table-101t", "no preset of that name; did you mean heavy-table-100t"),
        ("simulate --set meshes.gapp=1", "meshes.gapp = '1': unknown, did you mean meshes.gap"),
        ("simulate --set meshes.gap=5kg", "meshes.gap = '5kg': kg does not measure rad; write rad"),
        ("simulate --set meshes.gap=-1", "must be at least 0"),
        ("simulate --set table.J=nan", "table.J = 'nan': not a number with a unit"),
        ("simulate --set meshes.stiffness=0", "must be greater than 0"),
        ("simulate --motion move:1", "v, a missing"),
        ("simulate --end 5kg", "--end = '5kg'"),
        ("simulate --initial speed=1", "no such state"),
        ("simulate --sensitivity nothing", "parameter nothing: unknown"),
        ("simulate -o nowhere/run.h5", "there is no folder"),
        ("simulate -o /dev/full", "not a regular file"),
        ("simulate --json nowhere/a.json", "cannot be written"),
        ("machine show bench.toml", "no such file"),
        ("machine new --preset bench --set drives=9 -o a.toml", "has 1 to 8 drives"),
        ("effects colomb", "nearest known: coulomb"),
        ("add bench colomb -o a.toml", "nearest known: coulomb"),
        ("add bench coulomb@bed -o a.toml", "no body named bed"),
        ("add bench coulomb --set torqe=1 -o a.toml", "torqe = '1': unknown, did you mean"),
        ("add bench coulomb --set torque=-1 -o a.toml", "must be at least 0"),
    ],
)
def test_a_bad_command_is_one_line(
    line: str, told: str, dualdrive: Callable[[str], Result], tmp_path: Path
) -> None:
    done = dualdrive(line)
    assert told in one_line(done)
    writing = any(word in told for word in ("folder", "regular", "written"))
    assert done.exit_code == (1 if writing else 2)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("verb", ["simulate bench", "sweep bench --delta 0:1mrad:2"])
def test_a_picture_of_no_known_kind_is_refused_before_anything_is_computed(
    verb: str, dualdrive: Callable[[str], Result], tmp_path: Path
) -> None:
    done = dualdrive(f"{verb} -o run.h5 --plot picture.bmp")
    assert done.exit_code == 2
    assert "picture.bmp: a picture ends in .png, .pdf or .svg" in done.output + done.stderr
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten_unasked(dualdrive: Callable[[str], Result]) -> None:
    for line in (
        "simulate bench -o it",
        "add bench coulomb -o it",
        "machine new --preset bench -o it",
        "simulate bench --plot it.png",
    ):
        mine = Path(line.split()[-1])
        mine.write_text("mine")
        done = dualdrive(line)
        assert (done.exit_code, mine.read_text()) == (1, "mine"), line
        assert f"{mine}: exists already" in one_line(done)
    assert dualdrive("machine new --preset bench -o it --overwrite").exit_code == 0


def test_a_full_disk_is_one_line_and_exit_1(tmp_path: Path) -> None:
    """The system's limit on a file's size stands for the disk: the same error path."""
    done = subprocess.run(
        [*DUALDRIVE, "simulate", "bench", "-o", "run.h5"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        preexec_fn=full_disk(4096),
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == (
        "dualdrive: run.h5: cannot be written: File too large; nothing was changed there"
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_standard_output_on_a_full_disk_is_told() -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [*DUALDRIVE, "machine", "list", "--json", "-"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
        )
    assert done.returncode == 1
    assert done.stderr == (
        "dualdrive: standard output cannot be written: No space left on device\n"
    )


def test_a_closed_standard_output_is_no_error(tmp_path: Path) -> None:
    verb = [*DUALDRIVE, "machine", "new", "--preset", "bench", "-o", "m.toml"]
    done = subprocess.run(
        ["sh", "-c", '"$@" >&-', "sh", *verb], cwd=tmp_path, stderr=subprocess.PIPE, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "m.toml").exists()


# --- stopping -------------------------------------------------------------------------------------

LONG = """
import dualdrive
machine, motion = dualdrive.Machine.load(), dualdrive.parse_motion("sine:1mrad,f=1,end=1e6")
print("running", flush=True)
try:
    dualdrive.simulate(machine, motion, output_step=10.0)
except KeyboardInterrupt:
    print("stopped", flush=True)
"""


def hear_ctrl_c() -> None:
    """A program started in the background by a shell would inherit that Ctrl-C is ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def test_ctrl_c_stops_a_simulation() -> None:
    """How soon: `python benchmarks/stopping.py`."""
    with subprocess.Popen(
        [sys.executable, "-c", LONG],
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=hear_ctrl_c,
    ) as p:
        assert p.stdout is not None
        assert p.stdout.readline() == "running\n"
        time.sleep(0.3)
        p.send_signal(signal.SIGINT)
        assert p.communicate(timeout=PATIENCE)[0] == "stopped\n"


def test_a_stopped_command_leaves_no_file_and_ends_with_130(tmp_path: Path) -> None:
    line = "simulate --motion sine:1mrad,f=1,end=1e6 --output-step 10s -o run.h5"
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    p = subprocess.Popen(
        [*DUALDRIVE, *line.split()],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        preexec_fn=hear_ctrl_c,
    )
    while not list(tmp_path.glob(".run.h5.lock")):
        assert p.poll() is None, p.communicate()
        time.sleep(0.01)
    time.sleep(0.3)  # in the midst of the simulation
    p.send_signal(signal.SIGINT)
    _, told = p.communicate(timeout=PATIENCE)
    assert p.returncode == 130
    assert told.splitlines()[-1] == "dualdrive: stopped; nothing was written"
    assert list(tmp_path.iterdir()) == []

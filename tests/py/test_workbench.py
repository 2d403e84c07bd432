"""What the workbench rests on: reduction, results on disk, undo, jobs that outlive a server."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from diagnosed import diagnosis
from dualdrive.compare import compare, failing_stretches, residual_correlations, situations_of
from dualdrive.demo import records, sheet
from dualdrive.diagnose.work import Clock, Leader, Work, misfit_left
from dualdrive.files import FileError
from dualdrive.identify import evaluate
from dualdrive.workbench import keep, views
from dualdrive.workbench.project import Project, key_of
from dualdrive.workbench.script import script
from dualdrive.workbench.series import Store, nearest, reduced, write_store
from dualdrive.workbench.shown import shown
from dualdrive.workbench.story import Story
from dualdrive.workbench.worker import Progress
from dualdrive_cli.report import command as report
from patience import PATIENCE
from recorded import DEMO
from workbench_server import running, wait_for

ROOT = Path(__file__).resolve().parents[2]


# --- what the first picture waits for -------------------------------------------------------------


@pytest.mark.parametrize(
    ("code", "spared"),
    [
        (
            "import dualdrive.workbench.server; from dualdrive.web.live import units; units()",
            {"pint", "pandas", "scipy", "h5py", "matplotlib", "dualdrive.diagnose"},
        ),
        (
            "from pathlib import Path; from dualdrive.workbench.tasks import read; "
            "read(Path('.'), {'trace': {'name': 'fit', 'path': 'fit.csv', 'map': None}}, print)",
            {"pint", "scipy", "h5py", "matplotlib", "dualdrive.compare"},
        ),
    ],
    ids=["page", "recording"],
)
def test_nothing_heavy_is_loaded_before_the_first_picture(
    code: str, spared: set[str], tmp_path: Path
) -> None:
    """Each of these takes tenths of a second, and the picture needs none of them."""
    (tmp_path / "fit.csv").write_bytes((DEMO / "fit.csv").read_bytes())
    told = f"{code}; import json, sys; print(json.dumps(list(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", told], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert not spared & set(json.loads(done.stdout.splitlines()[-1]))


# --- progress ---------------------------------------------------------------------------------


def test_progress_is_told_as_numbers_and_names_what_leads(tmp_path: Path) -> None:
    tell = Progress(tmp_path)
    spoken: list[str] = []
    work = Work(Clock(1.0), told=spoken.append)
    work.tell("refitting with viscous@table")
    for label, chi in (("viscous@table", 900.0), ("coulomb@table", 10.0), ("wear@ring", 800.0)):
        work.leader.meets(label, chi, misfit_left(chi, alone=1000.0))
    work.tell("refitting with cogging@motors (4 of 9)")
    assert spoken[1].endswith("; best so far coulomb@table, 10 % of the misfit left")
    work.leader.judged("viscous@table", misfit_left(90.0, alone=1000.0))  # fewer numbers, say
    work.leader.meets("coulomb@table", 10.0, "")
    assert work.leader.after("").leader == "viscous@table, 30 % of the misfit left"
    for line in (*spoken, work.leader.after("score tests beside wear@ring; so far: 16 of 130")):
        tell(line)
    tell("errors of the simulated loop")  # told by whom no search leads: what leads stays
    tell(Leader().after("60 laws beside nothing"))
    tell("refitting with coulomb@table: simulation 4", best=0.25)
    told = [
        {key: value for key, value in json.loads(line).items() if key != "seconds"}
        for line in (tmp_path / "events.jsonl").read_text("utf-8").splitlines()
    ]
    assert told == [
        {"text": "refitting with viscous@table"},
        {"text": "refitting with cogging@motors (4 of 9)", "done": 4, "of": 9,
         "leader": "coulomb@table, 10 % of the misfit left"},
        {"text": "score tests beside wear@ring; so far: 16 of 130", "done": 16, "of": 130,
         "leader": "viscous@table, 30 % of the misfit left"},
        {"text": "errors of the simulated loop",
         "leader": "viscous@table, 30 % of the misfit left"},
        {"text": "60 laws beside nothing"},
        {"text": "refitting with coulomb@table: simulation 4", "best": 0.25},
    ]  # fmt: skip


# --- series ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    folder = tmp_path_factory.mktemp("store")
    random = np.random.default_rng(3)
    t = np.cumsum(random.uniform(0.5e-3, 1.5e-3, 200_000))
    t[120_000:] += 30.0  # a pause
    y = random.standard_normal(len(t))
    y[77_777], y[150_001] = 99.0, -88.0
    write_store(folder, {"run": (t, {"y": (y, "rad", "an angle")})})
    return Store(folder)


@pytest.mark.parametrize("span", [(0.0, 1.0), (0.1, 0.9), (0.3, 0.31), (0.37, 0.42)])
@pytest.mark.parametrize("pixels", [37, 640])
def test_no_spike_is_lost_and_none_is_invented(
    store: Store, span: tuple[float, float], pixels: int
) -> None:
    """Against the plain loop, pixel by pixel; a block may reach over an edge by its length."""
    t, y = store.times("run"), store.values("run", "y")
    start, stop = (t[0] + share * (t[-1] - t[0]) for share in span)
    found = reduced(store, "run", ["y"], start, stop, pixels)
    inside = y[(t >= start) & (t <= stop)]
    assert np.nanmax(found.values) >= inside.max()
    assert np.nanmin(found.values) <= inside.min()
    assert set(found.values[np.isfinite(found.values)]) <= set(y)
    if found.exact:
        return
    edges = np.linspace(start, stop, pixels + 1)
    for k in range(1, pixels - 1):
        own = y[(t >= edges[k]) & (t < edges[k + 1])]
        low, high = found.values[0, 2 * k : 2 * k + 2]
        if len(own) > 1000:  # far more than a block
            assert high >= own[64:-64].max()
            assert low <= own[64:-64].min()
        elif 0 < len(own) <= 64:
            assert (low, high) == (own.min(), own.max())


def test_a_pause_is_a_gap_and_few_samples_are_all_there(store: Store) -> None:
    t = store.times("run")
    pause = reduced(store, "run", ["y"], t[119_000], t[121_000], 400)
    assert np.isnan(pause.values).sum() > 600
    few = reduced(store, "run", ["y"], t[500], t[600], 400)
    assert few.exact
    np.testing.assert_array_equal(few.t, t[499:601])
    at, (value,) = nearest(store, "run", ["y"], t[77_777] + 1e-5)
    assert (at, value) == (t[77_777], 99.0)
    with pytest.raises(KeyError):
        reduced(store, "run", ["../y"], 0, 1, 10)


# --- results on disk ------------------------------------------------------------------------------


def test_a_diagnosis_comes_back_from_the_disk_as_it_was(tmp_path: Path) -> None:
    d = diagnosis()
    keep.save(d, tmp_path, "diagnosis")
    back = keep.load(tmp_path, "diagnosis")
    assert back.figures() == d.figures()
    assert back.improved.toml() == d.improved.toml()
    assert back.before.figures() == (d.before and d.before.figures())
    assert d.after is not None
    np.testing.assert_array_equal(back.after["e"].simulated, d.after["e"].simulated)


def test_only_listed_kinds_are_kept_or_made(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="not a kind of result"):
        keep.save(object(), tmp_path, "x")
    keep.save({"a": float("nan"), "b": (1, None)}, tmp_path, "x")
    back = keep.load(tmp_path, "x")
    assert np.isnan(back["a"])
    assert back["b"] == (1, None)
    (tmp_path / "x.json").write_text('{"kind": "Popen", "fields": {"args": "id"}}')
    with pytest.raises(FileError, match="no result of the workbench"):
        keep.load(tmp_path, "x")


# --- the project ----------------------------------------------------------------------------------


def test_undo_and_redo_live_on_disk(tmp_path: Path) -> None:
    project = Project(tmp_path / "p")
    for name in ("one", "two"):
        with project.change(f"added {name}") as now:
            now["variants"].append(name)
    with pytest.raises(ZeroDivisionError), project.change("broken") as now:
        now["variants"].append(1 / 0)
    again = Project(tmp_path / "p")
    assert again.now["variants"] == ["one", "two"]
    assert again.undo() == "added two"
    assert Project(tmp_path / "p").now["variants"] == ["one"]
    assert again.redo() == "added two"
    assert again.undo() == "added two"
    assert again.undo() == "added one"
    with pytest.raises(FileError, match="nothing to undo"):
        again.undo()


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "project.json").write_text('{"schema": 9, "mine": true}')
    with pytest.raises(FileError, match="name another folder"):
        Project(tmp_path)
    assert "mine" in (tmp_path / "project.json").read_text()


def test_keys_are_those_of_their_inputs() -> None:
    assert key_of("a", {"x": 1, "y": [2]}) == key_of("a", {"y": [2], "x": 1})
    assert key_of("a", {"x": 1}) != key_of("a", {"x": 2}) != key_of("b", {"x": 2})


def test_models_are_held_against_recordings_as_the_diagnosis_judged(tmp_path: Path) -> None:
    """One measure on the page; undoing the diagnosis finds the results of before again."""
    story = Story(Project(tmp_path / "project"))
    step = {"id": "s1", "label": "nominal", "file": "models/m1.toml", "how": "given"}
    before = story.compare_key(step)
    with story.project.change("diagnosis") as now:
        now["steps"] = [step]
        now["diagnosis"] = {"job": 1, "step": "s1", "effort": "quick", "mode": "balance"}
    assert story.mode == "balance"
    assert story.compare_key(step) != before
    story.project.undo()
    assert story.compare_key(step) == before


def test_a_comparison_is_by_the_mode_that_is_asked_for(tmp_path: Path) -> None:
    fitting = records()[0].between(0, 4)
    by_itself = views.compared(sheet(), {"fit": fitting}, tmp_path / "loop")
    balance = views.compared(sheet(), {"fit": fitting}, tmp_path / "balance", "balance")
    assert (by_itself["mode"], balance["mode"]) == ("closed_loop", "balance")
    expected = compare(sheet(), fitting, "balance").error["headline"]
    assert balance["error"]["headline"] == pytest.approx(expected)


def test_what_was_read_stands_in_the_units_of_the_axis(tmp_path: Path) -> None:
    """A linear axis is read as a rotary one of 1 m radius, and nobody wants its degrees."""
    story = Story(Project(tmp_path / "project"))
    told = {"id": "t1", "name": "x", "path": "x.csv", "map": None, "role": "fit", "parts": None}
    channels = [
        {"name": "theta_m", "unit": "rad", "long_name": "angle of the table", "peak": 0.2},
        {"name": "T_1", "unit": "N*m", "long_name": "torque of motor 1", "peak": 9.0},
        {"name": "I_1", "unit": "A", "long_name": "current of motor 1", "peak": 1.0},
    ]
    result = {"ok": True, "job": 1, "records": {"x": {"channels": channels}}}
    story.project.results = {story.read_key(told): result, "preview:t1": result}
    story.project.now["traces"] = [told]
    for axis, train, units in (
        ("rotary", "gear", ["rad", "N*m", "A"]),
        ("linear", "rigid", ["m", "N", "A"]),
        ("linear", "gear", ["m", "N*m", "A"]),
    ):
        story.project.now["machine"] = {"axis": axis, "drive_train": train}
        [seen] = shown(story)["traces"]
        for found in (seen["records"], seen["preview"]["records"]):
            assert [c["unit"] for c in found["x"]["channels"]] == units
        words = seen["records"]["x"]["channels"][1]["long_name"]
        assert words == ("force of motor 1" if units[1] == "N" else "torque of motor 1")


def test_a_report_names_the_command_that_rebuilds_it(tmp_path: Path) -> None:
    """What was fitted, held out, how it was judged; a mapping of the page is in no file."""
    story = Story(Project(tmp_path / "project"))
    now = story.project.now
    now["traces"] = [
        {"path": f"traces/{role}/x y.csv", "map": None, "parts": None, "role": role}
        for role in ("fit", "held_out", "ignored")
    ]
    now["steps"] = [{"id": "s1", "file": "models/m1.toml"}, {"id": "s2", "file": "models/m2.toml"}]
    now["diagnosis"] = {"job": 1, "step": "s1", "effort": "quick", "mode": "balance"}
    command, then = story.commands()
    assert then == "python story.py"
    known = {option for p in report.params for option in p.opts}
    assert {word for word in shlex.split(command) if word.startswith("--")} <= known
    assert command == (
        "dualdrive report models/m1.toml 'traces/fit/x y.csv' --held-out 'traces/held_out/x y.csv' "
        "--effort quick --mode balance --output rebuilt.html"
    )
    now["traces"][0]["map"] = {"columns": {}}
    assert story.commands() == ["python story.py"]


def test_two_servers_do_not_share_a_project(tmp_path: Path) -> None:
    """Whoever starts a second one is told where the first is."""
    with running(tmp_path / "p") as server:
        command = [sys.executable, "-m", "dualdrive_cli", "workbench", "--no-browser"]
        done = subprocess.run(
            [*command, "--project", str(tmp_path / "p")],
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )
        assert done.returncode == 1
        assert f"a workbench shows it already, at {server.address}" in done.stderr


def test_the_command_line_brings_machine_and_recordings(tmp_path: Path) -> None:
    demo = ROOT / "python" / "dualdrive" / "demo"
    with running(tmp_path / "p", demo / "machine.toml", demo / "fit.csv") as server:
        wait_for(lambda: server.state["steps"][0:1] and server.state["ready"])
        state = server.state
        assert [t["name"] for t in state["traces"]] == ["fit"]
        assert state["machine"]["name"] == "demo-table"
        refused = server.do("add", label="coulomb@table")
        assert refused.json["refused"] == "there is no diagnosis yet; diagnose first"
        assert "machine.save" in server.ask("GET", "file/story.py").text
    assert not (tmp_path / "p" / ".session").exists()
    assert json.loads((tmp_path / "p" / "project.json").read_text())["now"]["steps"]


def test_the_script_of_an_empty_project_runs() -> None:
    compile(script({"traces": [], "steps": [], "diagnosis": None}), "story.py", "exec")


# --- what the page shows of a comparison ----------------------------------------------------------


def test_failing_stretches_are_those_of_their_condition() -> None:
    machine, (fitting, _) = sheet(), records()
    found = evaluate(machine, fitting)
    c = compare(machine, fitting)
    stretches = failing_stretches(c, situations_of(c, found, {"fit": fitting}))
    window = next(s for s in stretches if s.condition == "4.5 .. 6 s")
    np.testing.assert_allclose(window.intervals, [[4.5, 5.99]])
    backward = next(s for s in stretches if s.condition == "backward")
    inside = np.zeros(len(fitting.t), bool)
    for start, stop in backward.intervals:
        inside |= (fitting.t >= start) & (fitting.t <= stop)
    speed = np.gradient(fitting["theta_ref"], fitting.t)
    assert np.all(speed[inside] < 0)
    told = next(w for w in c.where if w.condition == "backward")
    assert inside.mean() == pytest.approx(told.time)
    assert [s.sure for s in stretches] == sorted([s.sure for s in stretches], reverse=True)


def test_correlations_of_closed_forms() -> None:
    """White noise stays in the band; a first-order memory decays as its pole; a delay shows."""
    random = np.random.default_rng(5)
    n, dt, delay = 20_000, 1e-2, 7
    t = np.linspace(0.0, dt * (n - 1), n)
    u, white = random.standard_normal(n), random.standard_normal(n)
    none = residual_correlations("r", "e", t, white, u)
    assert np.mean(np.abs(none.auto[1:]) > none.auto_band) < 0.05
    assert np.mean(np.abs(none.cross) > none.cross_band) < 0.05
    coloured = np.zeros(n)
    for k in range(1, n):
        coloured[k] = 0.8 * coloured[k - 1] + white[k]
    memory = residual_correlations("r", "e", t, coloured, u)
    np.testing.assert_allclose(memory.auto[:6], 0.8 ** np.arange(6), atol=0.04)
    late = residual_correlations("r", "e", t, np.roll(u, delay) + white, u)
    assert late.cross_lags[np.argmax(late.cross)] == pytest.approx(delay * dt)
    assert late.cross.max() == pytest.approx(np.sqrt(0.5), abs=0.03)


# --- what is vendored -----------------------------------------------------------------------------


def test_vendored_files_are_those_of_the_list() -> None:
    subprocess.run([sys.executable, ROOT / "tools" / "vendor.py"], check=True)

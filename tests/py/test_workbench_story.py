"""The whole story in a real browser: demo, EMPS, dual-motor rig. Minutes, so behind SHOWN=1.

    SHOWN=1 SCREENSHOTS=docs/workbench pytest tests/py/test_workbench_story.py

writes the pictures of docs/howto/workbench.md anew.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from dualdrive.machine import Machine
from measured import measured_file
from workbench_page import Seen, chromium, needs_chromium
from workbench_server import Running, running, wait_for

ROOT = Path(__file__).resolve().parents[2]
PICTURES = os.environ.get("SCREENSHOTS")

pytestmark = [
    needs_chromium,
    pytest.mark.skipif("SHOWN" not in os.environ, reason="minutes of a core of its own: SHOWN=1"),
]


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    with chromium() as found:
        yield found


def shoot(seen: Seen, name: str) -> None:
    """A picture for the docs, where one is asked for."""
    if PICTURES:
        folder = ROOT / PICTURES
        folder.mkdir(parents=True, exist_ok=True)
        seen.page.wait_for_timeout(700)
        seen.page.screenshot(path=folder / f"{name}.png")


@pytest.fixture(scope="module")
def told(
    browser: object, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[Seen, Running]]:
    """The demo, compared."""
    project = tmp_path_factory.mktemp("story") / "table-7"
    warm = browser.new_page()  # type: ignore[attr-defined]
    with running(project) as server:
        seen = Seen(browser, server.address)  # type: ignore[arg-type]
        seen.click("#demo")
        seen.wait("#panels[data-drawn]")
        seen.wait("#ladder td.number", "%")
        yield seen, server
        assert seen.complaints == []
    warm.close()


def test_the_demo_from_first_look_to_report(
    told: tuple[Seen, Running], browser: object, tmp_path: Path
) -> None:
    seen, server = told
    seen.click("#shade-0")
    seen.click("#shade-2")
    seen.page.locator(".panel").first.focus()
    for key in ("Home", "ArrowRight", "ArrowRight"):
        seen.page.keyboard.press(key)
    shoot(seen, "compared")
    seen.page.keyboard.press("Escape")
    seen.page.select_option("#effort", "quick")
    seen.click("#diagnose")
    seen.wait(".job .what", "refitting")
    seen.wait(".job .what", re.compile(r"refitting .* of \d+\).* best so far .*, gain \d"))
    shoot(seen, "diagnosing")
    seen.wait(".job .what", "best so far coulomb@table, probability")
    seen.wait("article.candidate.named h3", "coulomb@table")
    shoot(seen, "diagnosed")
    assert "Coulomb friction of 12 kN·m at the table is missing from the model: " in seen.text(
        "#sentence"
    )
    assert "with it the error falls from 19.2 % to 1.7" in seen.text("#sentence")
    seen.click("#add-0")
    seen.wait(".job .what", "refitting with coulomb@table: simulation")
    seen.cancel()
    assert seen.page.locator("#ladder tbody tr").count() == 1
    seen.click("#add-0")
    seen.wait("#ladder tbody tr:nth-child(3) td.number", "%")
    seen.wait("#ladder tbody tr:nth-child(2) td.number", "%")
    assert [seen.share(k) for k in range(3)] == pytest.approx([22.0, 19.2, 1.76], rel=0.02)
    assert [seen.share(k, 3) for k in range(3)] == pytest.approx([20.7, 17.6, 1.63], rel=0.03)
    assert "nothing left to find" in seen.text("#sentence")
    shoot(seen, "added")
    seen.click("#undo")
    seen.wait_gone("#ladder tbody tr:nth-child(2)")
    seen.click("#redo")
    seen.wait("#ladder tbody tr:nth-child(3) td.number", "1.76 %")
    other_faces(seen)
    saved_files(seen, server, browser, tmp_path)


def other_faces(seen: Seen) -> None:
    """Dark, projector, phone: no sideways scrolling, nothing serious for axe-core."""
    wide = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
    seen.click("#theme")
    shoot(seen, "dark")
    assert seen.faults() == []
    seen.click("#theme")
    for name, width, height in (("projector", 1920, 1080), ("phone", 390, 844)):
        seen.page.set_viewport_size({"width": width, "height": height})
        seen.page.wait_for_timeout(400)
        assert seen.page.evaluate(wide) <= 0
        assert seen.faults() == []
        shoot(seen, name)
    seen.page.set_viewport_size({"width": 1280, "height": 900})


def saved_files(seen: Seen, server: Running, browser: object, tmp_path: Path) -> None:
    """Machine, script and report: the script makes the same machine, the report opens alone."""
    machine = Machine.load(seen.saved("[id='save-machine.toml']", tmp_path / "machine.toml"))
    assert machine.effects == ["mesh_damping@meshes", "coulomb@table"]
    assert machine.get("coulomb@table.torque") == pytest.approx(12e3, rel=0.01)
    (server.project / "story.py").write_bytes(
        seen.saved("[id='save-story.py']", tmp_path / "story.py").read_bytes()
    )
    subprocess.run([sys.executable, server.project / "story.py"], check=True, capture_output=True)
    assert "coulomb@table" in (server.project / "rebuilt.html").read_text("utf-8")
    rebuilt = Machine.load(server.project / "rebuilt.toml")
    assert {p.path: p.value for p in rebuilt.parameters()} == {
        p.path: p.value for p in machine.parameters()
    }
    seen.click("#report")
    seen.wait(".message.done", "report.html")
    report = Seen(browser, (server.project / "report.html").as_uri())  # type: ignore[arg-type]
    report.wait(".chart-live canvas")
    assert "coulomb@table" in report.text("header")
    assert report.faults() == []
    shoot(report, "report")
    report.page.locator(".chart-live").first.scroll_into_view_if_needed()
    report.page.locator(".moving").first.hover()
    report.page.locator(".moving button").first.click()
    shoot(report, "report-plots")
    assert report.complaints == []
    report.page.close()


def column(seen: Seen, name: str, **values: str) -> None:
    """Fill a line of the mapping."""
    row = seen.page.locator(f"tr[data-column='{name}']")
    places = {"channel": 0, "unit": 1, "scale": 2, "radius": 3}
    for key, value in values.items():
        if key == "sign":
            row.locator("select").select_option(value)
        else:
            row.locator("input").nth(places[key]).fill(value)
            row.locator("input").nth(places[key]).press("Tab")


@contextmanager
def mapping(
    browser: object, recording: Path, machine: str, project: Path
) -> Iterator[tuple[Seen, Running]]:
    """A project with a machine of the examples and a recording whose columns are being mapped."""
    with running(project) as server:
        seen = Seen(browser, server.address)  # type: ignore[arg-type]
        seen.upload(recording, ROOT / "examples" / machine)
        seen.wait("article.recording[data-status=unread]")
        seen.click("article.recording button:has-text('Map its columns')")
        yield seen, server
        assert seen.complaints == []


def diagnose_and_add(seen: Seen, name: str) -> tuple[float, float]:
    """The errors, in per cent, of the data sheet and with the first candidate in.

    The sentence and the ladder count in one measure, whichever the diagnosis judged by.
    """
    seen.wait("#ladder td.number", "%")
    seen.page.select_option("#effort", "quick")
    seen.click("#diagnose")
    seen.wait("article.candidate")
    sentence = seen.text("#sentence")
    seen.click("article.candidate .add")
    for rung in (3, 2, 1):
        seen.wait(f"#ladder tbody tr:nth-child({rung}) td.number", "%")
    shares = [seen.share(k) for k in range(3)]
    print(name, shares, sentence, seen.text("article.candidate h3"))
    told = re.search(r"falls from ([\d.]+) %|([\d.]+) % of error", sentence)
    assert told is not None
    assert float(told[1] or told[2]) == pytest.approx(shares[1], rel=0.03)
    shoot(seen, f"{name}-added")
    return shares[0], shares[2]


def test_emps_mapped_in_the_page(browser: object, tmp_path: Path) -> None:
    recording = measured_file("emps/DATA_EMPS.mat")
    with mapping(browser, recording, "emps.toml", tmp_path / "emps") as (seen, _):
        seen.wait("#preview-said", "24,841 samples")
        seen.wait("dialog .warning", "a unit or the frame of the torques is wrong")
        for name in ("qg", "qm"):
            column(seen, name, unit="m", radius="1 m")
        column(seen, "vir", unit="N", scale="35.15065188248547", radius="1 m")
        seen.wait_gone("dialog .warning")
        seen.wait("#preview-said", "24,841 samples")  # with the last change in it
        seen.wait("dialog .panel canvas")
        shoot(seen, "mapping")
        seen.click("#map-go")
        first, added = diagnose_and_add(seen, "emps")
        assert added < 0.7 * first


RIG = {
    "SpeedRef": {"channel": "omega_ref", "unit": "rad/s"},
    "ENC1Speed": {"channel": "omega_m", "unit": "rad/s"},
    "ENC1Position": {"channel": "theta_m", "unit": "deg", "sign": "-1"},
    "FC1Speed": {"channel": "omega_c1", "unit": "rad/s"},
    "FC1Position": {"channel": "theta_c1", "unit": "deg", "sign": "-1"},
    "FC1Torque": {"channel": "T_1", "unit": "N*m"},
    "FC2Speed": {"channel": "omega_c2", "unit": "rad/s"},
    "FC2Position": {"channel": "theta_c2", "unit": "deg", "sign": "-1"},
    "FC2Torque": {"channel": "T_2", "unit": "N*m", "sign": "-1"},
    "FC3Position": {"channel": "brake_angle", "unit": "deg", "sign": "-1"},
    "FC3Torque": {"channel": "brake_torque", "unit": "N*m"},
}


def test_the_dual_motor_rig_mapped_in_the_page(browser: object, tmp_path: Path) -> None:
    recording = measured_file("dual_motor_rig/log12.csv")
    with mapping(browser, recording, "dual_motor_rig.toml", tmp_path / "rig") as (seen, server):
        seen.wait("#map-go")
        for name, values in RIG.items():
            column(seen, name, **values)
        seen.click("#map-rows summary")
        seen.page.fill("#rows-keep", "Running == 1")
        seen.page.fill("#rows-drop", "TestIndex == 0")
        seen.page.fill("#split-by", "TestIndex; AntiBacklashEnabled; BaseTorque; LoadTorque")
        seen.page.fill("#split-least", "5 s")
        seen.click("#map-preview")
        seen.wait("#preview-said", "parts")
        seen.click("#map-go")
        seen.wait("article.recording[data-status=ready]")
        wait_for(lambda: server.state["ready"])
        parts = list(server.state["traces"][0]["records"])
        print(len(parts), "parts")
        server.do("parts", trace=server.state["traces"][0]["id"], parts=parts[:2])
        first, added = diagnose_and_add(seen, "rig")
        assert added < first

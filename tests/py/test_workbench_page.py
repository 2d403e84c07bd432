"""The page in a real browser; the whole story, which takes longer, is test_workbench_story.py."""

from __future__ import annotations

import csv
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from dualdrive import traces
from recorded import DEMO
from workbench_page import Seen, chromium, needs_chromium
from workbench_server import Running

pytestmark = needs_chromium
#: what is drawn on top of the first panel, at a share of its width
PIXEL = """(share) => {
  const panel = document.querySelector(".panel"), ratio = devicePixelRatio;
  const over = panel.querySelector(".u-over"), x = over.offsetLeft + share * over.clientWidth;
  const drawn = panel.querySelector("canvas").getContext("2d");
  return [...drawn.getImageData(x * ratio, (over.offsetTop + 2) * ratio, 1, 1).data].slice(0, 3);
}"""


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[Running]]:
    """The one that runs now, which a test may replace."""
    held = [Running(tmp_path_factory.mktemp("page") / "project")]
    yield held
    held[0].end()


@pytest.fixture(scope="module")
def seen(browser: object, server: list[Running]) -> Iterator[Seen]:
    found = Seen(browser, server[0].address)  # type: ignore[arg-type]
    found.wait("#demo")
    found.click("#demo")
    found.wait("#ladder td.number", "%")
    found.wait("#panels[data-drawn]")
    yield found
    assert found.complaints == []


def test_the_first_sentence_says_how_far_off_the_model_is(seen: Seen) -> None:
    assert "misses what was recorded by 22.0 %" in seen.text("#sentence")
    assert "1.78 %" in seen.text("#sentence")
    assert seen.share(0) == pytest.approx(22.0)
    assert seen.share(0, 3) == pytest.approx(20.7)


def test_panels_stand_in_engineering_units_over_one_time_axis(seen: Seen) -> None:
    heads = seen.page.locator(".panel figcaption strong").all_inner_texts()
    assert heads[0] == "following error [arcsec]"
    assert "current I_1 [A]" in heads
    assert heads[-1] == "flanks, nominal"
    keys = seen.page.locator(".panel").first.locator(".key").all_inner_texts()
    assert keys == ["measured", "nominal"]


def test_the_keyboard_moves_cursors_that_read_values_aloud(seen: Seen) -> None:
    panel = seen.page.locator(".panel").first
    panel.focus()
    panel.press("Home")
    panel.press("ArrowRight")
    seen.wait("#readout th", "following error, measured")
    panel.press("ArrowRight")
    panel.press("Alt+ArrowRight")
    seen.wait("#readout td", "−0.18000")
    cells = seen.page.locator("#readout tbody tr").first.locator("td").all_inner_texts()
    assert cells[:3] == ["0.36000", "0.18000", "−0.18000"]
    assert "following error, measured" in seen.text("#spoken")
    panel.press("Escape")
    seen.wait("#readout", "Click a plot")


def test_zoom_and_pan_move_all_panels_together(seen: Seen) -> None:
    drawn = "document.querySelector('#panels').dataset.drawn"
    seen.page.locator(".panel").first.press("+")
    seen.page.locator(".panel").first.press("Shift+ArrowRight")
    seen.page.wait_for_timeout(300)
    start, stop = map(float, seen.page.evaluate(drawn).split())
    assert stop - start == pytest.approx(0.7 * 18)
    assert start == pytest.approx(0.15 * 18 + 0.07 * 18)
    seen.click("#zoom-all")


def test_a_condition_is_shaded_and_effects_are_switched_off_for_a_look(seen: Seen) -> None:
    seen.click("#shade-0")
    assert seen.page.locator("#shade-0").is_checked()
    seen.click('[id="effect-mesh_damping@meshes"]')
    seen.wait(".panel .key", "without mesh_damping@meshes")
    seen.click("#undo")
    seen.wait_gone(".panel .key:has-text('without')")


def test_every_cause_is_shaded_in_a_look_of_its_own(seen: Seen) -> None:
    """Two ticked conditions: two swatches, and two colours in the plot where they hold alone."""
    ticked = seen.page.locator("table.where input:checked")
    while ticked.count():
        ticked.first.click()
        seen.page.wait_for_timeout(200)
    rows, colours = seen.page.locator("table.where tbody tr"), []
    for name, at in (("4.5 .. 6 s", 5.25), ("15 .. 16.5 s", 15.75)):
        rows.filter(has_text=name).locator("input").click()
        seen.page.wait_for_timeout(200)
        colours.append(seen.page.evaluate(PIXEL, at / 18.0))
    looks = {s.get_attribute("class") for s in seen.page.locator("table.where .swatch").all()}
    assert looks == {"swatch cause-0", "swatch cause-1"}
    assert colours[0] != colours[1]
    assert [255, 255, 255] not in colours


def test_plots_are_taken_away_as_table_and_picture(seen: Seen, tmp_path: Path) -> None:
    seen.click("#copy-png")
    seen.wait(".message", "The picture is")
    script = seen.saved("[id='save-story.py']", tmp_path / "story.py").read_text()
    compile(script, "story.py", "exec")
    assert "schema = 1" in seen.saved("[id='save-machine.toml']", tmp_path / "m.toml").read_text()


def test_what_plots_show_is_one_table_with_a_unit_over_every_column(
    seen: Seen, tmp_path: Path
) -> None:
    """The samples of the record themselves, of the stretch that is shown, to twelve digits."""
    seen.page.locator(".panel").first.focus()
    for _ in range(12):
        seen.page.keyboard.press("+")
    seen.page.wait_for_timeout(400)
    path = seen.saved("#save-csv", tmp_path / "plots.csv")
    seen.click("#zoom-all")
    with path.open(encoding="utf-8", newline="") as file:
        heads, *rows = csv.reader(file)
    assert heads[:3] == ["t [s]", "following error, measured [arcsec]",
                         "following error, nominal [arcsec]"]  # fmt: skip
    assert all(h.endswith("]") or "-1 back, 0 gap, 1 front" in h for h in heads), heads
    assert {len(row) for row in rows} == {len(heads)}
    fit = traces.read(DEMO / "fit.csv")
    inside = slice(*np.searchsorted(fit.t, [float(rows[0][0]) - 1e-9, float(rows[-1][0]) + 1e-9]))
    for name, unit in (("I_1", 1.0), ("I_2", 1.0)):
        written = [float(row[heads.index(f"current {name}, measured [A]")]) for row in rows]
        np.testing.assert_allclose(written, fit[name][inside] / unit, rtol=1e-11)


#: the table of one panel of two samples
TABLE = """async ([title, exact]) => (await import("dd/save.js")).csv({
  timeline: {range: [0, 1]},
  panels: [{data: [[0, 1], [2, NaN]], exact, rung: {unit: "A"},
            spec: {title, series: [{label: "x"}]}}],
})"""


def test_a_table_of_fewer_pixels_than_samples_says_so(seen: Seen) -> None:
    assert seen.page.evaluate(TABLE, ["current", False]).splitlines() == [
        "# least and greatest value of every pixel; zoom in for every sample",
        '"t [s]","current, x [A]"',
        "0,2",
        "1,",
    ]


@pytest.mark.parametrize("title", ['=HYPERLINK("http://a","b")', "+1+1", "@SUM(A1)", "-2", "\t=1"])
def test_no_name_of_a_recording_becomes_a_formula(seen: Seen, title: str) -> None:
    """A spreadsheet computes what begins so, quoted or not."""
    [heads, *rows] = csv.reader(seen.page.evaluate(TABLE, [title, True]).splitlines())
    assert heads == ["t [s]", f"'{title}, x [A]"]
    assert rows == [["0", "2"], ["1", ""]]


def test_a_panel_of_ones_own_shifts_one_series_against_another(seen: Seen) -> None:
    seen.click("#own")
    rows = seen.page.locator("dialog tr")
    for label, shift in (("fit: I_1", "0"), ("held_out: I_1", "0.5")):
        row = rows.filter(has_text=label).first
        row.locator("input[type=checkbox]").check()
        row.locator("input[type=number]").fill(shift)
    seen.click("#own-go")
    seen.wait(".panel .key", "held_out: I_1 (+0.5 s)")
    drawn = seen.page.locator(".panel").last.locator("canvas")
    assert drawn.count() == 1
    seen.click("#own")
    seen.click("#own-none")
    seen.wait_gone(".panel .key:has-text('+0.5 s')")


def test_two_tabs_tell_the_same(seen: Seen, browser: object, server: list[Running]) -> None:
    other = Seen(browser, server[0].address)  # type: ignore[arg-type]
    other.wait("#ladder td.number", "22.0 %")
    other.page.locator("select[aria-label='Role of held_out']").select_option("ignored")
    seen.wait("#ladder td.number:nth-child(4)", "–")
    other.click("#undo")
    seen.wait("#ladder td.number:nth-child(4)", "20.7 %")
    other.page.close()


def test_a_diagnosis_tells_of_its_progress_and_is_cancelled(seen: Seen) -> None:
    seen.page.select_option("#effort", "quick")
    seen.click("#diagnose")
    seen.wait(".job .what", "s")
    seen.wait(".job .what", "refitting")
    for part in (".job .cancel", "#climb", "article.recording select", "#shade-0"):
        seen.page.locator(part).first.evaluate("element => { element.kept = true; }")
    told = seen.text(".job .what")
    seen.page.wait_for_function(
        "told => document.querySelector('.what').innerText !== told", arg=told
    )
    for part in (".job .cancel", "#climb", "article.recording select", "#shade-0"):
        assert seen.page.locator(part).first.evaluate("element => element.kept"), part
    seen.cancel()


def test_a_reload_and_a_killed_server_lose_nothing(
    seen: Seen, server: list[Running], browser: object
) -> None:
    """The fit under way goes on without its server; the tab finds the next one by itself."""
    seen.click("#diagnose")
    seen.wait(".job .what", "s")
    seen.page.reload()
    seen.wait(".job", "Diagnosing")
    old = server[0]
    with seen.server_gone():
        old.end(signal.SIGKILL)
        seen.wait("body.offline")
        server[0] = Running(old.project)
        assert server[0].address == old.address
        seen.wait("body:not(.offline)")
    seen.wait(".job .what", "of")
    assert seen.share(0) == pytest.approx(22.0)
    seen.click(".job .cancel")
    seen.wait_gone(".job")


def test_axe_finds_nothing_serious(seen: Seen) -> None:
    for summary in seen.page.locator("#results summary, #inputs summary").all():
        summary.evaluate("summary => { summary.parentElement.open = true; }")
    assert seen.faults() == []
    seen.click("#theme")
    assert seen.faults() == []
    seen.click("#theme")
    seen.click("#help")
    assert seen.faults() == []
    seen.page.keyboard.press("Escape")


def test_axe_finds_nothing_serious_in_the_mapping_of_a_foreign_file(
    seen: Seen, tmp_path: Path
) -> None:
    """The dialog with a proposal, with a contradiction, with its folded part open; dark too."""
    foreign = tmp_path / "axis 3.csv"
    t = np.arange(400) * 1e-2
    columns = np.column_stack([t, np.sin(t), np.cos(t), 3.0 * np.cos(t)])
    head = "Zeit;Pos_ist [deg];Geschw;Strom links [A]"
    lines = [head, *(";".join(f"{x:.5f}".replace(".", ",") for x in row) for row in columns)]
    foreign.write_text("\n".join(lines), "utf-8")
    seen.upload(foreign)
    seen.wait("article[data-trace='axis 3'][data-status=unread]")
    seen.click("article[data-trace='axis 3'] button:has-text('Map its columns')")
    seen.wait("tr[data-column='Pos_ist']")
    assert seen.faults() == []
    row = seen.page.locator("tr[data-column='Pos_ist'] input")
    row.nth(0).fill("theta_m")
    row.nth(1).fill("A")
    row.nth(1).press("Tab")
    seen.wait("#preview-said", "A does not measure rad")
    seen.click("#map-rows summary")
    assert seen.faults() == []
    seen.page.evaluate("document.documentElement.dataset.theme = 'dark'")
    assert seen.faults() == []
    seen.page.evaluate("document.documentElement.dataset.theme = 'light'")
    row.nth(1).fill("deg")
    row.nth(1).press("Tab")
    seen.wait("#preview-said", "400 samples")
    seen.wait("dialog .panel canvas")
    assert seen.faults() == []
    seen.page.set_viewport_size({"width": 390, "height": 844})
    line = seen.page.locator("tr[data-column='Geschw']").bounding_box()
    assert line is not None
    assert line["height"] < 120, "reasons keep the width of words on a phone"
    assert seen.faults() == []
    seen.page.set_viewport_size({"width": 1280, "height": 900})
    named = seen.page.evaluate("document.activeElement.closest('dialog') !== null")
    assert named, "the keyboard is in the dialog"
    seen.page.keyboard.press("Escape")
    seen.wait_gone("dialog[open]")
    seen.click("#undo")
    seen.wait_gone("article[data-trace='axis 3']")


def test_a_mapping_made_in_the_page_is_taken_away(seen: Seen, tmp_path: Path) -> None:
    """Beside its recording the file does the same for every other verb."""
    t = np.arange(400) * 1e-2
    lines = ["Zeit;Pos_ist", *(f"{a:.3f};{b:.5f}" for a, b in zip(t, np.sin(t), strict=True))]
    (tmp_path / "Achse ä.csv").write_text("\n".join(lines), "utf-8")
    seen.upload(tmp_path / "Achse ä.csv")
    seen.click("article[data-trace='Achse ä'] button:has-text('Map its columns')")
    row = seen.page.locator("tr[data-column='Pos_ist'] input")
    for k, text in enumerate(("theta_m", "deg")):
        row.nth(k).fill(text)
        row.nth(k).press("Tab")
    seen.page.locator("#map-rows").evaluate("rows => { rows.open = true; }")
    seen.page.fill("#time-column", "Zeit")
    seen.page.fill("#time-unit", "s")
    seen.wait("#preview-said", "400 samples")
    seen.click("#map-go")
    seen.wait("article[data-trace='Achse ä'][data-status=ready]")
    seen.saved("[data-file='Achse ä.map.toml']", tmp_path / "Achse ä.map.toml")
    read = traces.read(tmp_path / "Achse ä.csv")
    np.testing.assert_allclose(read["theta_m"], np.radians(np.sin(t)), atol=1e-6)
    for _ in range(2):
        seen.click("#undo")
        seen.page.wait_for_timeout(300)
    seen.wait_gone("article[data-trace='Achse ä']")


def test_nothing_is_left_running(seen: Seen, server: list[Running]) -> None:
    """Of what this file started: the next test's server is its own."""
    seen.page.close()
    server[0].end()
    with pytest.raises(ProcessLookupError):
        os.kill(server[0].process.pid, 0)

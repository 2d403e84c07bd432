"""How fast the workbench answers: zoom and pan in Chromium, memory of the server, a long trace.

    python benchmarks/workbench.py                 ten channels of a million samples
    python benchmarks/workbench.py --samples 1e7   one longer trace, of two channels
    python benchmarks/workbench.py --start         from the command to the demo's first picture

Needs Chromium and Playwright's Python client; prints milliseconds from the key to the picture.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "py"))

from dualdrive.traces import Trace
from workbench_page import chromium
from workbench_server import Running

#: one move of the time axis, and the time until the panels show what the server has of it, ms
MOVE = """async (key) => {
  const panels = document.querySelector('#panels');
  const begun = performance.now();
  await new Promise((done) => {
    const seen = () => requestAnimationFrame(() => setTimeout(done, 0));
    panels.addEventListener('drawn', seen, {once: true});
    const press = new KeyboardEvent('keydown', {...key, bubbles: true});
    document.querySelector('.panel').dispatchEvent(press);
  });
  return performance.now() - begun;
}"""
#: what is waited for in the page itself: from outside a look is taken every half second only
WHEN = "async () => {{ while (!({})) await new Promise(requestAnimationFrame); }}"
DRAWN = "document.querySelector('#panels').dataset.drawn"
COMPARED = "document.querySelector('#ladder td.number')?.textContent.includes('%')"
PAN = [{"key": "ArrowRight", "shiftKey": True}, {"key": "ArrowLeft", "shiftKey": True}]
ZOOM = [{"key": "+"}] * 6 + [{"key": "-"}] * 6


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("--samples", type=float, default=1e6)
    options.add_argument("--channels", type=int, default=0, help="ten, or two of a long trace")
    options.add_argument("--start", action="store_true", help="the time to the first picture")
    given = options.parse_args()
    if given.start:
        started()
        return
    samples = int(given.samples)
    channels = given.channels or (10 if samples <= 2_000_000 else 2)
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        path = Path(folder) / "long.h5"
        recorded(samples, channels).to_hdf5(path)
        print(f"{channels} channels of {samples} samples, {path.stat().st_size / 1e6:.0f} MB")
        server = Running(Path(folder) / "project")
        try:
            page = browser.new_page(viewport={"width": 1280, "height": 1400})
            page.goto(server.address)
            begun = time.monotonic()
            page.set_input_files("#files", path)
            page.locator(".panel canvas").first.wait_for(timeout=300_000)
            page.locator("#panels[data-drawn]").wait_for(timeout=60_000)
            print(f"from the drop to the picture: {time.monotonic() - begun:.1f} s")
            drawn = page.locator(".panel").count()
            print(f"panels: {drawn}, series: {page.locator('.panel .key').count()}")
            for what, keys in (("pan", [*PAN, *PAN] * 5), ("zoom", ZOOM * 2)):
                if what == "pan":
                    page.evaluate(MOVE, {"key": "+"})
                took = [page.evaluate(MOVE, key) for key in keys]
                middle, most = np.quantile(took, [0.5, 0.95])
                print(f"{what}: median {middle:.0f} ms, 95 % {most:.0f} ms, {len(took)} moves")
            print(f"memory of the server: {memory(server.process.pid):.0f} MB")
            page.close()
        finally:
            server.end()


def started(times: int = 5) -> None:
    """From the command to the first picture of the demo, and the processor time that it took.

    Other work on the computer stretches the seconds; the processor time it hardly touches.
    """
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        for run in range(times):
            page = browser.new_page(viewport={"width": 1280, "height": 900})
            begun, told = time.monotonic(), []
            server = Running(Path(folder) / f"project-{run}")
            told.append(("answers", time.monotonic() - begun))
            try:
                page.goto(server.address)
                page.locator("#demo").click()
                told.append(("demo clicked", time.monotonic() - begun))
                page.evaluate(WHEN.format(DRAWN))
                told.append(("first picture", time.monotonic() - begun))
                spent = processor_time(server.process.pid)
                page.evaluate(WHEN.format(COMPARED))
                told.append(("compared", time.monotonic() - begun))
                page.close()
            finally:
                server.end()
            words = ", ".join(f"{what} {seconds:.2f} s" for what, seconds in told)
            print(f"{words}; processor time to the picture: {spent}")


def processor_time(pid: int) -> str:
    """Of a process and those that it began, each by itself, s."""
    ticks = os.sysconf("SC_CLK_TCK")
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, _, rest = stat.read_text().rpartition(")")
        except OSError:
            continue
        number, told = int(name.split()[0]), rest.split()
        if number == pid or int(told[1]) == pid:
            who = "server" if number == pid else "worker"
            found.append(f"{who} {sum(map(int, told[11:15])) / ticks:.2f} s")
    return ", ".join(found)


def recorded(samples: int, channels: int) -> Trace:
    """A trace with noise, so that every pixel has something to reduce."""
    random = np.random.default_rng(19)
    t = np.arange(samples) * 1e-3
    names = [f"{q}_{n}" for q in ("theta", "omega", "I", "U", "T") for n in (1, 2)]
    values = {
        name: 10.0**k * (np.sin(2e-4 * (k + 1) * t) + 0.1 * random.standard_normal(samples))
        for k, name in enumerate(names[:channels])
    }
    return Trace(t=t, channels=values, name="long")


def memory(pid: int) -> float:
    """Most memory that a process has had resident of its own, files it maps left out, MB."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    told = {x.partition(":")[0]: int(x.split()[1]) for x in lines if x.endswith("kB")}
    print(f"  most resident, mapped files included: {told['VmHWM'] / 1024:.0f} MB")
    return told["RssAnon"] / 1024


if __name__ == "__main__":
    main()

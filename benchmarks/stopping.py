"""How soon Ctrl-C and --budget end what is computed, by the clock on the wall.

    python benchmarks/stopping.py                seven presses of each kind, two budgets
    python benchmarks/stopping.py --presses 20

Prints seconds: the median and the longest of the presses, and by how much a budget was overrun.
"""

from __future__ import annotations

import argparse
import json
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import dualdrive
from report import table

DEMO = Path(dualdrive.__file__).parent / "demo"
BUDGET = 5.0  # s
DUALDRIVE = (sys.executable, "-m", "dualdrive_cli")

#: says when it has begun, and goes on for weeks
LIBRARY = """
import dualdrive
machine, motion = dualdrive.Machine.load(), dualdrive.parse_motion("sine:1mrad,f=1,end=1e6")
print("begun", flush=True)
try:
    dualdrive.simulate(machine, motion, output_step=10.0)
except KeyboardInterrupt:
    pass
"""
ENDLESS = ("simulate", "--motion", "sine:1mrad,f=1,end=1e6", "--output-step", "10s", "-o", "run.h5")
SEARCH = ("diagnose", str(DEMO / "machine.toml"), str(DEMO / "fit.csv"))

#: what is stopped; how long after its start, s, from its first word on or else from its process'
PRESSES = {
    "a simulation, from Python": ((sys.executable, "-c", LIBRARY), 0.5),
    "dualdrive simulate": ((*DUALDRIVE, *ENDLESS), 5.0),
    "dualdrive diagnose, closed loop": ((*DUALDRIVE, *SEARCH), 6.0),
    "dualdrive diagnose, torque balance": ((*DUALDRIVE, *SEARCH, "--mode", "balance"), 8.0),
}


def main() -> None:
    """Measure and print both tables."""
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("--presses", type=int, default=7)
    presses = options.parse_args().presses
    with tempfile.TemporaryDirectory() as folder:
        rows = []
        for name, (command, wait) in PRESSES.items():
            took = [pressed(command, wait, folder) for _ in range(presses)]
            rows.append((name, f"{statistics.median(took):.2f}", f"{max(took):.2f}"))
        print(table(("Ctrl-C in", "median s", "longest s"), rows), end="\n\n")
        print(table((f"--budget {BUDGET:g}", "ended after s", "overrun s"), overruns(folder)))


def pressed(command: Sequence[str], wait: float, folder: str) -> float:
    """Seconds from Ctrl-C to the end of the process."""
    process = subprocess.Popen(
        command,
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        preexec_fn=_hearing,
    )
    assert process.stdout is not None
    if command[1] == "-c":
        process.stdout.readline()
    time.sleep(wait)
    assert process.poll() is None, f"through before Ctrl-C: {' '.join(command)}"
    begun = time.monotonic()
    process.send_signal(signal.SIGINT)
    process.communicate()
    return time.monotonic() - begun


def overruns(folder: str) -> Iterator[tuple[str, str, str]]:
    """What a search that is cut takes beyond its budget, as it says itself."""
    for mode in ("closed_loop", "balance"):
        command = [*DUALDRIVE, *SEARCH, "--mode", mode, "--budget", f"{BUDGET:g}", "--json", "-"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        took = float(json.loads(done.stdout)["seconds"])
        yield f"dualdrive diagnose --mode {mode}", f"{took:.2f}", f"{took - BUDGET:.2f}"


def _hearing() -> None:
    """A shell lets what it puts into the background ignore Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


if __name__ == "__main__":
    main()

"""The case in dualdrive, engine by engine; and its presets.

    python benchmarks/ours.py exact RTOL SECONDS FILE

runs one engine as measure.Program says: inner loops are chosen when a process starts, so that those
of another processor need a process of their own.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import case
import core_machines
from case import Array
from dualdrive import Machine, _core, default_motion, presets, simulate
from measure import RTOLS, Engine, Program

NATIVE = "dualdrive exact"
BASELINE = f"{NATIVE}, baseline"
EXPLICIT, ADAMS, BDF = "dualdrive explicit", "dualdrive cvode Adams", "dualdrive cvode BDF"
NO_RTOL = (float("nan"),)
PARAMETERS = [
    *(f"{part}.{name}" for part in ("pinion_1", "pinion_2", "table") for name in ("J", "b")),
    *(f"mesh_{n}.{name}" for n in (1, 2) for name in ("stiffness", "gap")),
    *(f"motor_{n}.{name}" for n in (1, 2) for name in ("R", "L")),
    *(f"controller.{name}" for name in ("K_v", "f_v", "k_p", "T_N", "g_E", "T_ten")),
]
OPTIONS: dict[str, dict[str, Any]] = {
    "exact": {"engine": "exact"},
    "explicit": {"engine": "explicit"},
    "adams": {"engine": "cvode", "method": "adams"},
    "bdf": {"engine": "cvode", "method": "bdf"},
    # the exact engine with more to do; see costs.py
    "energy": {"engine": "exact", "energy": True},
    "all signals": {"engine": "exact", "signals": []},
    "tape": {"engine": "exact", "gradient": PARAMETERS},
    "forward": {"engine": "exact", "sensitivities": PARAMETERS},
}


def engines() -> list[Engine | Program]:
    """Every engine of the core; the exact one with both builds of its inner loops."""
    methods = [
        engine(EXPLICIT, "explicit", *RTOLS),
        engine(ADAMS, "adams", *RTOLS),
        engine(BDF, "bdf", *RTOLS[::2], RTOLS[-1]),
    ]
    return [*exact_engines(), *methods]


def exact_engines() -> list[Engine | Program]:
    return [exact(f"{NATIVE}, {loops}", "exact", loops) for loops in inner_loops()]


def inner_loops() -> list[str]:
    """The builds of the exact engine's inner loops to measure, slowest first."""
    return ["baseline"] + [_core.__kernels__] * (_core.__kernels__ != "baseline")


def exact(name: str, which: str, loops: str) -> Program:
    environment = (("DUALDRIVE_KERNELS", "baseline"),) if loops == "baseline" else ()
    command = (sys.executable, __file__, which)
    return Program(name, NO_RTOL, command, _rows, environment=environment)


def _rows(states: Array) -> Array:
    return states.reshape(-1, len(case.PLANT))


def engine(name: str, which: str, *rtols: float) -> Engine:
    return Engine(name, rtols, partial(run, which), read)


def run(which: str, rtol: float) -> core_machines.Run:
    found = case.simulate(**OPTIONS[which], **({} if np.isnan(rtol) else {"rtol": rtol}))
    if which == "tape":  # the gradient of a sum of squares
        found.raw.pull_back(2.0 * found.raw.values)
    return found


def read(found: core_machines.Run) -> tuple[Array, int]:
    """Shape (times, 8), order of Eq. 23, and contacts."""
    return found.X, len(found.contacts)


def preset_rows() -> list[dict[str, Any]]:
    """Every preset through its default motion, with default options: how much faster than life.

    The error is that against CVODE at its finest tolerance, worst of following error and motor
    torques, each over its peak.
    """
    rows = []
    for name in presets():
        machine = Machine.load(name)
        motion = default_motion(machine)
        spent, run = _best(partial(simulate, machine, motion))
        fine = simulate(machine, motion, rtol=1e-13, engine="cvode")
        signals = ["e", *(s for s in ("T_1", "T_2") if s in run)]
        error = max(float(np.abs(run[s] - fine[s]).max() / np.abs(fine[s]).max()) for s in signals)
        rows.append(
            {
                "preset": name,
                "simulated_s": float(run.t[-1]),
                "ms_per_s": 1e3 * spent / float(run.t[-1]),
                "times_real_time": float(run.t[-1]) / spent,
                "events": len(run.events),
                "method": run.statistics["method"],
                "error": error,
            }
        )
    return rows


def _best(do: Callable[[], Any], repeats: int = 3) -> tuple[float, Any]:
    """Processor time of the fastest repeat, and its result."""
    best, result = np.inf, None
    for _ in range(repeats):
        begin = time.process_time()
        result = do()
        best = min(best, time.process_time() - begin)
    return best, result


def main(which: str, rtol: str, seconds: str, file: str) -> None:
    X, contacts, best = engine(which, which).sample(float(rtol), float(seconds))
    Path(file).write_bytes(np.ascontiguousarray(X).tobytes())
    print(1e3 * best, contacts)


if __name__ == "__main__":
    main(*sys.argv[1:])

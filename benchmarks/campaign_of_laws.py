"""Whether a switch is missed or invented where laws are not affine, over random machines.

    python benchmarks/campaign_of_laws.py              the random machines of the tests, 0 to 399
    python benchmarks/campaign_of_laws.py --last 6000

The switches of `auto` and of `exponential` at rtol 1e-9, in their order within an element, against
the explicit engine at 1e-11, wherever that finds the same at 1e-8: elsewhere the machine amplifies
what rounds differently, and there is no answer. Two switches of an element within a nanosecond are
one: a limit reached as what drives it turns round. A run that differs is one of

    rounding   the explicit engine parts from itself where every state's start is moved by 1e-15:
               a sum of torques that begins at zero, a loop that holds its torque to the last bit
    tolerance  the engine finds the same as the explicit one at 1e-10 or 1e-11
    FAILED     anything else

campaign.py holds the exact engine to long double.
"""

from __future__ import annotations

import sys
from collections import Counter, defaultdict

import numpy as np

import report

import case  # noqa: F401  isort: skip  (finds the tests' folder)
from core_random import RandomMachine
from dualdrive import _core

END, RTOL, COARSE, FINE, MOST_STEPS = 1.5, 1e-9, 1e-8, 1e-11, 2_000_000
ONE_INSTANT = 1e-9  # s
MOVED, TRIES = 1e-15, 6  # of every state's start, in its own unit
FINER = (1e-10, 1e-11)  # of an engine that differs
AFFINE = {kind.name: kind.affine for kind in _core.effect_types()}
Switches = dict[str, list[tuple[str, str]]]


def start(m: RandomMachine, moved: int) -> dict[str, float]:
    if not moved:
        return m.initial
    signs = np.random.default_rng(moved).choice([-MOVED, MOVED], len(m.machine.states()))
    return {
        name: m.initial.get(name, 0.0) + float(by)
        for (name, _), by in zip(m.machine.states(), signs, strict=True)
    }


def switches(m: RandomMachine, engine: str, rtol: float, moved: int = 0) -> Switches | None:
    """By element, from what to what; None where the run ends early. moved: 0 for not at all."""
    raw = _core.simulate(m.machine, m.inputs, end=END, initial=start(m, moved), rtol=rtol,
                         engine=engine, signals=["theta_m"], energy=False,
                         max_steps=MOST_STEPS)  # fmt: skip
    if raw.status != "success":
        return None
    found: Switches = defaultdict(list)
    last: dict[str, float] = {}
    for t, element, before, after in raw.events:
        if t - last.get(element, -1.0) < ONE_INSTANT:
            before, _ = found[element].pop()
        found[element].append((before, after))
        last[element] = t
    changes = {name: [s for s in of_it if s[0] != s[1]] for name, of_it in found.items()}
    return {name: of_it for name, of_it in changes.items() if of_it}


def verdict(m: RandomMachine, engine: str, truth: Switches) -> str:
    """Why an engine differs."""
    if any(switches(m, "explicit", FINE, 1 + k) != truth for k in range(TRIES)):
        return "rounding"
    return "tolerance" if any(switches(m, engine, r) == truth for r in FINER) else "FAILED"


def main() -> None:
    last = report.count_asked(str(__doc__), "last", 400)
    machines = compared = 0
    differ: list[list[str]] = []
    for seed in range(last):
        m = RandomMachine(seed)
        if all(AFFINE.get(e["effect"], False) for e in m.machine.effects):
            continue
        machines += 1
        truth = switches(m, "explicit", FINE)
        if truth is None or truth != switches(m, "explicit", COARSE):
            continue
        compared += sum(map(len, truth.values()))
        for engine in ("auto", "exponential"):
            found = switches(m, engine, RTOL)
            if found != truth:
                others = [name for name in {*truth, *(found or {})}
                          if (found or {}).get(name) != truth.get(name)]  # fmt: skip
                differ.append([verdict(m, engine, truth), str(seed), engine,
                               ", ".join(sorted(others)), "; ".join(m.notes[1:])])  # fmt: skip
                print("; ".join(differ[-1]), file=sys.stderr, flush=True)  # long before the end
    counts = Counter(row[0] for row in differ)
    told = ", ".join(f"{counts[name]} {name}" for name in ("rounding", "tolerance", "FAILED"))
    print(
        f"{machines} machines, {compared} switches that have an answer; runs that differ: {told}.\n"
    )
    if differ:
        print(report.table(["verdict", "machine", "engine", "elements", "what it is"], differ))
    sys.exit(counts["FAILED"] > 0)


if __name__ == "__main__":
    main()

"""Whether a switch is missed or invented where laws are not affine, over random machines.

    python benchmarks/campaign_of_laws.py              the random machines of the tests, 0 to 399
    python benchmarks/campaign_of_laws.py --last 2000

The switches of `auto` and of `exponential` at rtol 1e-9, in their order within an element, against
the explicit engine at 1e-11, wherever that finds the same at 1e-8: elsewhere the machine amplifies
what rounds differently, and there is no answer. Two switches of an element within a nanosecond are
one: a limit reached as what drives it turns round. campaign.py holds the exact engine to long
double.
"""

from __future__ import annotations

import sys
from collections import defaultdict

import report

import case  # noqa: F401  isort: skip  (finds the tests' folder)
from core_random import RandomMachine
from dualdrive import _core

END, RTOL, COARSE, FINE, MOST_STEPS = 1.5, 1e-9, 1e-8, 1e-11, 2_000_000
ONE_INSTANT = 1e-9  # s
AFFINE = {kind.name: kind.affine for kind in _core.effect_types()}
Switches = dict[str, list[tuple[str, str]]]


def switches(m: RandomMachine, engine: str, rtol: float) -> Switches | None:
    """By element, from what to what; None where the run ends early."""
    raw = _core.simulate(m.machine, m.inputs, end=END, initial=m.initial, rtol=rtol, engine=engine,
                         signals=["theta_m"], energy=False, max_steps=MOST_STEPS)  # fmt: skip
    if raw.status != "success":
        return None
    found: Switches = defaultdict(list)
    last: dict[str, float] = {}
    for t, element, before, after in raw.events:
        if t - last.get(element, -1.0) < ONE_INSTANT:
            before, _ = found[element].pop()
        found[element].append((before, after))
        last[element] = t
    return {name: [s for s in of_it if s[0] != s[1]] for name, of_it in found.items()}


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
                differ.append(
                    [str(seed), engine, ", ".join(sorted(others)), "; ".join(m.notes[1:])]
                )
                print("; ".join(differ[-1]), file=sys.stderr, flush=True)  # long before the end
    print(
        f"{machines} machines, {compared} switches that have an answer; runs that differ: ", end=""
    )
    print(f"{len(differ)}.\n")
    if differ:
        print(report.table(["machine", "engine", "elements", "what it is"], differ))


if __name__ == "__main__":
    main()

"""python -m tests.blind.shown drifted | load | reversals [--seeds 0 1] [--budget 20]"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterable

from tests.blind.generator.effects import UnfitError
from tests.blind.shown import apart, preloaded, verdicts
from tests.blind.shown.ordered import Order

from dualdrive.diagnose import Diagnosis


def main() -> int:
    """Print the figures of a claim; 1 where it does not hold."""
    parser = argparse.ArgumentParser(prog="tests.blind.shown", description=__doc__)
    parser.add_argument("claim", choices=["drifted", "load", "reversals"])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    parser.add_argument("--budget", type=float, default=20.0, help="s for each diagnosis")
    parser.add_argument("--only", default="", help="machines whose name holds this")
    told = parser.parse_args()
    if told.claim == "drifted":
        return answers(verdicts.drifts(told.seeds), verdicts.is_parameters, told)
    if told.claim == "load":
        return answers(verdicts.loads(told.seeds), verdicts.is_no_friction, told)
    return reversals(told)


def answers(
    orders: Iterable[Order], right: Callable[[Diagnosis], bool], told: argparse.Namespace
) -> int:
    """A line for each machine, then how many are answered right."""
    count = good = 0
    print(" | ".join(verdicts.HEAD))
    for order in orders:
        if told.only in order.name:
            found = order.diagnosed(told.budget, experiment=False)
            count, good = count + 1, good + right(found)
            mark = "" if right(found) else "   <- wrong"
            print(" | ".join(verdicts.row(order, found)) + mark, flush=True)
    print(f"right: {good} of {count}")
    return 0 if good == count else 1


def reversals(told: argparse.Namespace) -> int:
    """A line for each record that allows two names, then the shares."""
    rows: list[apart.Parted] = []
    for k, wanted in enumerate(w for seed in told.seeds for w in preloaded.every(seed)):
        if told.only not in " ".join(map(str, wanted)):
            continue
        begin = time.monotonic()
        try:
            case = preloaded.alike(*wanted)
        except UnfitError as none:
            print(f"no such record: {none}", flush=True)
            continue
        one = apart.parted(case, told.budget, seed=k)
        rows.append(one)
        print(
            f"{one.name} (seen {case.seen:.0f}, apart {case.apart:.1f}) | {one.verdict} | "
            f"suggested {one.suggested:.0f} | at random {one.chance:.0f} | {one.suggestion} | "
            f"{time.monotonic() - begin:.0f} s",
            flush=True,
        )
    for line in apart.summary(rows):
        print(line)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

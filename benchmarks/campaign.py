"""The exact engine on random machines: every switch against long double, and against CVODE.

    python benchmarks/campaign.py                    1800 machines, every 15th under CVODE too
    python benchmarks/campaign.py --machines 100
    python benchmarks/campaign.py --seeds 57 84      these alone, nothing read or written

Each machine runs with the engine in double and, on a grid three or five times finer, in long
double, so that neither steps nor blocks coincide: a root that one of them missed would show. Runs
in double have their inputs changed by 1e-15 of their size: what that does to the switches is what
no program in double can do better. Where the two orders of switches part, runs in long
double with inputs changed by 1e-15, 1e-14, ... show whether so small a change parts them too:

    agree      all switches, one to one
    rounding   they part where a change of the inputs by `margin` parts long double from itself, or
               earlier: one by 1e-15, or one that before it was no further off than double is; or a
               change by 1e-15 moves the times by more than double is off, and two neighbours swap;
               or (margin 0) a drive at no rate rides its limit in one and stands on it in the other
    FAILED     anything else, and every run whose error is above 1e-9 and above a thousand times
               the effect of the change by 1e-15

One line of JSON per machine goes to --out as it is done; a second start goes on from there, unless
the build or this programme changed.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import signal
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "py"))

from affine_machines import AffineMachine
from agreement import Agreement, align, dwell, lasting, states_apart, without_riding
from dualdrive import _core

Record = dict[str, Any]

ROOT = Path(__file__).resolve().parents[1]
MOVED = 1e-15  # change of the inputs whose effect is compared with rounding's, relative
MARGINS = (1e-15, 3e-15, 1e-14, 3e-14, 1e-13, 3e-13, 1e-12)
ECHOES = (0, 2, 4)  # changes by MOVED
TRIES = 4  # changes of each size
SHORT = 1e-3  # s: looked on so much further than where two runs part, ten times
FLOOR, FACTOR = 1e-9, 1e3  # an error that counts: above both
CVODE_RTOL = (1e-8, 1e-10, 1e-12)
BUDGET = 20_000  # steps in double; a stiff machine that needs more runs shorter


# ------------------------------------------------------------------------------------ one machine


def run(case: AffineMachine, *, moved: float = 0.0, attempt: int = 0, finer: int = 1,
        end: float | None = None, **options: Any) -> _core.Trajectory:  # fmt: skip
    """Run a machine, its inputs changed by a share `moved` of their size."""
    return _core.simulate(
        case.machine, shaken(case, moved, attempt), end=end or case.end,
        output_step=case.output_step / finer, initial=case.initial, energy=False,
        **options,
    )  # fmt: skip


def shaken(case: AffineMachine, moved: float, attempt: int) -> dict[str, _core.Waveform]:
    if not moved:
        return case.inputs
    random = np.random.default_rng([case.seed, attempt // 2])
    moved *= (-1) ** attempt  # both ways
    size = {"theta_ref": case.scale.move[0] / 3, "T_load": case.scale.load, "shove": 1.0}
    return {
        name: wave + _core.sine(moved * size[name], random.uniform(1, 4), random.uniform(0, 6))
        for name, wave in case.inputs.items()
    }


def examine(seed: int, with_cvode: bool, budget: int = BUDGET) -> Record:
    """Run one machine in every way."""
    began = time.monotonic()
    case = AffineMachine(seed)
    double = run(case, engine="exact")
    if (steps := double.statistics["steps"]) > budget:
        case.end *= budget / steps
        double = run(case, engine="exact")
    exact = run(case, engine="exact", long_double=True, finer=case.finer)
    logs = [lasting(r.events) for r in (double, exact)]
    same = align(*logs)
    blinks = [len(r.events) - len(log) for r, log in zip((double, exact), logs, strict=True)]
    moved = [run(case, engine="exact", moved=MOVED, attempt=k) for k in ECHOES]
    echoes = [align(logs[0], lasting(r.events)) for r in moved]
    ends = [min(same.until, e.until) for e in echoes]
    record: Record = {
        "seed": seed, "train": case.train, "status": exact.status, "switches": same.count,
        "longest": len(double.events), "apart": same.apart, "ties": same.ties, "tie": same.tie,
        "blinks": blinks,
        "error": states_apart(double, exact, same.until),
        "echo": max(map(states_apart, [double] * len(moved), moved, ends)),
        "echo_apart": max(e.apart for e in echoes), "steady": max(ends) == min(ends) == np.inf,
    }  # fmt: skip
    if np.isfinite(same.until):
        record |= part(case, same, double, exact)
    record["verdict"] = verdict(record)
    if with_cvode:
        record["cvode"] = against_cvode(case, double)
    return record | {"seconds": round(time.monotonic() - began, 2)}


def part(case: AffineMachine, same: Agreement, *both: _core.Trajectory) -> Record:
    """Look at the place where two runs part: how small a change does the same?"""
    exact = both[-1]
    off = max(same.apart, 1e-15 * same.until)
    end = min(same.until + 10 * SHORT, case.end)
    log = [switch for switch in lasting(exact.events) if switch[0] <= end]
    if align(*(without_riding(lasting(r.events)) for r in both)).until == np.inf:
        return {"until": same.until, "margin": 0.0, "dwell": 0.0}
    lasts = min(dwell(r.events, same.until) for r in both)
    found: Record = {"until": same.until, "margin": None, "gap": gap(same, *both), "dwell": lasts}
    for moved in MARGINS:
        for attempt in range(TRIES):
            other = run(case, engine="exact", long_double=True, finer=case.finer, moved=moved,
                        attempt=attempt, end=end)  # fmt: skip
            there = align(log, lasting(other.events))
            parts = there.count <= same.count and there.until < end - SHORT
            moves = there.apart > same.apart > found["gap"] / 10
            if (moved <= MOVED and (parts or moves)) or (parts and there.apart <= 10 * off):
                return found | {"margin": moved}
    return found


def gap(same: Agreement, *both: _core.Trajectory) -> float:
    """Return how far apart the two switches are whose order is not the same."""
    logs = [lasting(r.events)[same.count : same.count + 2] for r in both]
    exchanged = [log[0][1:] == other[1][1:] for log, other in (logs, logs[::-1])
                 if log and len(other) > 1]  # fmt: skip
    return min(log[1][0] - log[0][0] for log in logs) if all(exchanged) and exchanged else np.inf


def verdict(record: Record) -> str:
    if "until" in record:
        return "rounding" if record["margin"] is not None else "FAILED"
    late = record["apart"] > max(FLOOR, FACTOR * record["echo_apart"])
    off = record["error"] > max(FLOOR, FACTOR * record["echo"])
    return "FAILED" if record["steady"] and (late or off) else "agree"


def against_cvode(case: AffineMachine, exact: _core.Trajectory) -> Record:
    """Distance to CVODE at three tolerances, and of CVODE from itself, while the orders agree."""
    runs = [run(case, engine="cvode", rtol=rtol) for rtol in CVODE_RTOL]
    logs = [align(lasting(exact.events), lasting(r.events)) for r in runs]
    until = min(log.until for log in logs) - 1e-6
    return {
        "until": float(min(until, case.end)),
        "status": [r.status for r in runs],
        "switches": [log.count for log in logs],
        "apart": [states_apart(exact, r, until) for r in runs],
        "itself": [states_apart(a, b, until) for a, b in pairwise(runs)],
    }


# --------------------------------------------------------------------------------- all machines


def examine_or_tell(seed: int, with_cvode: bool) -> Record:
    try:
        return examine(seed, with_cvode)
    except Exception as error:  # whatever it is, the other machines go on, and it is shown
        return {"seed": seed, "verdict": "FAILED", "refused": f"{type(error).__name__}: {error}"}


def build() -> str:
    """What computed a line: the core and everything that draws or judges a machine."""
    drawing = ("affine_machines", "agreement", "core_random", "core_machines")
    sources = [Path(_core.__file__), Path(__file__)]
    sources += [ROOT / "tests" / "py" / f"{name}.py" for name in drawing]
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:12]


def read(path: Path, known: str) -> dict[int, Record]:
    """Return what this build has done already; a line that was torn off counts for nothing."""
    done = {}
    for line in path.read_text().splitlines() if path.exists() else []:
        try:
            record = json.loads(line)
        except json.JSONDecodeError:
            continue
        if record.get("build") == known:
            done[record["seed"]] = record
    return done


def work(seeds: Sequence[int], every: int, processes: int) -> Iterator[Record]:
    def quiet() -> None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    with ProcessPoolExecutor(processes, initializer=quiet) as pool:
        tasks = [pool.submit(examine_or_tell, seed, seed % every == 0) for seed in seeds]
        try:
            for task in as_completed(tasks):
                yield task.result()
        except KeyboardInterrupt:
            pool.shutdown(cancel_futures=True)
            raise


def campaign(machines: int, every: int, processes: int, out: Path) -> list[Record]:
    known = build()
    done = read(out, known)
    left = [seed for seed in range(machines) if seed not in done]
    print(f"{machines} machines, {machines - len(left)} of them done before; {out}", flush=True)
    out.parent.mkdir(parents=True, exist_ok=True)
    with out.open("a") as file:
        for record in work(left, every, processes):
            record["build"] = known
            print(json.dumps(record), file=file, flush=True)
            done[record["seed"]] = record
            if record["verdict"] == "FAILED":
                print(f"FAILED: {again(record)}", flush=True)
    return [done[seed] for seed in range(machines)]


# -------------------------------------------------------------------------------------- report


def again(record: Record) -> str:
    return f"python benchmarks/campaign.py --seeds {record['seed']}"


def largest(records: Iterable[Record], key: str) -> str:
    worst = max(records, key=lambda r: r[key], default=None)
    return "none" if worst is None else f"{worst[key]:.1e} (machine {worst['seed']})"


def share(records: Sequence[Record], key: str, level: float) -> str:
    within = sum(r[key] <= level for r in records)
    return f"{within} of {len(records)} within {level:.0e}"


def report(records: Sequence[Record]) -> int:
    """Print what was found; return how many failed."""
    ran = [r for r in records if "refused" not in r]
    agree = [r for r in ran if r["verdict"] == "agree"]
    parted = [r for r in ran if r["verdict"] == "rounding"]
    failed = [r for r in records if r["verdict"] == "FAILED"]
    steady = [r for r in agree if r["steady"] and max(r["echo"], r["echo_apart"]) < 1e-11]
    print(f"\n{len(records)} machines, {sum(r['switches'] for r in ran)} switches compared")
    print(f"missed or invented: {len(failed)} machines")
    print(f"agree to the end: {len(agree)} machines, {sum(r['switches'] for r in agree)} switches")
    print(f"  time: {share(agree, 'apart', 1e-9)} s, worst {largest(agree, 'apart')} s")
    print(f"  state: {share(agree, 'error', 1e-9)}, worst {largest(agree, 'error')}")
    print(f"  of these, {len(steady)} do not amplify a change of {MOVED:.0e} beyond 1e-11:")
    print(f"    time: worst {largest(steady, 'apart')} s; state: worst {largest(steady, 'error')}")
    tied = [r for r in ran if r["ties"]]
    print(f"order of simultaneous switches: {sum(r['ties'] for r in tied)} ties in {len(tied)}"
          f" machines, at most {largest(tied, 'tie')} s apart")  # fmt: skip
    blinks = [r for r in ran if r["blinks"] != [0, 0]]
    unlike = [r["seed"] for r in blinks if r["blinks"][0] != r["blinks"][1]]
    print(f"modes left at the instant they began: {sum(r['blinks'][0] for r in blinks)} in double,"
          f" {sum(r['blinks'][1] for r in blinks)} in long double; not alike in"
          f" {unlike}")  # fmt: skip
    report_parted(parted)
    report_cvode([r for r in ran if "cvode" in r])
    for r in failed:
        print(f"FAILED: {r.get('refused', 'see its line')}: {again(r)}")
    return len(failed)


def report_parted(parted: Sequence[Record]) -> None:
    print(f"order decided by rounding: {len(parted)} machines, {sum(r['switches'] for r in parted)}"
          " switches before it")  # fmt: skip
    for margin in (0.0, *MARGINS):
        of_it = [r for r in parted if r["margin"] == margin]
        cause = f"inputs changed by {margin:.0e} part it" if margin else "a drive rides at rest"
        if of_it:
            print(f"  {cause}: {len(of_it)} machines, times before it"
                  f" {largest(of_it, 'apart')} s apart")  # fmt: skip
    for r in sorted(parted, key=lambda r: r["apart"])[:10]:
        print(f"  machine {r['seed']}: at {r['until']:.6f} s, times before {r['apart']:.1e} s"
              f" apart, margin {r['margin']:.0e}, mode lasts {r['dwell']:.1e} s")  # fmt: skip


def report_cvode(records: Sequence[Record]) -> None:
    if not records:
        return
    runs = [r["cvode"] for r in records]
    falls = sum(c["apart"][2] <= max(c["apart"][0], FLOOR) for c in runs)
    inside = sum(c["apart"][2] <= 3 * c["itself"][1] + FLOOR for c in runs)
    print(f"CVODE: {len(runs)} machines, {sum(c['switches'][-1] for c in runs)} switches;"
          f" the distance falls with the tolerance in {falls},")  # fmt: skip
    print(f"  and is within what the last step of the tolerance still moved CVODE in {inside}")
    for k, rtol in enumerate(CVODE_RTOL):
        median = np.median([c["apart"][k] for c in runs])
        print(f"  rtol {rtol:.0e}: distance {median:.1e} in the median")
    for r in records:
        c = r["cvode"]
        if not c["apart"][2] <= 3 * c["itself"][1] + FLOOR:
            print(f"  machine {r['seed']}: {c['apart']} apart, CVODE from itself {c['itself']}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--machines", type=int, default=1800)
    parser.add_argument("--cvode", type=int, default=15, help="every how many-th runs under CVODE")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "campaign.jsonl")
    parser.add_argument("--seeds", type=int, nargs="+", help="examine these, print all of it")
    options = parser.parse_args()
    if options.seeds:
        for seed in options.seeds:
            case = AffineMachine(seed)
            print(", ".join(case.notes))
            print(json.dumps(examine(seed, seed % options.cvode == 0), indent=1))
        return
    records = campaign(options.machines, options.cvode, options.processes, options.out)
    sys.exit(report(records) > 0)


if __name__ == "__main__":
    main()

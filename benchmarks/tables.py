"""Whether ten draws say what more would, and what they cost: Tables 1 and 2, ten by ten.

    python benchmarks/tables.py --tens 1 --gaps 0.5 1 2     # the page's draws, as the page has them
    python benchmarks/tables.py --tens 2                    # at the presets' gaps: ten more

Prints for each ten what it took, and how long its threads waited for a core that others had: on
free cores it takes that much less. Then, for each printed pair and encoder, in how many cells the
contrast comes out by each ten, in how many all tens agree, and what all draws together say; and how
far the medians of single tens lie from the median of all.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Thread

import numpy as np

from dualdrive.indexing import Cell, Crossed, Verdict, crossed, verdicts
from dualdrive.indexing.experiment import DRAWS, SENSORS

Key = tuple[Cell, str]


@contextmanager
def spent(name: str, jobs: int) -> Iterator[None]:
    """Print wall and processor time, and the wall without the waits for a core (Linux)."""
    waits: dict[str, float] = {}
    stop = Event()

    def watch() -> None:
        while not stop.wait(1.0):
            for task in Path("/proc/self/task").glob("*/schedstat"):
                with suppress(OSError):  # it has ended
                    waits[task.parent.name] = 1e-9 * float(task.read_text().split()[1])

    watcher = Thread(target=watch, daemon=True)
    watcher.start()
    wall, processor = time.monotonic(), time.process_time()
    yield
    wall, processor = time.monotonic() - wall, time.process_time() - processor
    stop.set()
    watcher.join()
    free = wall - sum(sorted(waits.values())[-jobs:]) / jobs
    print(f"{name}: wall {wall:.0f} s, processor {processor:.0f} s; without waiting for a core "
          f"{free:.0f} s", flush=True)  # fmt: skip


def joined(parts: Sequence[Crossed]) -> Crossed:
    """All draws as one experiment."""
    figures = {key: np.concatenate([p.figures[key] for p in parts]) for key in parts[0].figures}
    moved = {key: sum(p.moved[key] for p in parts) for key in figures}
    return Crossed(figures, sum(p.draws for p in parts), moved)


def judged(result: Crossed) -> Mapping[Key, Verdict]:
    """Verdicts by cell and figure."""
    return {(v.cell, v.figure): v for v in verdicts(result)}


def agreement(tens: Sequence[Mapping[Key, Verdict]], whole: Mapping[Key, Verdict]) -> None:
    """A row per printed pair and encoder."""
    print("figure  load   encoder  contrast by each ten   of  all tens agree  all draws")
    same = of = 0
    for figure, load in dict.fromkeys((f, c.load) for c, f in whole):
        for sensor in SENSORS:
            keys = [k for k in whole if (k[1], k[0].load, k[0].sensor) == (figure, load, sensor)]
            each = [sum(ten[k].contrast for k in keys) for ten in tens]
            agree = sum(len({ten[k].contrast for ten in tens}) == 1 for k in keys)
            same, of = same + agree, of + len(keys)
            counts = " ".join(f"{n:2}" for n in each)
            all_draws = sum(whole[k].contrast for k in keys)
            print(
                f"{figure:7} {load:6} {sensor:8} {counts:>20}  "
                f"{len(keys):3}  {agree:14}  {all_draws:9}"
            )
    print(f"all tens agree in {same} of {of} cells")


def medians(tens: Sequence[Crossed], whole: Crossed) -> None:
    """How far the median of ten draws lies from that of all, as a share of it."""
    off = [
        abs(np.nanmedian(ten.values(cell, column, f)) / np.nanmedian(
            whole.values(cell, column, f)) - 1.0)
        for ten in tens for cell, column in whole.figures for f in "ARB"
    ]  # fmt: skip
    half, most = np.nanquantile(off, (0.5, 0.9))
    print(f"median of ten off that of all, both trains, A, R, B: {100 * half:.0f} % in half of the "
          f"cells, {100 * most:.0f} % or less in nine tenths")  # fmt: skip


def main() -> None:
    """Run tens and compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tens", type=int, default=2)
    parser.add_argument("--gaps", type=float, nargs="+", default=[1.0])
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    parts = []
    for k in range(options.tens):
        with spent(f"draws {k * DRAWS} to {(k + 1) * DRAWS - 1}", options.jobs):
            parts.append(
                crossed(DRAWS, first=k * DRAWS, gaps=tuple(options.gaps), jobs=options.jobs)
            )
    whole = joined(parts)
    agreement([judged(part) for part in parts], judged(whole))
    medians(parts, whole)


if __name__ == "__main__":
    main()

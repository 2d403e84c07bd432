"""Whether ten draws say what more would: Tables 1 and 2 over further tens of draws.

    python benchmarks/tables.py --tens 5

At the presets' gaps, both grades. The first ten draws are those of the page. Prints for each
printed pair and encoder in how many cells of grade and reading the contrast comes out by each ten,
in how many cells all tens agree, and what all draws together say; then how far the medians of
single tens lie from the median of all.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence

import numpy as np

from dualdrive.indexing import Cell, Crossed, Verdict, crossed, verdicts
from dualdrive.indexing.experiment import DRAWS, SENSORS

Key = tuple[Cell, str]


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
    print("figure  load   encoder  contrast by each ten  of  all tens agree  all draws")
    same = of = 0
    for figure, load in dict.fromkeys((f, c.load) for c, f in whole):
        for sensor in SENSORS:
            keys = [k for k in whole if (k[1], k[0].load, k[0].sensor) == (figure, load, sensor)]
            each = [sum(ten[k].contrast for k in keys) for ten in tens]
            agree = sum(len({ten[k].contrast for ten in tens}) == 1 for k in keys)
            same, of = same + agree, of + len(keys)
            print(f"{figure:7} {load:6} {sensor:8} {' '.join(f'{n:2}' for n in each):>20}  "
                  f"{len(keys):2}  {agree:14}  {sum(whole[k].contrast for k in keys):9}")  # fmt: skip
    print(f"all tens agree in {same} of {of} cells")


def medians(tens: Sequence[Crossed], whole: Crossed) -> None:
    """How far the median of ten draws lies from that of all, as a share of it."""
    off = [
        abs(np.nanmedian(ten.values(cell, column, f)) / np.nanmedian(
            whole.values(cell, column, f)) - 1.0)
        for ten in tens for cell, column in whole.figures for f in "ARB"
    ]  # fmt: skip
    half, most = np.nanquantile(off, (0.5, 0.9))
    print(f"median of ten off that of all, both trains, A, R, B: "
          f"{100 * half:.0f} % in half, {100 * most:.0f} % in nine tenths")  # fmt: skip


def main() -> None:
    """Run tens and compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tens", type=int, default=5)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    parts = []
    for k in range(options.tens):
        parts.append(crossed(DRAWS, first=k * DRAWS, gaps=(1.0,), jobs=options.jobs))
        print(f"draws {k * DRAWS} to {(k + 1) * DRAWS - 1}", flush=True)
    whole = joined(parts)
    agreement([judged(part) for part in parts], judged(whole))
    medians(parts, whole)


if __name__ == "__main__":
    main()

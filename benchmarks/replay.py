"""What a replay by the Kalman filter costs a sample, and what its steps of integration change.

    python benchmarks/replay.py                       the bench and every law of the library
    python benchmarks/replay.py nothing ripple hertz

Records are those of the survey (`survey_of_laws.py`): five channels at 1 kHz, sensors' noise as it
is there. The machine that made a record replays it, with gains that were learned before. Processor
time is that of `_core.predict`, best of several. Beside it stands how far chi-squared of the whole
record moves when every sample is integrated by many times as many steps, with the same gains: less
than 1 is asked for. Machines that are affine in their modes need no steps, and their replay does
not change.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from dualdrive import _core
from dualdrive.innovations import GreyBox, Noise, Variant, first_noise, predictable
from dualdrive.innovations.prediction import GIVEN
from dualdrive.innovations.records import Predictable
from dualdrive.replay import core_of
from dualdrive.replay import records as made_ready
from dualdrive.replay.record import with_settings
from independent_bench import DATA, SLACK
from report import table
from survey_of_laws import LAWS, MEMORY, NOISE, NOTHING, hidden, records

RECORDS = ("reversals", "slack")  # under tension; without it, so that flanks open and close
SHARE = 1e-3  # of the drives' torque, what of unknown course the filter allows for
FINE = 16  # times as many steps
#: what these make of the table's angle follows from forces, which no replay of it knows
BY_FORCE = ("radial_shift", "tilt")
ROUNDS = 7
NUMBERS, MOVED = 29, 1e-5  # by which slopes are taken, and a step of one, relative
HEAD = ["law", "record", "µs a sample", "switches", "chi-squared", "its change", "slopes"]


def noise_of(core: Any, played: list[Predictable]) -> Noise:
    """The sensors' noise as the records have it, and little torque of unknown course."""
    drive = {}
    for r in played:
        for channel, kind in zip(r.channels, r.kinds, strict=True):
            drive[kind] = NOISE[channel][0] * math.sqrt(1.0 - MEMORY**2)
    wide = first_noise(core, played, SHARE)
    return Noise(drive, dict.fromkeys(drive, MEMORY), wide.torque, wide.course)


def chi_squared(found: Mapping[str, Any]) -> float:
    """Of a whole replay."""
    return float(np.sum(found["residuals"] ** 2)) if found["finite"] else math.inf


def least_time(job: Callable[[], Any]) -> float:
    """Processor time of the fastest of several, s."""
    took = []
    for _ in range(ROUNDS):
        begin = time.process_time()
        job()
        took.append(time.process_time() - begin)
    return min(took)


def moved(core: Any, share: float) -> Any:
    """The machine with a heavier table."""
    own = core.copy()
    own.set("table.J", core.get("table.J") * (1.0 + share))
    return own


def rows(name: str) -> Iterator[list[str]]:
    """One law, a row a record."""
    machine, _, rng = hidden(name, 0)
    traces = records(machine, rng, RECORDS)
    settings = {k: s for k, s in SLACK.items() if k in traces}
    core = core_of(machine)
    played = predictable(core, made_ready(machine, traces, settings=settings, start="rest"))
    grey, nothing = GreyBox(core, played, [], threads=1), Variant(core)
    learned = grey.gains(nothing, grey.start(nothing), noise_of(core, played))
    for record, gains in zip(played, learned, strict=True):
        there = with_settings(core, record.record.settings)
        initial = record.initial(there, {})

        replay = partial(_core.predict, there, record.sampled, gains, initial=initial, given=GIVEN)
        found, took = replay(), least_time(replay)
        square, fine = chi_squared(found), chi_squared(replay(substeps=FINE))
        cost, slopes = f"{1e6 * took / len(record.measured):.3f}", ""
        if _core.has_sensitivities(there, record.sampled):
            others = [(moved(there, MOVED * (k + 1)), initial, []) for k in range(NUMBERS)]
            told = partial(_core.sensitivities, there, record.sampled, gains, others)
            slopes = f"{least_time(partial(told, initial=initial, given=GIVEN)) / took:.1f}"
        kept = math.isfinite(square) and math.isfinite(fine)  # else the state was lost on the way
        yield [
            name, record.name, cost, str(found["switches"]),
            f"{square:.1f}" if kept else "lost", f"{square - fine:+.2g}" if kept else "", slopes,
        ]  # fmt: skip


def main() -> None:
    """Print the table, a row as it comes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "law", nargs="*", choices=[[], NOTHING, *LAWS], help="all that are replayed unless given"
    )
    asked = parser.parse_args()
    if not DATA.exists():
        parser.exit(1, f"no records in {DATA}; DUALDRIVE_DATA names the folder of measured data\n")
    found = []
    for name in asked.law or [n for n in (NOTHING, *LAWS) if n not in BY_FORCE]:
        for row in rows(name):
            found.append(row)
            print("; ".join(row), flush=True)
    print(table(HEAD, found))


if __name__ == "__main__":
    main()

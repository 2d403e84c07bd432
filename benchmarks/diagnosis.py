"""How long `diagnose` and `improve` take on ten seconds of a dual drive, sampled at 1 kHz.

    python benchmarks/diagnosis.py                      with a strong hidden effect and with none
    python benchmarks/diagnosis.py --family bench --effect lugre --budget 30

The records come from the generator of the blind suite. Beside the seconds stand the verdict, what
a time limit cut, and the longest time without a line of progress.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dualdrive.diagnose import diagnose, improve
from report import table
from surroundings import ROOT

sys.path.insert(0, str(ROOT))
from tests.blind.generator import effects
from tests.blind.shown import families, motion, records
from tests.blind.shown.ordered import FAMILIES, Order

SECONDS, RATE = 10.0, 1000.0
LIMITS = {"diagnose": 60.0, "improve": 180.0}
#: of a strong amplitude: dry friction of a tenth of a motor's rated torque at the table
SHARE = 0.3
HEAD = ["verb", "machine", "hidden", "took", "allowed", "answer", "longest silence", "cut"]


@dataclass
class Teller:
    """Progress as it comes, and the longest time without any."""

    silence: float = 0.0
    last: float = field(default_factory=time.monotonic)

    def __call__(self, line: str) -> None:
        now = time.monotonic()
        self.silence, self.last = max(self.silence, now - self.last), now
        print(f"    {line}", file=sys.stderr, flush=True)


def order(family: str, seed: int, effect: str) -> Order:
    """Ten seconds at 1 kHz; the sheet is 5 to 10 % off, and lacks the effect if one is named."""
    rng = np.random.default_rng([seed, 3])
    sheet = families.draw(family, rng)
    plan = moves(family, sheet)
    hidden: tuple[effects.Hidden, ...] = ()
    if effect:
        hidden = (effects.draw(effect, records.setting(sheet, (plan,)), seed, SHARE),)
        without = {path for one in hidden for path in one.without}
        sheet = {path: value for path, value in sheet.items() if path not in without}
    recorder = records.recorder(family, sheet["motors.K_d"], rng)
    real = families.drift(sheet, rng)
    return Order(family, sheet, real, (plan,), recorder, {plan.name: hidden})


def moves(family: str, machine: dict[str, float]) -> records.Plan:
    """Moves both ways at two speeds, with rests between, ten seconds in all."""
    kind = families.FAMILIES[family]
    v, a, j = (float(np.mean(kind[key])) for key in ("v", "a", "j"))
    length = v * max(0.3, 1.5 - v / a)
    pieces = [(length, v, a, j), (-length, v, a, j), (length / 2, v / 2, a, j)]
    pieces += [(-length / 2, v / 2, a, j)]
    jerks, end = motion.course(pieces, [0.6] * 5)
    if end > SECONDS:
        raise ValueError(f"{family}: its moves take {end:.3g} s, more than {SECONDS:g} s")
    tension, settle = machine["controller.T_ten"], float(kind["settle"])
    return records.Plan("ten", jerks, SECONDS, 1 / RATE, settle, tension, v, length)


def timed(verb: str, wanted: Order, hidden: str, budget: float) -> list[str]:
    """A row of the table."""
    tell = Teller()
    asked: dict[str, Any] = {"settings": wanted.settings(), "budget": budget, "progress": tell}
    begin = time.monotonic()
    if verb == "diagnose":
        found = diagnose(wanted.machine(), wanted.traces(), **asked)
        answer = f"{found.verdict} {found.best.label if found.best else ''}"
        cut = found.cut
    else:
        ladder = improve(wanted.machine(), wanted.traces(), **asked)
        answer = f"{', '.join(step.label for step in ladder.steps)}; {ladder.stopped}"
        cut = [line for one in ladder.diagnoses for line in one.cut]
    took = time.monotonic() - begin
    silence = max(tell.silence, time.monotonic() - tell.last)
    told = f"{took:.0f} s", f"{LIMITS[verb]:.0f} s", answer.strip(), f"{silence:.0f} s"
    return [verb, wanted.name, hidden, *told, "; ".join(cut) or "nothing"]


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--family", choices=FAMILIES, action="append")
    arguments.add_argument("--effect", default="coulomb", help="the hidden one")
    arguments.add_argument("--verb", choices=list(LIMITS), action="append")
    arguments.add_argument("--budget", type=float, help="s; what the verb's own is unless given")
    arguments.add_argument("--seed", type=int, default=1)
    asked = arguments.parse_args()
    rows = []
    for family in asked.family or FAMILIES[:1]:
        for hidden in (asked.effect, ""):
            wanted = order(family, asked.seed, hidden)
            for verb in asked.verb or LIMITS:
                budget = asked.budget or LIMITS[verb]
                rows.append(timed(verb, wanted, hidden or "nothing", budget))
                print(" | ".join(rows[-1]), flush=True)
    print(table(HEAD, rows))
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    return 0 if all(float(row[3].split()[0]) <= LIMITS[row[0]] for row in rows) else 1


if __name__ == "__main__":
    raise SystemExit(main())

"""python -m tests.blind generate --suite dev --count 40 -o DIR"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from tests.blind.generator import suite


def main(arguments: Sequence[str]) -> int:
    """Write a suite of cases, or what is missing of it."""
    parser = argparse.ArgumentParser(prog="tests.blind generate", description=main.__doc__)
    parser.add_argument("--suite", choices=list(suite.PHRASES), default="dev")
    parser.add_argument("--count", type=int, help="cases in all; the full suite unless given")
    parser.add_argument("--effects", choices=["first", "all"], default="all")
    parser.add_argument("--shard", default="1/1", help="which part of how many: 1/2")
    parser.add_argument("-o", "--output", type=Path, required=True)
    told = parser.parse_args(arguments)
    counts = suite.FULL if told.count is None else suite.counts_of(told.count)
    pool = suite.FIRST if told.effects == "first" else ()
    part, parts = (int(n) for n in told.shard.split("/"))
    wanted = suite.orders(told.suite, counts, pool)[part - 1 :: parts]
    suite.generate(told.output, told.suite, wanted)
    return 0

"""python -m tests.blind generate --part develop --cases 60 -o DIR"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from tests.blind.generator import parts


def main(arguments: Sequence[str]) -> int:
    """Write cases of a part, or those that are missing."""
    parser = argparse.ArgumentParser(prog="tests.blind generate", description=main.__doc__)
    parser.add_argument("--part", choices=[*parts.FIRST, "sealed"], default="develop")
    parser.add_argument("--seed", type=int, help="of the sealed part: 1 or more, never used before")
    parser.add_argument("--cases", type=int, default=40, help="how many")
    parser.add_argument("--from", dest="begin", type=int, default=0, help="number of the first one")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("-o", "--output", type=Path, required=True)
    told = parser.parse_args(arguments)
    try:
        part = parts.part(told.part, told.seed)
    except ValueError as error:
        parser.error(str(error))
    numbers = range(told.begin, told.begin + told.cases)
    parts.generate(told.output, part, numbers, told.jobs)
    return 0

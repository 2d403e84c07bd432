"""python -m tests.blind generate | check | truth | run | score"""

from __future__ import annotations

import sys
from importlib import import_module

VERBS = ("generate", "check", "truth", "run", "score")


def main() -> int:
    """Hand the rest of the command line to the verb."""
    if len(sys.argv) < 2 or sys.argv[1] not in VERBS:
        print(f"usage: python -m tests.blind {{{','.join(VERBS)}}} ... ; each has --help")
        return 2
    verb = import_module(f"tests.blind.{sys.argv[1]}")
    return int(verb.main(sys.argv[2:]))


if __name__ == "__main__":
    raise SystemExit(main())

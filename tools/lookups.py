"""Look up equations of the paper as a newcomer would: grep the core, open one place by one.

    python tools/lookups.py [NUMBER...]

Ten numbers are drawn where none is given, the same each time. Prints for each the places that
``grep -rnw "Eq. N" cpp`` names, and which of them is the first within a function, or above one:
there it is computed. An equation of the whole machine (14, 17, 22, 23) is the assembly's; its place
is a header that says so.
"""

from __future__ import annotations

import random
import re
import sys
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
WHOLE = {14, 17, 22, 23}
COUNT, LAST = 10, 23
_NEAR = 4  # lines of a comment above its function


def places(number: int) -> list[tuple[Path, int]]:
    """Files and lines that name an equation, in grep's order within folders."""
    named = re.compile(rf"Eq\. {number}\b")
    return [
        (path.relative_to(ROOT), line)
        for path in sorted((ROOT / "cpp").rglob("*.[hci]pp"))
        for line, text in enumerate(path.read_text("utf-8").splitlines(), 1)
        if named.search(text)
    ]


def function_at(path: Path, line: int) -> str | None:
    """The function that a line stands in, or in the comment above."""
    inside = None
    for k, text in enumerate((ROOT / path).read_text("utf-8").splitlines()[: line + _NEAR], 1):
        if begins := re.match(r"\S.*?([\w:<>~]+)\([^;]*\{$", text):
            inside = begins[1]
            if k > line:
                break
        elif text.startswith("}") and k < line:
            inside = None
    return inside


def looked_up(asked: Iterable[int] = ()) -> list[str]:
    """A line per equation, and the counts."""
    numbers = list(asked) or sorted(random.Random(0).sample(range(1, LAST + 1), COUNT))
    lines, opened = [], []
    for number in numbers:
        found = places(number)
        computes = [function_at(*place) for place in found]
        if number in WHOLE:  # the headers of assembly and linearisation
            computes = ["the whole machine" if "include" in p.parts else None for p, _ in found]
        at = next((k for k, name in enumerate(computes) if name), len(found))
        if at == len(found):
            lines.append(f"Eq. {number}: not found")
            continue
        opened.append(at + 1)
        path, line = found[at]
        where = f"{path}:{line}, {computes[at]}"
        lines.append(f"Eq. {number}: {len(found)} places; number {at + 1} is {where}")
    ones = opened.count(1)
    lines.append(
        f"found {len(opened)} of {len(numbers)}; {ones} at the first place opened, "
        f"{sum(opened)} places opened in all"
    )
    return lines


if __name__ == "__main__":
    print("\n".join(looked_up(int(word) for word in sys.argv[1:])))

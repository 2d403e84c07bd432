"""The ladder of errors: nominal, refitted, with an effect, with a second one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from dualdrive.diagnose.result import Diagnosis
from dualdrive.plain import plain


@dataclass(frozen=True, eq=False)
class Step:
    """A rung of the ladder: headline errors on what was fitted and on what was held out."""

    label: str
    fitted: float
    held_out: float
    noise_floor: float
    command: str
    machine: Any


@dataclass(frozen=True, eq=False)
class Ladder:
    """How the error fell, and why it stopped.

    steps:     nominal, refitted, + effect, + second effect ...
    diagnoses: what was found before each step that adds an effect, and the last one
    held:      in words, what the steps were held against
    """

    steps: Sequence[Step]
    diagnoses: Sequence[Diagnosis]
    stopped: str
    held: str
    seconds: float

    @property
    def machine(self) -> Any:
        """The machine of the last step."""
        return self.steps[-1].machine

    @property
    def gap_closed(self) -> float:
        """Share of the refitted machine's held-out error above the floor that went."""
        if not self.steps:  # records that can't be judged
            return 0.0
        refitted, last = self.steps[min(1, len(self.steps) - 1)], self.steps[-1]
        gap = refitted.held_out - refitted.noise_floor
        return float((refitted.held_out - last.held_out) / gap) if gap > 0 else 0.0

    def rows(self) -> list[tuple[str, ...]]:
        """Cells of the table, a head first."""
        head = ("step", "fitted", "held out", "noise floor")
        return [
            head,
            *(
                (s.label, *(_percent(x) for x in (s.fitted, s.held_out, s.noise_floor)))
                for s in self.steps
            ),
        ]

    def table(self) -> str:
        """The ladder as lines of text, and why it stopped."""
        rows = self.rows()
        widths = [max(len(row[k]) for row in rows) for k in range(4)]
        lines = ["  ".join(f"{c:<{w}}" for c, w in zip(r, widths, strict=True)) for r in rows]
        return "\n".join([*lines, f"held out: {self.held}", f"stopped: {self.stopped}"])

    def _repr_html_(self) -> str:
        import dualdrive  # its lazy name: how a notebook shows things knows of results

        return dualdrive.notebook.ladder(self)

    def figures(self) -> dict[str, Any]:
        """Plain JSON values; ``None`` where a number is not finite."""
        return dict(
            plain(
                {
                    "steps": [
                        {
                            k: getattr(s, k)
                            for k in ("label", "fitted", "held_out", "noise_floor", "command")
                        }
                        for s in self.steps
                    ],
                    "stopped": self.stopped,
                    "held_out": self.held,
                    "gap_closed": self.gap_closed,
                    "seconds": self.seconds,
                    "diagnoses": [d.figures() for d in self.diagnoses],
                }
            )
        )


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %" if math.isfinite(share) else "–"

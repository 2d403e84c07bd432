"""What a diagnosis says: verdict, candidates, groups, equation, shape, next experiment."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from dualdrive.compare.equation import EquationAtFault
from dualdrive.plain import plain

if TYPE_CHECKING:
    from dualdrive.compare import Comparison, Condition

Array = NDArray[np.float64]
Verdict = Literal["adequate", "parameters", "effect", "ambiguous", "unknown", "unfinished"]

#: what each verdict means, in one line
VERDICTS: dict[Verdict, str] = {
    "adequate": "the machine as described meets the record within its noise",
    "parameters": "numbers of the data sheet are off; refitted, the machine meets the record",
    "effect": "a physical effect is missing, and the record says which",
    "ambiguous": "an effect is missing, and this record can't say which of a group",
    "unknown": "something is missing that no effect of the library explains",
    "unfinished": "the search was stopped before every law had its turn",
}


@dataclass(frozen=True)
class Interval:
    """A number with its 95 % interval, in `unit`; one that was counted or held has low = high."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class Candidate:
    """One hypothesis: an effect (or two) in the machine, everything else refitted under it.

    effects:     (effect, place), one or two of them
    probability: that this is all that is missing; what was not tried, or not found, included
    fitted:      headline error on the samples it was fitted to
    held_out:    headline error on samples it was not fitted to
    gain:        twice the log likelihood it gains over the refitted nominal machine
    explained:   share of the error beyond the sensors' noise that it removes, of a balance share of
        what a free input could explain; 0 .. 1, NaN where nothing is left beyond it
    resolved:    false: not refitted, or the refit was cut; errors that were not computed are NaN
    """

    effects: tuple[tuple[str, str], ...]
    probability: float
    parameters: Mapping[str, Interval]
    fitted: float
    held_out: float
    gain: float
    explained: float
    resolved: bool = True
    note: str = ""

    @property
    def label(self) -> str:
        """``coulomb@table``, or two of them joined by `` + ``."""
        return " + ".join(f"{effect}@{place}" for effect, place in self.effects)


@dataclass(frozen=True, eq=False)
class Shape:
    """Missing torque of one equation along one coordinate, with a 95 % band; arrays of shape (n,).

    coordinate: speed, angle, direction, load torque, time, ...
    explained:  share of the missing torque's mean square that is a function of the coordinate
    """

    equation: str
    coordinate: str
    coordinate_unit: str
    unit: str
    at: Array
    value: Array
    low: Array
    high: Array
    explained: float


@dataclass(frozen=True)
class Experiment:
    """What to measure next.

    motion:    in words of ``--motion``, as `dualdrive.parse_motion` reads them
    settings:  machine parameters to set for it, such as controller.T_ten = 0
    separates: the two leading rivals
    expected_distance: squared distance of the rivals' records over noise, the best refit of the
        nominal numbers taken out; 11 tells them apart in 95 % of cases
    other:     name -> expected distance of the rest of the menu; those beyond a limit left out
    commands:  what to type: see what is expected, then diagnose old and new records together
    """

    name: str
    motion: str
    settings: Mapping[str, float]
    separates: tuple[str, str]
    expected_distance: float
    why: str
    other: Mapping[str, float] = field(default_factory=dict)
    commands: Sequence[str] = ()


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What a record says of a machine.

    mode:      closed_loop | balance
    error:     headline errors: nominal, refitted, best, noise_floor, held_out_refitted,
               held_out_best; in a closed loop `creeping`, of what stands, where what dry friction
               holds follows its creep
    groups:    labels that this record can't tell apart
    warnings:  what is wrong with the record itself; such a record names no effect
    cut:       what a time limit or a stop left undone
    refitted:  the machine with its nominal numbers refitted
    improved:  the machine with the best candidate added and fitted, None where none is named
    before:    comparison of the refitted machine; `after` of the improved one
    numbers:   nominal numbers, path -> interval, refitted beside the best candidate where one is
               named; `moved` those that the records put elsewhere than the data sheet, beyond doubt
    over_floor: residual over noise floor, RMS, of the series that the leader explains worst
    effort:    ``replays`` done, ``of`` how many
    missing_torque: equation -> torque of unknown course that the refitted machine asks for
    """

    machine: str
    mode: str
    records: tuple[str, ...]
    verdict: Verdict
    candidates: Sequence[Candidate]
    groups: Sequence[tuple[str, ...]]
    error: Mapping[str, float]
    warnings: Sequence[str]
    seconds: float
    equation: EquationAtFault | None = None
    where: Sequence[Condition] = ()
    shapes: Sequence[Shape] = ()
    next_experiment: Experiment | None = None
    cut: Sequence[str] = ()
    paragraph: str = ""
    command: str = ""
    refitted: Any = None
    improved: Any = None
    before: Comparison | None = None
    after: Comparison | None = None
    moved: Mapping[str, Interval] = field(default_factory=dict)
    numbers: Mapping[str, Interval] = field(default_factory=dict)
    over_floor: float = math.nan
    effort: Mapping[str, int] = field(default_factory=dict)
    missing_torque: Mapping[str, Any] = field(default_factory=dict)

    @property
    def best(self) -> Candidate | None:
        """The leading candidate where the verdict names one or a group, else None."""
        named = self.verdict in ("effect", "ambiguous") and self.candidates
        return self.candidates[0] if named else None

    @property
    def judged(self) -> bool:
        """Whether the records could be judged; where none could, `warnings` say why."""
        return bool(self.error)

    @property
    def fitted_to(self) -> str:
        """What a machine's history says of the fit: to which records, and that it was cut."""
        fitted = f"fitted to {', '.join(self.records)}"
        cut = self.verdict == "unfinished"
        return f"{fitted}; unfinished: {VERDICTS[self.verdict]}" if cut else fitted

    def _repr_html_(self) -> str:
        import dualdrive  # its lazy name: how a notebook shows things knows of results

        return dualdrive.notebook.diagnosis(self)

    def figures(self) -> dict[str, Any]:
        """Plain JSON values; ``None`` where a number is not finite."""
        best = self.next_experiment
        return dict(
            plain(
                {
                    "verdict": self.verdict,
                    "machine": self.machine,
                    "mode": self.mode,
                    "records": list(self.records),
                    "candidates": [_candidate(c) for c in self.candidates],
                    "groups": [list(group) for group in self.groups],
                    "equation": None if self.equation is None else vars(self.equation),
                    "where": [
                        {"kind": c.kind, "condition": c.condition, "excess": c.excess}
                        for c in self.where
                    ],
                    "error": dict(self.error),
                    "over_floor": self.over_floor,
                    "parameters": {path: vars(value) for path, value in self.numbers.items()},
                    "moved": list(self.moved),
                    "shapes": [
                        {
                            k: v.tolist() if isinstance(v, np.ndarray) else v
                            for k, v in vars(s).items()
                        }
                        for s in self.shapes
                    ],
                    "next_experiment": None
                    if best is None
                    else {
                        **vars(best),
                        "separates": list(best.separates),
                        "commands": list(best.commands),
                    },
                    "warnings": list(self.warnings),
                    "cut": list(self.cut),
                    "effort": dict(self.effort),
                    "missing_torque": {k: vars(m) for k, m in self.missing_torque.items()},
                    "paragraph": self.paragraph,
                    "command": self.command,
                    "seconds": self.seconds,
                }
            )
        )


def _candidate(c: Candidate) -> dict[str, Any]:
    (effect, place), *others = c.effects
    return {
        "label": c.label,
        "effect": effect,
        "place": place,
        **({"with": [{"effect": e, "place": p} for e, p in others]} if others else {}),
        "probability": c.probability,
        "fitted": c.fitted,
        "held_out": c.held_out,
        "gain": c.gain,
        "explained": c.explained,
        "resolved": c.resolved,
        "note": c.note,
        "parameters": {path: vars(value) for path, value in c.parameters.items()},
    }

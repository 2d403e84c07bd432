"""Which equation of motion does not close, and how sure that is.

Each hypothesis adds to one equation a random torque, as large as makes the residuals most likely;
the nominal numbers, constants and encoder zeros are refitted under it. The probability is how often
a hypothesis stays the most likely when blocks of the record are drawn anew, so that neighbouring
residuals, which resemble each other, do not count as so many witnesses.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dualdrive.compare.clocks import in_time
from dualdrive.compare.excuses import (
    Point,
    alike,
    cautious,
    first_point,
    left,
    noise_alone,
    refitted,
    strain,
    with_open_law,
)
from dualdrive.compare.held import alike_in_rows, hold
from dualdrive.compare.likelihood import Free, blocks, likelihood, without
from dualdrive.identify import Processing, with_torques
from dualdrive.identify.filtering import for_records
from dualdrive.replay import core_of, named
from dualdrive.traces import Trace

Array = NDArray[np.float64]

_DRAWS = 1000
_DECIMATE, _SAMPLES = 5, 2500
_STEPS = 4
#: mean square of the whitened residual beyond which something is wrong at all
_NOISE = 2.0
#: squared deviations by which the law's constants may stray from what is believed of them
_FAR = 40.0
#: share of what a free mesh torque explains that a late encoder must explain to be blamed instead
_LATE = 0.8


#: what `EquationAtFault.shares` are
Measure = Literal["explained", "probability", "torque"]


@dataclass(frozen=True)
class EquationAtFault:
    """Which equation of motion does not close.

    name:    ``table``, ``motor_1``, ``mesh_2``, ``motors``, ``meshes``, ``sensors``, ...; ``total``
             where too little motion is recorded to tell one equation from another
    shares:  equation -> number, 0 .. 1
    measure: what these numbers are. ``explained``: how much of the unexplained mean square a free
             torque in it removes; neighbours remove each other's in part, so that these do not add
             up to 1. ``probability``: of the laws that act there, which adds up to 1 at most.
             ``torque``: of unknown course that the filter asks for there, over the drives' torque.
    """

    name: str
    probability: float
    shares: Mapping[str, float]
    measure: Measure = "explained"


def equation_at_fault(
    machine: Any,
    traces: Trace | Sequence[Trace] | Mapping[str, Trace],
    *,
    processing: Processing | None = None,
) -> EquationAtFault | None:
    """Say which equation of a machine fails on records, through the torque balance.

    For records with and without a known controller alike: measured torques (or currents), the
    angles of the drives and of the table. The nominal numbers need not be fitted before; they move
    within their tolerances under every hypothesis.

    Args:
        machine: a machine, or the core's.
        traces: one trace, several, or name -> trace.
        processing: filters; a tenth of the sampling rate, every fifth sample, unless given.

    Returns:
        The equation, or None where every equation closes within the sensors' noise.

    Raises:
        ValueError: a record that the torque balance refuses.

    """
    core = core_of(machine).copy()
    known = {n: in_time(core, with_torques(core, t)) for n, t in named(traces).items()}
    process = processing or _usual(known)
    held = alike_in_rows([hold(core, t, name, process, law=True) for name, t in known.items()])
    nominal = first_point(core, held)
    point = refitted(nominal, cautious, _STEPS)
    if _closes(point):
        return None
    guesses = _hypotheses(point)
    names = list(dict.fromkeys(name for name, _ in guesses))
    if len(names) < 2:
        return EquationAtFault(names[0], 1.0, {names[0]: 1.0})
    whole = _whitened(point)
    likely = [
        likelihood(
            [with_open_law(p) if name == "controller" else p for p in (nominal, point)], free
        )
        for name, free in guesses
    ]
    shares = {name: max(0.0, 1.0 - _whitened(point, free) / whole) for name, free in guesses}
    sums = np.stack([blocks(log, point) for log in likely])
    random, count = np.random.default_rng(1), sums.shape[1]
    drawn = random.multinomial(count, np.full(count, 1.0 / count), _DRAWS) @ sums.T
    rank = np.array([names.index(name) for name, _ in guesses])
    wins = np.bincount(rank[np.argmax(drawn, axis=1)], minlength=len(names))
    best = int(np.argmax(wins))
    name = names[best]
    if name.startswith("mesh") and 1.0 - _whitened(point, late=True) / whole > _LATE * shares[name]:
        shares["sensors"], name = shares[name], "sensors"
    return EquationAtFault(name, float((wins[best] + 0.5) / (_DRAWS + 1)), shares)


def _usual(traces: Mapping[str, Trace]) -> Processing:
    """The usual filter, every fifth sample or fewer: a few thousand tell one from another."""
    process = for_records(None, traces)
    every = max(process.every(float(np.median(np.diff(t.t)))) for t in traces.values())
    count = sum(len(trace) for trace in traces.values())
    return replace(process, decimate=max(_DECIMATE, every, count // _SAMPLES))


def _closes(point: Point) -> bool:
    """Whether equations of motion and the controller's law both close within the sensors' noise."""
    weight, bodies = noise_alone(point), len(point.rows[0].held.equations)
    rest, (plant, law) = left(point, weight), strain(point, weight)
    if law > _FAR:
        return False
    for rows, more in ((slice(0, bodies), plant), (slice(bodies, None), law)):
        squares = [
            np.einsum("an,nab,bn->n", e[rows], w[r.keep][:, rows, rows], e[rows])
            for e, w, r in zip(rest, weight, point.rows, strict=True)
        ]
        samples = np.concatenate(squares)
        mean = float(np.mean(samples)) + alike(point) * more / len(samples)
        if mean >= _NOISE * max(1, len(rest[0][rows])):
            return False
    return True


def _whitened(point: Point, free: Free | None = None, *, late: bool = False) -> float:
    """Squared residual in units of the sensors' noise, but for free directions, summed."""
    weight = noise_alone(point)
    if free is not None:
        weight = [without(w, d) for w, d in zip(weight, free(point), strict=True)]
    rest = left(point, weight, late=late)
    squares = [
        np.einsum("an,nab,bn->n", e, w[r.keep], e)
        for e, w, r in zip(rest, weight, point.rows, strict=True)
    ]
    return float(np.sum(np.concatenate(squares)))


# --- hypotheses -----------------------------------------------------------------------------------


def _hypotheses(point: Point) -> list[tuple[str, Free]]:
    """Every equation by itself, then those of both drives, alike and each for itself; sensors."""
    unit = np.eye(len(point.equations))
    single = {_spoken(e): unit[k] for k, e in enumerate(point.equations)}
    laws = [single.pop(name) for name in list(single) if name.startswith("controller")]
    if len(single) > 1:
        single |= {c: d for r in point.rows for c, d in r.directions.items()}
    found = [(name, _constant(d[:, None])) for name, d in single.items()]
    for group, stem in (("motors", "motor_"), ("meshes", "mesh_")):
        members = [d for name, d in single.items() if name.startswith(stem)]
        if len(members) > 1:
            if group == "motors":
                found.append((group, _constant(np.sum(members, axis=0)[:, None])))
            else:  # an error of the table's encoder is one of both meshes
                found.append(("sensors", lambda p: [r.table.T[:, :, None] for r in p.rows]))
            found.append((group, _constant(np.stack(members, axis=1))))
    if laws:
        found.append(("controller", _constant(np.sum(laws, axis=0)[:, None])))
        found.append(("controller", _constant(np.stack(laws, axis=1))))
    return found


def _constant(directions: Array) -> Free:
    return lambda p: [np.broadcast_to(directions, (len(r.keep), *directions.shape)) for r in p.rows]


def _spoken(equation: str) -> str:
    """The core names equations after the angles they govern; people after the body."""
    if equation.startswith("controller"):
        return equation
    if equation in ("m", "total"):
        return "table" if equation == "m" else "total"
    return f"motor_{equation[-1]}"

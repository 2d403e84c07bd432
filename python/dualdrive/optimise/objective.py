"""Designs through a duty cycle at all corners: what each costs in heat and gives in accuracy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dualdrive.assembly import gaps
from dualdrive.ensembles.batch import ensemble
from dualdrive.figures import Reduction
from dualdrive.linear.operating_point import operating_point
from dualdrive.linear.stability import growth
from dualdrive.machine import Machine
from dualdrive.motion import Motion
from dualdrive.optimise.worst_case import Corner

__all__ = ["TENSION", "Design", "Progress", "evaluate"]

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

TENSION = "controller.T_ten"


@dataclass(frozen=True)
class Design:
    """One choice of numbers, at its worst corner each; SI. None where it is not stable.

    values:      path -> value
    stable:      the loop's poles decay with every flank closed, at all corners
    worst:       name of the corner that decides: the unstable one, else that of least margin
    note:        why there are no figures though it is stable: a run that did not come to its end
    growth:      largest real part of a pole at any corner, 1/s
    margin:      least torque that holds a flank closed, N*m at the motor; 0 where one opens
    peak_error, rms_error, hunting: following error from the first command on; peak to peak at rest
    torque_rms, torque_peak: of the motor that has most, N*m
    heat:        copper loss of all motors, mean over the cycle, W; None without windings
    """

    values: Mapping[str, float]
    stable: bool
    worst: str
    growth: float
    margin: float | None = None
    peak_error: float | None = None
    rms_error: float | None = None
    hunting: float | None = None
    torque_rms: float | None = None
    torque_peak: float | None = None
    heat: float | None = None
    note: str = ""

    @property
    def known(self) -> bool:
        """Whether there are figures."""
        return self.margin is not None

    @property
    def apart(self) -> bool:
        """Whether no flank opens once the tension has built up."""
        return self.margin is not None and self.margin > 0.0


def evaluate(
    machine: Machine,
    motion: Motion,
    designs: Sequence[Mapping[str, float]],
    cases: Sequence[Corner],
    progress: Progress | None = None,
) -> list[Design]:
    """Run every design at every corner. Designs whose loop is unstable somewhere are not run.

    designs:  path -> SI value each, all with the same paths, controller.T_ten among them or not
    cases:    from `corners`
    """
    found: list[Design | None] = [None] * len(designs)
    sound: list[int] = []
    state = operating_point(machine, motion)
    for k, values in enumerate(designs):
        rates = [growth(machine, {**case.values, **values}, state) for case in cases]
        worst = int(np.argmax(rates))
        found[k] = Design(values, rates[worst] < 0.0, cases[worst].name, rates[worst])
        if rates[worst] < 0.0:
            sound.append(k)
    runs = [{**case.values, **designs[k]} for k in sound for case in cases]
    figures = _run(machine, motion, runs, progress)
    for place, k in enumerate(sound):
        rows = figures[place * len(cases) : (place + 1) * len(cases)]
        stable = found[k]
        assert stable is not None
        found[k] = _summed_up(machine, stable, rows, cases)
    return [design for design in found if design is not None]


def _run(
    machine: Machine,
    motion: Motion,
    runs: Sequence[Mapping[str, float]],
    progress: Progress | None,
) -> list[dict[str, float] | str]:
    """Figures of each run; what happened, of one that did not come to its end."""
    if not runs:
        return []
    columns = {path: np.array([run[path] for run in runs]) for path in runs[0]}
    collected: list[dict[str, float] | str] = [""] * len(runs)
    measures = _measures(machine, motion)
    with ensemble(machine, motion, columns, measures=measures, jobs=1, energy=False) as pool:
        for done, run in enumerate(pool, 1):
            good = run.status == "success"
            collected[run.run] = dict(run.figures) if good else f"{run.status}: {run.message}"
            if progress is not None:
                progress(done, len(runs))
    return collected


def _measures(machine: Machine, motion: Motion) -> dict[str, Reduction]:
    """What is summed up of a run, from the first command on: before it the tension builds up."""
    knots = motion.waveform.knots()
    begin = float(knots[0]) if len(knots) else 0.0
    found = {
        "error peak": Reduction("e", "peak", begin),
        "error rms": Reduction("e", "rms", begin),
    }
    known = {name for name, _, _ in machine.core.signals()}
    for n in (1, 2):
        found[f"peak {n}"] = Reduction(f"T_{n}", "peak", begin)
        found[f"rms {n}"] = Reduction(f"T_{n}", "rms", begin)
        if f"I_{n}" in known:
            found[f"current {n}"] = Reduction(f"I_{n}", "rms", begin)
    for name in gaps(machine.core):
        found[f"{name} low"] = Reduction(f"{name}.torque", "min", begin)
        found[f"{name} high"] = Reduction(f"{name}.torque", "max", begin)
    return found


def _summed_up(
    machine: Machine,
    design: Design,
    rows: Sequence[dict[str, float] | str],
    cases: Sequence[Corner],
) -> Design:
    """The worst of all corners; none where a run failed."""
    for row, case in zip(rows, cases, strict=True):
        if isinstance(row, str):
            return Design(design.values, True, case.name, design.growth, note=row)
    good = [row for row in rows if not isinstance(row, str)]
    tension = design.values.get(TENSION, machine.get(TENSION))
    margins = [_margin(machine, row, tension) for row in good]
    resistances = [machine.get(f"{motor}.R") for motor in machine.core.motors]
    wound = "current 1" in good[0]
    return Design(
        values=design.values,
        stable=True,
        worst=cases[int(np.argmin(margins))].name,
        growth=design.growth,
        margin=min(margins),
        peak_error=max(row["error peak"] for row in good),
        rms_error=max(row["error rms"] for row in good),
        hunting=max(row["standstill_amplitude"] for row in good),
        torque_rms=max(row[f"rms {n}"] for row in good for n in (1, 2)),
        torque_peak=max(row[f"peak {n}"] for row in good for n in (1, 2)),
        heat=max(
            sum(R * row[f"current {n}"] ** 2 for n, R in enumerate(resistances, 1)) for row in good
        )
        if wound
        else None,
    )


def _margin(machine: Machine, row: Mapping[str, float], tension: float) -> float:
    """Least torque on any closed flank, N*m at the motor; 0 where a flank opens or none is meant.

    Tension closes the master's front flanks and the slave's back flanks, or the other way round.
    """
    if tension == 0.0:
        return 0.0
    least = np.inf
    for name in gaps(machine.core):
        front = name.endswith("_1") == (tension > 0.0)
        held = row[f"{name} low"] if front else -row[f"{name} high"]
        number = name.rpartition("_")[2]
        least = min(least, held / machine.get(f"gearbox_{number}.ratio"))
    return max(float(least), 0.0)

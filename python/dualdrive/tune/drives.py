"""Steps 1 and 3: are both drives set alike, and do they answer alike."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from dualdrive.linear import DriveComparison, compare_drives
from dualdrive.linear.contacts import closed
from dualdrive.machine import Machine
from dualdrive.tune.cause import causes
from dualdrive.tune.job import Draft, Job
from dualdrive.tune.result import Curve, Panel
from dualdrive.units import human

__all__ = ["compare_parameters", "compare_responses"]

_SETTINGS = ("T_max", "U_max", "omega_max")  # limits of a drive, which the lesser motor rules
_COULD = 0.8  # of the difference explained
_NAMED = 4


def compare_parameters(job: Job) -> Draft:
    """Step 1: numbers side by side; limits set to the lesser of both, filters to the master's."""
    machine = job.machine.copy()
    pairs = _pairs(machine)
    done, shares = [f"{len(pairs)} numbers of each drive compared"], {}
    if job.table is not None:
        done.append(f"{job.table.name}: {len(job.table.entries)} drive parameters compared")
        if job.unused:
            done.append(
                f"no place in the machine for {', '.join(job.unused)}: keep them as they are"
            )
        differing = [n for n, entry in job.table.entries.items() if entry.differs]
        if differing:
            return Draft(machine, done, reason=_unequal(job, differing))
    for one, two in pairs:
        a, b = machine.get(one), machine.get(two)
        shares[two] = _percent(a, b)
        if a == b:
            continue
        unit = machine.parameter(one).unit
        said = f"{two} {human(b, unit)}, master {human(a, unit)}"
        if one.endswith(".ratio"):
            way = "give both drives the same gears"
            return Draft(machine, done, reason=f"{said}: drives of unequal ratio fight; {way}")
        if one.rpartition(".")[2].startswith("filter_"):
            machine.set(two, a)
            done.append(f"{said}: set-point filters must be alike; set to the master's")
        elif one.rpartition(".")[2] in _SETTINGS:
            for path in (one, two):
                machine.set(path, min(a, b))
            done.append(f"{said}: both set to the lesser")
        else:
            done.append(f"{said}: not a setting; step 3 shows whether it matters")
    labels = set(machine.effects)
    for label in sorted(labels):
        other = re.sub(r"_([12])$", lambda m: f"_{3 - int(m[1])}", label)
        if re.search(r"_[12]$", label) and other not in labels:
            done.append(f"{label}: the other drive has no such effect; step 3 shows what it does")
    return Draft(machine, done, panels=(_shown(shares),))


def _unequal(job: Job, differing: list[str]) -> str:
    assert job.table is not None
    words = []
    for number in differing:
        entry = job.table.entries[number]
        words.append(f"{number} master {entry.master:g}, slave {entry.slave:g}")
    return f"{job.table.name}: {'; '.join(words)}: set the same in both"


def _pairs(machine: Machine) -> list[tuple[str, str]]:
    """Paths of the master and of the slave that mean the same and that some law reads."""
    known = [p.path for p in machine.parameters()]
    return [
        (one, two)
        for one in known
        if re.search(r"_1(\.|$)", one)
        and (two := re.sub(r"_1(\.|$)", r"_2\1", one)) in known
        and not machine.core.unread(one)
    ]


def _percent(a: float, b: float) -> float:
    if a == b:
        return 0.0
    return 100.0 * (b / a - 1.0) if a and np.isfinite([a, b]).all() else 100.0


def _shown(shares: dict[str, float]) -> Panel:
    names = list(shares)
    points = Curve(
        "slave", np.array(list(shares.values())), np.arange(len(names), dtype=float), True
    )
    return Panel("Slave against master", "difference [%]", "", (points,), names=tuple(names))


def compare_responses(job: Job) -> Draft:
    """Step 3: speed loops of both drives, all flanks closed; refuses where they part."""
    machine = job.machine
    seen = job.measured or compare_drives(
        machine,
        modes=closed(machine),
        tolerance_db=job.tolerance_db,
        tolerance_deg=job.tolerance_deg,
    )
    details: dict[str, Any] = {"comparison": seen.figures()}
    if not seen.differ:
        return Draft(machine.copy(), [seen.text], panels=_bode(seen), details=details)
    found = causes(machine, seen)
    could = [cause for cause in found if cause.explains >= _COULD][:_NAMED]
    details["causes"] = [vars(cause) for cause in found]
    if could:
        why = "by itself could do it: " + "; or ".join(cause.text for cause in could)
    else:
        best = found[0].text if found else "there are none"
        why = f"no single number of the slave explains it; the best: {best}"
    reason = (
        f"{seen.text}; {why}. Find the mechanical fault first: what follows takes them as equal"
    )
    return Draft(machine.copy(), [seen.text, why], _bode(seen), reason, details)


def _bode(seen: DriveComparison) -> tuple[Panel, ...]:
    f = seen.master.frequency_hz
    f = f[seen.counts]
    marks = ((seen.frequency_hz, "differ most"),) if seen.frequency_hz is not None else ()
    both = (("master", seen.master), ("slave", seen.slave))
    size = tuple(Curve(n, f, r.magnitude_db[seen.counts]) for n, r in both)
    phase = tuple(Curve(n, f, r.phase_deg[seen.counts]) for n, r in both)
    return (
        Panel("Speed loops", "", "magnitude [dB]", size, marks, log_x=True),
        Panel("", "frequency [Hz]", "phase [deg]", phase, marks, log_x=True),
    )

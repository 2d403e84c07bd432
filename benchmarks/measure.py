"""Engines and how they are timed: side by side in rounds, so that what slows one slows all."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import case
from case import Array

ROUNDS = 5
RTOLS = (1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13)  # of what is fast enough for all of them
SLICE = 0.15  # s a round for each engine and tolerance, one run at least
NEAR = 2.0  # decades
ENOUGH = 3.0  # s, wall clock: no further rounds for what took so long in all


class Absent(Exception):  # noqa: N818
    """What an engine needs is not on this machine; the message says what."""


@dataclass(frozen=True)
class Point:
    """One engine at one tolerance.

    ms:          processor time of a run, best of the repeats
    error:       reached, see `case.error_of`; infinite where the engine gave up
    events:      contacts made or lost that it located
    evaluations: of the rates; 0 where they are not counted
    """

    engine: str
    rtol: float  # NaN where it has none
    ms: float
    error: float
    events: int
    note: str = ""
    evaluations: int = 0


def in_turn(
    names: Iterable[str],
    rtols: Iterable[float],
    rounds: int,
    run: Callable[[str, float], tuple[float, float, int, int]],
) -> list[Point]:
    """Every engine at every tolerance, all of them in each round; what fails has an infinite error.

    Args:
        names: of the engines.
        rtols: tolerances.
        rounds: how often each runs; the fastest run counts.
        run: name, rtol -> ms, error, events, evaluations. Raises RuntimeError where it fails.

    """
    best = {
        (name, rtol): Point(name, rtol, np.inf, np.inf, 0) for name, rtol in product(names, rtols)
    }
    for _ in range(rounds):
        for (name, rtol), old in best.items():
            if old.note:
                continue
            try:
                ms, error, events, evaluations = run(name, rtol)
            except RuntimeError as failure:
                best[name, rtol] = replace(old, ms=np.inf, error=np.inf, note=str(failure))
                continue
            best[name, rtol] = Point(
                name, rtol, min(ms, old.ms), error, events, evaluations=evaluations
            )
    return list(best.values())


@dataclass(frozen=True)
class Engine:
    """A way to run the case: `run(rtol)` is timed, `read` makes (X, contacts) of what it gives."""

    name: str
    rtols: tuple[float, ...]
    run: Callable[[float], Any] = field(repr=False)
    read: Callable[[Any], tuple[Array, int]] = field(repr=False, default=lambda found: found)

    def sample(self, rtol: float, seconds: float) -> tuple[Array, int, float]:
        """Return X, contacts and the processor time of the fastest of its repeats, s."""
        best, begin = np.inf, time.process_time()
        while True:
            start = time.process_time()
            found = self.run(rtol)
            end = time.process_time()
            best = min(best, end - start)
            if end - begin > seconds:
                return *self.read(found), best


@dataclass(frozen=True)
class Program:
    """An engine in a process of its own, which times itself.

    It is started as `command rtol seconds file`, writes the states into the file, rows of doubles,
    and prints milliseconds and contacts.
    """

    name: str
    rtols: tuple[float, ...]
    command: tuple[str, ...]
    read: Callable[[Array], Array] = field(repr=False)  # what the file holds to shape (times, 8)
    given: str = ""  # on its standard input
    environment: tuple[tuple[str, str], ...] = ()

    def sample(self, rtol: float, seconds: float) -> tuple[Array, int, float]:
        with tempfile.TemporaryDirectory(prefix="dualdrive-") as folder:
            states = Path(folder) / "states"
            done = subprocess.run(
                [*self.command, repr(rtol), repr(seconds), str(states)], input=self.given,
                capture_output=True, text=True, check=False,
                env={**os.environ, **dict(self.environment)},
            )  # fmt: skip
            if done.returncode:
                raise RuntimeError(done.stderr.strip().splitlines()[-1])
            X = self.read(np.fromfile(states))
        ms, contacts, *_ = done.stdout.split()
        return X, int(contacts), float(ms) / 1e3


def measure(
    engines: Sequence[Engine | Program], rounds: int = ROUNDS, share: float = SLICE
) -> list[Point]:
    """One point per engine and tolerance, in that order; `share` is the least of a round, s."""
    jobs = [_Job(engine, rtol) for engine in engines for rtol in engine.rtols]
    for turn in range(rounds):
        for job in jobs:
            job.do(share)
        print(f"round {turn + 1} of {rounds}", file=sys.stderr)
    return [job.point for job in jobs]


class _Job:
    """One engine at one tolerance, sampled until enough time went into it."""

    def __init__(self, engine: Engine | Program, rtol: float) -> None:
        self.engine, self.rtol = engine, rtol
        self.spent = 0.0
        self.point = Point(engine.name, rtol, np.inf, np.inf, 0)

    def do(self, share: float) -> None:
        if self.spent > ENOUGH:
            return
        begin = time.perf_counter()
        try:
            X, events, best = self.engine.sample(self.rtol, share)
        except RuntimeError as failure:
            self.point = replace(self.point, ms=np.nan, note=str(failure))
            self.spent = np.inf
            return
        self.spent += time.perf_counter() - begin
        error = self.point.error if np.isfinite(self.point.error) else case.error_of(X)
        self.point = replace(
            self.point, ms=min(self.point.ms, 1e3 * best), error=error, events=events
        )


def at_equal_error(points: Sequence[Point], target: float) -> float | None:
    """Time at a reached error, ms.

    Read off the straight line, on logarithmic axes, through the runs whose errors lie within two
    decades of it; between the nearest two where fewer than three do. An engine whose coarsest run
    is better than asked for costs what that run costs; None where no run is good enough.
    """
    usable = sorted((p.error, p.ms) for p in points if np.isfinite(p.error))
    if not usable or usable[0][0] > target:
        return None
    errors, ms = (np.array(column) for column in zip(*usable, strict=True))
    if errors[-1] <= target:
        return float(ms.min())
    x, y, at = np.log10(errors), np.log10(ms), np.log10(target)
    near = np.abs(x - at) <= NEAR
    if near.sum() < 3:
        return float(10 ** np.interp(at, x, y))
    return float(10 ** np.polyval(np.polyfit(x[near], y[near], 1), at))

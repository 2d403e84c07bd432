"""Playing a record through a machine: simulate, and read the result as the recorder would."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.mapper import Mapper, Threads, mapped
from dualdrive.recorder import own_paths, reading_times, sources, written
from dualdrive.replay.record import Record, with_settings

Array = NDArray[np.float64]

#: local tolerance; an error of 1e-6 of the signal, far below any sensor's noise
RTOL = 1e-8
MAX_STEPS = 20_000_000
_FLANKS = ("mesh_1.flank", "mesh_2.flank")


@dataclass(frozen=True, eq=False)
class Replay:
    """What the machine did on one record.

    simulated: compared channel -> values at the record's times, shape (n,)
    slopes:    compared channel -> derivative by each unknown asked for, shape (n, unknowns)
    flanks:    mesh -> contact at the record's times: -1 back, 0 in the gap, 1 front
    """

    record: Record
    status: str
    message: str
    simulated: Mapping[str, Array] = field(default_factory=dict)
    slopes: Mapping[str, Array] = field(default_factory=dict)
    flanks: Mapping[str, Array] = field(default_factory=dict)
    statistics: Mapping[str, Any] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        """Whether the simulation reached the end of the record."""
        return self.status == "success"

    def residual(self, name: str) -> Array:
        """Simulated minus measured of one channel, shape (n,)."""
        result: Array = self.simulated[name] - self.record.channel(name).measured
        return result


def play(
    core: Any,
    record: Record,
    sensitivities: Sequence[str] = (),
    initial: Mapping[str, float] | None = None,
    rtol: float = RTOL,
    flanks: bool = False,
    max_steps: int = MAX_STEPS,
) -> Replay:
    """Simulate the closed loop along one record.

    Args:
        core: the core's machine; the record's settings go over its own.
        record: inputs and times.
        sensitivities: parameter paths or groups, those of recorder effects too, or
            ``initial.<state>``.
        initial: state -> value, over those of the record.
        rtol: local tolerance of the integration.
        flanks: whether to keep the contacts.
        max_steps: of the integration; more is a failure.

    Raises:
        ValueError: what the core refuses. A simulation that fails is a status, not an exception.

    """
    core = with_settings(core, record.settings)
    raw = sorted({channel for c in record.channels for channel, _ in c.parts})
    read = {name: source for name, source in sources(core).items() if name in raw}
    late = {name: source.delay for name, source in read.items()}
    times = reading_times(record.t, late, record.begin)
    own = own_paths(core, sensitivities)
    known = {name for name, _, _ in core.signals()}
    contacts = [name for name in _FLANKS if flanks and name in known]
    run = _core.simulate(
        core,
        dict(record.inputs),
        start=record.begin,
        end=float(times[-1]),
        times=times.tolist(),
        rtol=rtol,
        max_steps=max_steps,
        signals=raw + contacts,
        sensitivities=[path for path in sensitivities if path not in own],
        initial={**record.initial, **(initial or {})},
        energy=False,
    )
    if run.status != "success":
        return Replay(record, run.status, run.message, statistics=run.statistics)
    column = {name: k for k, name in enumerate(run.names)}
    seen: dict[str, Array] = {}
    slopes: dict[str, Array] = {}
    for channel in raw:
        rows = np.searchsorted(times, np.maximum(record.t - late.get(channel, 0.0), record.begin))
        moved = np.zeros((len(rows), len(sensitivities)))
        if run.parameters:
            moved[:, [path not in own for path in sensitivities]] = run.sensitivities[
                rows, column[channel]
            ]
        seen[channel] = run.values[rows, column[channel]]
        if channel in read:
            seen[channel], moved = written(
                core, read[channel].places, record.t, seen[channel], moved, list(sensitivities)
            )
        if sensitivities:
            slopes[channel] = moved
    whole = np.searchsorted(times, record.t)
    return Replay(
        record,
        run.status,
        "",
        _derived(record, seen),
        _derived(record, slopes) if slopes else {},
        {name.partition(".")[0]: run.values[whole, column[name]] for name in contacts},
        run.statistics,
    )


def _derived(record: Record, raw: Mapping[str, Array]) -> dict[str, Array]:
    """Compared channels from recorded ones; values or slopes alike, for all of them are sums."""
    found = {}
    for c in record.channels:
        first, *others = (factor * raw[name] for name, factor in c.parts)
        found[c.name] = sum(others, first)
    return found


def play_all(
    core: Any,
    several: Sequence[Record],
    sensitivities: Sequence[str] = (),
    initial: Sequence[Mapping[str, float]] | None = None,
    *,
    mapper: Mapper | None = None,
    **options: Any,
) -> list[Replay]:
    """Play records side by side; the core computes without holding the interpreter.

    A single record runs in the calling thread, where Ctrl-C reaches it at once; several run where
    the mapper has them, threads of this process unless told.
    """
    states = initial or [{}] * len(several)
    if len(several) == 1:
        return [play(core, several[0], sensitivities, states[0], **options)]
    mapper = mapper or Threads()
    task = partial(_played, core, tuple(sensitivities), options)
    jobs = [(mapper.keep(record), state) for record, state in zip(several, states, strict=True)]
    found = mapped(mapper, task, jobs)
    return [replace(replay, record=record) for replay, record in zip(found, several, strict=True)]


def _played(
    core: Any,
    sensitivities: Sequence[str],
    options: Mapping[str, Any],
    record: Record,
    state: Mapping[str, float],
) -> Replay:
    """A replay without its record, which is large and where the replay was asked for."""
    found = play(core, record, sensitivities, state, **options)
    return replace(found, record=cast("Record", None))

"""Hold a machine against measured traces as it is: nothing about the machine is fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.compare.clocks import Clock, clock_of
from dualdrive.compare.comparison import Comparison, Quantity
from dualdrive.compare.held import floor_of_noise, shaken
from dualdrive.compare.noise import NoiseFloor, noise_floor
from dualdrive.compare.repeats import period_of
from dualdrive.compare.time_skew import skews
from dualdrive.compare.turning import as_conditions, of_balance, of_channels, orders_of
from dualdrive.compare.where import Situation, standing, where_it_fails
from dualdrive.echo import once
from dualdrive.identify import (
    Evaluation,
    Processing,
    Standstill,
    evaluate,
    refuse_filters,
    torque_balance,
    torque_notes,
    torque_warnings,
    why_balance,
    with_torques,
)
from dualdrive.identify.filtering import for_records
from dualdrive.identify.result import Residual
from dualdrive.replay import RTOL, Record, core_of, named
from dualdrive.traces import Trace

Array = NDArray[np.float64]
MODES = ("auto", "closed_loop", "balance")


def compare(
    machine: Any,
    traces: Trace | Sequence[Trace] | Mapping[str, Trace],
    mode: str = "auto",
    *,
    offsets: str = "all",
    motion: Any = None,
    interpolation: str = "auto",
    start: str = "auto",
    rtol: float = RTOL,
    processing: Processing | None = None,
    standstill: Standstill | None = None,
    settings: Mapping[str, Mapping[str, float]] | None = None,
) -> Comparison:
    """Compare a machine with measured traces.

    Closed loop: the controller gets the recorded command, and every channel that both have is
    compared. What belongs to a record and not to the machine is found first: constants of its
    sensors, its initial state. Torque balance: the recorded motion and torques must close the
    equations of motion; for traces whose controller is unknown.

    Args:
        machine: a machine, or the core's.
        traces: one trace, several, or name -> trace.
        mode: ``closed_loop``, ``balance``, or ``auto``: closed loop where the machine has a
            controller and every trace a commanded motion.
        offsets: which sensors may have a constant: ``all`` headline channels but the following
            error, ``encoders`` of the drives, ``none``.
        motion: commanded motion (a waveform or :class:`dualdrive.Motion`) where traces carry none.
        interpolation: ``auto``, ``cubic``, ``linear`` or ``hold``, of recorded inputs.
        start: ``rest``, ``settled`` or ``auto``, see :func:`dualdrive.replay.records`.
        rtol: local tolerance of the simulation.
        processing: filters and decimation of the torque balance.
        standstill: what the torque balance does near standstill.
        settings: name of a trace -> parameter path -> SI value that held while it was recorded.

    Raises:
        ValueError: a trace that can't be held against this machine, or an unknown option.
        FitError: the simulation fails on a record; the message carries its status.

    """
    if mode not in MODES:
        raise ValueError(f"mode = {mode!r}; choose one of {', '.join(MODES)}")
    core, recorded = core_of(machine), named(traces)
    why = why_balance(core, recorded, motion) if mode == "auto" else ""
    if why or mode == "balance":
        return _balance(machine, recorded, offsets, processing, standstill, settings, why)
    refuse_filters(processing, standstill)
    found = evaluate(
        machine,
        recorded,
        offsets=offsets,
        motion=motion,
        interpolation=interpolation,
        start=start,
        rtol=rtol,
        settings=settings,
    )
    return of_evaluation(machine, found)


def of_evaluation(machine: Any, found: Evaluation) -> Comparison:
    """The comparison behind an evaluation, such as ``Fit.fitted``."""
    quantities, situations, clocks = [], [], []
    unit_of = getattr(machine, "unit_of", lambda _, unit: unit)
    for replay in found.replays:
        record = replay.record
        still = standing(record.t, record.reference)
        period = period_of(record.t, record.reference)
        clock = clock_of(record.trace, record.name)
        clocks.append(clock)
        own = [
            Quantity(
                record.name,
                c.name,
                c.kind,
                unit_of(c.name, c.unit),
                c.long_name,
                c.headline,
                record.t,
                c.measured,
                replay.simulated[c.name] + found.offsets.get((record.name, c.name), 0.0),
                np.ones(len(record.t), dtype=bool),
                found.offsets.get((record.name, c.name), 0.0),
                noise_floor(
                    record.t,
                    c.measured,
                    still,
                    period=period,
                    jitter=clock.noise(record.t, c.measured),
                ),
            )
            for c in record.channels
        ]
        quantities += own
        situations.append(_situation(record, own, replay.flanks))
    records = [replay.record for replay in found.replays]
    core, traces = core_of(machine), {record.name: record.trace for record in records}
    orders = orders_of(core, traces, of_channels(quantities))
    late = skews(core, traces)
    return Comparison(
        core.name,
        "closed_loop",
        quantities,
        [*where_it_fails(situations), *as_conditions(orders)],
        {record.name: record.start for record in records},
        found.initial,
        [
            *_notes(quantities, records),
            *_clock_notes(clocks),
            *once((s.message for s in late if s.significant), traces),
        ],
        orders,
        late,
    )


def _situation(record: Record, own: Sequence[Quantity], flanks: Mapping[str, Array]) -> Situation:
    kinds: dict[str, list[Array]] = {}
    counted = [q for q in own if q.headline] or own
    for q in counted:
        kinds.setdefault(q.kind, []).append((q.residual / q.spread) ** 2)
    square = np.mean([np.mean(squares, axis=0) for squares in kinds.values()], axis=0)
    speed = np.gradient(record.reference, record.t)
    return Situation(record.name, record.t, square, speed, flanks, _load(record.trace, record.t))


def _load(trace: Trace, t: Array) -> Array | None:
    """Sum of the motors' torques, or currents, regardless of sign: shape (n,)."""
    for stem in ("T", "I"):
        names = [name for name in (f"{stem}_1", f"{stem}_2") if name in trace]
        if names:
            parts = [np.abs(np.interp(t, trace.t, trace[name])) for name in names]
            return np.asarray(np.sum(parts, axis=0))
    return None


def _clock_notes(clocks: Sequence[Clock]) -> list[str]:
    uneven = [clock.message for clock in clocks if clock.kind != "even"]
    return once(uneven, [clock.record for clock in clocks])


def _notes(quantities: Sequence[Quantity], records: Sequence[Record]) -> list[str]:
    how = dict.fromkeys(q.noise.how for q in quantities if q.headline)
    guessed = [words for words in how if "periods of" not in words]
    notes = [f"noise floor from what does not repeat ({'; '.join(how)})"]
    if guessed:
        notes = [
            f"noise floor from single records ({'; '.join(how)}): an estimate; a motion recorded "
            "several times over would measure it"
        ]
    notes += [
        f"{record.name}: {record.left_out} samples in stretches too short to play left out"
        for record in records
        if record.left_out
    ]
    notes += [
        f"{record.name}: begins in motion, so that its first second says little; cut it at rest"
        for record in records
        if record.moves_at_once
    ]
    for record in dict.fromkeys(q.record for q in quantities):
        constants = [
            f"{q.name} {q.offset:+.3g} {q.unit}"
            for q in quantities
            if q.record == record and q.headline and q.offset != 0.0
        ]
        if constants:
            notes.append(f"{record}: constants granted to sensors: {', '.join(constants)}")
    return once(notes, [record.name for record in records])


def balance_error(
    machine: Any,
    recorded: Mapping[str, Trace],
    *,
    settings: Mapping[str, Mapping[str, float]] | None = None,
    processing: Processing | None = None,
    standstill: Standstill | None = None,
) -> float:
    """The headline error of :func:`compare` in balance mode, and nothing else."""
    core = core_of(machine)
    traces = {name: with_torques(core, trace) for name, trace in recorded.items()}
    found = torque_balance(
        machine,
        traces,
        free=[],
        processing=processing,
        standstill=standstill,
        settings=settings,
    )
    return found.error


def _balance(
    machine: Any,
    recorded: Mapping[str, Trace],
    offsets: str,
    processing: Processing | None,
    standstill: Standstill | None,
    settings: Mapping[str, Mapping[str, float]] | None,
    why: str,
) -> Comparison:
    """Every equation of motion on the recorded kinematics, with a constant torque per record.

    why: in words, where nobody asked for the balance
    """
    core = core_of(machine)
    traces = {name: with_torques(core, trace) for name, trace in recorded.items()}
    process, rest = for_records(processing, traces), standstill or Standstill()
    found, again_ = (
        torque_balance(
            machine,
            own,
            free=[],
            offsets=offsets != "none",
            processing=process,
            standstill=rest,
            settings=settings,
        )
        for own in (
            traces,
            {name: shaken(core, trace, name, process, rest) for name, trace in traces.items()},
        )
    )
    unit_of = getattr(machine, "unit_of", lambda _, unit: unit)
    quantities, situations = [], []
    for (record, equation), left in found.residuals.items():
        unit = unit_of("T_load", "N*m")
        again = again_.residuals[record, equation]
        own = Quantity(
            record,
            equation,
            "equation",
            unit,
            f"torque balance of {equation}: what the model asks for, against what was measured",
            True,
            left.t,
            left.measured,
            left.measured + left.residual,
            left.fitted,
            found.offsets[record, equation].value if (record, equation) in found.offsets else 0.0,
            NoiseFloor(_apart(left, again), "the sensors' noise carried through the balance"),
        )
        quantities.append(own)
        situations.append(_balance_situation(traces[record], own))
    orders = orders_of(core, traces, of_balance(core, traces, quantities, process))
    late = skews(core, recorded)
    notes = [
        *(f"warning: {warning}" for warning in torque_warnings(core, traces)),
        *_said_of_balance(why, [q.name for q in quantities]),
        *_of_currents(recorded, traces),
        found.processing,
        *found.sample_lines(),
        "noise floor from single records (the sensors' noise carried through the balance): an "
        "estimate",
        *torque_notes(core, traces),
        *_clock_notes([clock_of(trace, name) for name, trace in traces.items()]),
        *once((s.message for s in late if s.significant), traces),
    ]
    where = [*where_it_fails(situations), *as_conditions(orders)]
    return Comparison(core.name, "balance", quantities, where, {}, {}, notes, orders, late)


def _said_of_balance(why: str, equations: Sequence[str]) -> list[str]:
    """That this is no simulated loop where nobody asked for the balance, and what its sum is."""
    total = "total is the sum of all bodies' equations of motion, carried to the table"
    known = [total] if "total" in equations else []
    balance = f"torque balance, for {why} to simulate the loop with" if why else ""
    return [": ".join(filter(None, (balance, *known)))] if balance or known else []


def _of_currents(recorded: Mapping[str, Trace], driven: Mapping[str, Trace]) -> list[str]:
    """Which torques no record holds: they are made from currents."""
    made = sorted({c for name, trace in driven.items() for c in trace if c not in recorded[name]})
    currents = ", ".join(f"I{torque[1:]}" for torque in made)
    return [f"{', '.join(made)}: {currents} times the motor's torque constant"] if made else []


def _apart(one: Residual, other: Residual) -> float:
    """What noise alone leaves of an equation, RMS, where both residuals count.

    Noise may move where a filter's ends are cut off, and the samples with it.
    """
    shaken, fitted = other.residual, other.fitted
    if len(one.t) != len(other.t) or one.t[0] != other.t[0]:
        within = (one.t >= other.t[0]) & (one.t <= other.t[-1])
        nearest = np.searchsorted(0.5 * (other.t[1:] + other.t[:-1]), one.t)
        shaken, fitted = np.interp(one.t, other.t, shaken), fitted[nearest] & within
    both = one.fitted & fitted
    return floor_of_noise(one.residual, shaken, both) if both.any() else float("nan")


def _balance_situation(trace: Trace, own: Quantity) -> Situation:
    for angle in ("theta_m", "theta_c1", "theta_1", "theta_ref"):
        if angle in trace:
            speed = np.gradient(np.interp(own.t, trace.t, trace[angle]), own.t)
            break
    else:
        speed = np.interp(own.t, trace.t, trace["omega_m" if "omega_m" in trace else "omega_1"])
    square = (own.residual / own.spread) ** 2
    load = _load(trace, own.t)
    return Situation(own.record, own.t, square, speed, {}, load, own.counted)

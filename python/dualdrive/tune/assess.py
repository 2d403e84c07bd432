"""The machine on its test move: the figures every step is judged by."""

from __future__ import annotations

import math

import numpy as np

from dualdrive import figures as run_figures
from dualdrive.assembly import gaps
from dualdrive.linear.contacts import closed
from dualdrive.linear.operating_point import operating_point
from dualdrive.linear.stability import worst_pole
from dualdrive.machine import Machine
from dualdrive.motion import Motion, default_motion, move
from dualdrive.run import Run
from dualdrive.simulation import simulate
from dualdrive.tune.edge import GAIN, find_edge, gain_range
from dualdrive.tune.errors import TuneError
from dualdrive.tune.result import Assessment
from dualdrive.tune.smooth import ripple

__all__ = ["assess", "begin_of", "play", "quiet", "usual_motion"]

_STEP = 1e-3
_QUIET = 0.02  # of the play: less is no hunting from flank to flank


def usual_motion(machine: Machine) -> Motion:
    """The machine's usual move with twice the time to settle, so that hunting is told from it.

    Its pace is that of the position loop; a gain beyond half the edge of vibration sets no pace.
    """
    calm = machine.copy()
    edge = find_edge(calm, GAIN, *gain_range(calm)).lowest
    if edge is not None:
        calm.core.set(GAIN, min(calm.get(GAIN), edge / 2.0))
    usual = default_motion(calm).arguments
    return move(**{**usual, "settle": 2.0 * usual["settle"]})


def begin_of(motion: Motion) -> float:
    """When the motion begins, s; before it the tension builds up."""
    knots = motion.waveform.knots()
    return float(knots[0]) if len(knots) else 0.0


def play(machine: Machine) -> float:
    """The largest full play of a mesh, in the table's frame, rad or m."""
    core = machine.core
    meshes = [name for name in gaps(core) if name.startswith("mesh_")]
    return max((2 * core.get(f"{m}.gap") / core.get(f"{m}.ratio") for m in meshes), default=0.0)


def quiet(machine: Machine, found: Assessment) -> bool:
    """Whether the table stands still after the move."""
    limit = _QUIET * play(machine)
    return found.stable and found.figures["hunting"] <= max(limit, 1e-9)


def assess(machine: Machine, motion: Motion) -> Assessment:
    """Poles while the table turns, and the figures of the simulated test move.

    The two may part: a vibration that grows in steady rotation may not show on a short move, at
    the end of which friction holds the table. Raises TuneError where a machine whose vibrations
    die out can't be simulated to the end of the move.
    """
    pole = worst_pole(machine, closed(machine), operating_point(machine, motion))
    stable = pole.real < 0.0
    run = simulate(machine, motion, output_step=_STEP, energy=False)
    if not run.ok and stable:
        raise TuneError(f"{machine.name}: the test move stops: {run.status}: {run.message}")
    figures = _figures(run, motion) if run.ok else {}
    hertz = abs(pole.imag) / math.tau
    return Assessment(stable, pole.real, hertz, figures, _units(machine), run if run.ok else None)


def _units(machine: Machine) -> dict[str, str]:
    angle = machine.unit_of("e", "rad")
    errors = dict.fromkeys(("following error, largest", "following error, RMS", "hunting"), angle)
    torques = [f"{what} {n}" for what in ("torque ripple", "torque RMS") for n in (1, 2)]
    return {**errors, **dict.fromkeys(torques, "N*m"), "flank changes": ""}


def _figures(run: Run, motion: Motion) -> dict[str, float]:
    begin = begin_of(motion)
    moving = run.t >= begin
    e = run["e"][moving]
    at_rest = (
        run.t
        >= run_figures.reductions(run.machine, motion, run.t[-1])["standstill_amplitude"].begin
    )
    found = {
        "following error, largest": float(np.abs(e).max()),
        "following error, RMS": float(np.sqrt(np.mean(e**2))),
        "hunting": float(np.ptp(run["e"][at_rest])) if at_rest.any() else 0.0,
    }
    pieces = motion.waveform.knots().tolist() or [begin]
    for n in (1, 2):
        found[f"torque ripple {n}"] = ripple(run.t, run[f"T_{n}"], pieces)
    for n in (1, 2):
        found[f"torque RMS {n}"] = float(np.sqrt(np.mean(run[f"T_{n}"][moving] ** 2)))
    plays = {name for name in run.elements if f"{name}.flank" in run}
    switches = [event for event in run.events if event.element in plays and event.t >= begin]
    found["flank changes"] = float(len(switches))
    return found

"""The play of a mesh, read from a trace: drive angle minus ring angle on either flank.

Where a drive pushes hard, its flank is closed and the deflection sits at one end of the play, plus
what bends under load, minus what a late sensor adds while the ring turns:

    θ_c − i_m θ_m = c + s P/2 − τ ω + κ T + noise,    s = sign(T)

with P the full play at zero torque, τ the time skew of the two angles and κ the compliance. Skew
must be in it: unaccounted for, it poses as a narrower or wider play that changes with speed. The
zero c belongs to the record, since counters are reset between records. A flank that stiffens under
load makes the straight line in T reach too far at T = 0, so the upper limit of the play is no less
than that of the distance between the loaded flanks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dualdrive.identify.contact import Reading, contacts, readings
from dualdrive.identify.play_fit import PlayFit
from dualdrive.identify.play_result import Cloud, Interval, PlayEstimate

_MOST = 20.0  # samples by which an angle may be late: more is another motion, not a delay
#: fewer contact episodes than this on a flank leave no interval worth the name
FEWEST = 2


def estimate_play(
    traces: Mapping[str, Any] | Sequence[Any] | Any,
    drive: int,
    *,
    mesh_ratio: float = 1.0,
    gear_ratio: float = 1.0,
    load: float | None = None,
    settle: float = 0.3,
    confidence: float = 0.95,
    draws: int = 4000,
    seed: int = 0,
) -> PlayEstimate:
    """Estimate the full play of one mesh from recorded angles and torques.

    Args:
        traces: one trace, several, or name -> trace, with ``t`` and ``channels`` in SI units: the
            ring's ``theta_m``, the drive's ``theta_c<n>`` (or motor ``theta_<n>``, divided by
            ``gear_ratio``) and its torque ``T_<n>``, positive where it drives forwards.
        drive: 1 to 8.
        mesh_ratio: i_m, turns of the pinion per turn of the ring.
        gear_ratio: i, turns of the motor per turn of the pinion.
        load: torque from which a flank counts as closed, N*m; 0.3 of the 95th percentile unless
            given. It must exceed what it takes to turn the drive inside the play.
        settle: seconds of one sign of torque before its flank counts as closed.
        confidence: of the intervals.
        draws: of the bootstrap.
        seed: of the bootstrap.

    Returns:
        The play with an interval, or with a lower bound where only one flank was ever loaded.

    Raises:
        ValueError: a channel is missing, time does not rise, or the drive never pushes.

    """
    read = readings(traces, drive, mesh_ratio, gear_ratio)
    pushed = np.concatenate([r.torque for r in read])
    limit = 0.3 * float(np.quantile(np.abs(pushed), 0.95)) if load is None else load
    episodes = contacts(read, limit, settle)
    if not episodes:
        raise ValueError(
            f"play of mesh {drive}: no {settle:g} s of torque beyond {limit:.3g} N*m in one "
            "direction; lower load or settle, or record a load on the drive"
        )
    flanks = {flank: sum(e.flank == flank for e in episodes) for flank in (-1, 1)}
    fit = PlayFit(episodes, both=min(flanks.values()) >= FEWEST)

    def interval(name: str) -> Interval:
        return fit.interval(name, confidence, fit.draws(name, draws, seed))

    untold = Interval(np.nan, -np.inf, np.inf)
    skew, zero = interval("skew") if fit.told("skew") else untold, fit.zero()
    shared: dict[str, Any] = {
        "drive": drive,
        "skew": skew,
        "zero": zero,
        "torque": fit.torque,
        "episodes": episodes,
        "cloud": _cloud(read, _late(skew), zero),
        "scatter": fit.scatter,
        "samples": (sum(len(e.deflection) for e in episodes), sum(len(r.t) for r in read)),
    }
    if fit.both:
        full, loaded = interval("play"), interval("loaded")
        return PlayEstimate(
            status="estimated",
            full=Interval(full.value, full.low, max(full.high, loaded.high)),
            loaded=loaded,
            compliance=interval("compliance"),
            draws=fit.draws("play", draws, seed),
            note=f"{flanks[1]} contacts on the front flank, {flanks[-1]} on the back flank",
            **shared,
        )
    seen = max(_travel(r, skew, limit, fit.spread) for r in read)
    only = "front" if flanks[1] > flanks[-1] else "back"
    return PlayEstimate(
        status="bounded",
        full=Interval(np.nan, seen, np.inf),
        loaded=None,
        compliance=None,
        draws=np.zeros(0),
        note=f"cannot be identified, only a lower bound: settled load on the {only} flank alone",
        **shared,
    )


def _late(skew: Interval) -> float:
    """The skew in s, none where the trace does not tell it."""
    return skew.value if np.isfinite(skew.value) else 0.0


def _cloud(read: Sequence[Reading], skew: float, zero: Mapping[str, float]) -> Cloud:
    """Every sample, free of skew and of its record's zero."""
    return Cloud(
        np.concatenate([r.torque for r in read]),
        np.concatenate([r.deflection + skew * r.speed - zero.get(r.record, 0.0) for r in read]),
    )


def _travel(reading: Reading, skew: Interval, limit: float, spread: float) -> float:
    """How far the unloaded drive was seen to move against the ring: a lower bound of the play.

    Counted where the ring is slow enough for the skew to be known within a step of the angle, as a
    running median over 0.1 s. What runout and noise can feign, read off the loaded flank, and one
    step are taken off.
    """
    from scipy.ndimage import median_filter

    unsure = (skew.high - skew.low) / 2 if np.isfinite(skew.value) else _MOST * reading.step
    slow = np.abs(reading.speed) * unsure <= reading.quantum
    free = (np.abs(reading.torque) < limit) & slow
    if free.sum() < 2:
        return 0.0
    window = 2 * max(1, round(0.05 / reading.step)) + 1
    smooth = median_filter(reading.deflection + _late(skew) * reading.speed, window)[free]
    return max(0.0, float(np.ptp(smooth)) - reading.quantum - spread)

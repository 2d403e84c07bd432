"""Figure 2: how two motors share the torque through stages 0 to 8."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualdrive.motion import Motion, move, step
from dualdrive.paper import slave_lag
from dualdrive.paper.exhibit import Claim, Exhibit, Table, verdict
from dualdrive.paper.flanks import flanks_since
from dualdrive.paper.settings import ARCSEC, heavy_table, simulated
from dualdrive.paper.slave_lag import SlaveLag
from dualdrive.run import Run

__all__ = ["LIMIT", "TENSION", "Figure2", "Stage", "figure2", "shared", "stage_totals"]

Array = NDArray[np.float64]

#: N m at the motor: limit and tension of the figure
LIMIT: Final = 100.0
TENSION: Final = 60.0
#: (t in s, part of the largest torque both motors have): there, back, and the other way
_RAMP: Final = ((0.0, 0.0), (3.0, 0.0), (23.0, 0.97), (43.0, 0.0), (63.0, -0.97), (83.0, 0.0))
_SIGNALS: Final = [
    "T_1", "T_2", "theta_m", "theta_ref", "omega_m", "e", "tension",
    "mesh_1.flank", "mesh_2.flank", "mesh_1.deflection", "mesh_2.deflection",
]  # fmt: skip


class Stage(NamedTuple):
    """A located stage of a run: its number in the paper, when, and both motor torques, N m."""

    number: int
    t: float
    T_1: float
    T_2: float
    error: float


@dataclass(frozen=True)
class Figure2:
    """What the picture is drawn from.

    ramp:   550 t held at rest against a slow load, through all stages
    move:   550 t through a move
    stages: of the ramp, as located
    lag:    what a slave lag does
    """

    ramp: Run
    move: Run
    stages: tuple[Stage, ...]
    lag: SlaveLag


def shared(total: ArrayLike, tension: float, limit: float) -> tuple[Array, Array]:
    """Both motor torques at rest for a given sum, N m: the law of figure 2.

    The equaliser holds T_1 - T_2 = tension until a motor reaches its limit; from there the other
    one takes all that is added. Derived; valid for equal weights (w = 1/2) and |total| <= 2 limit.
    """
    whole = np.asarray(total, dtype=np.float64)
    low = np.maximum(-limit, whole - limit)
    high = np.minimum(limit, whole + limit)
    first = np.clip((whole + tension) / 2.0, low, high)
    return first, whole - first


def stage_totals(tension: float, limit: float) -> dict[int, float]:
    """Stage -> sum of both torques, N m. 1 and 5 lie anywhere between their neighbours."""
    ends = {0: 0.0, 1: tension / 2.0, 2: tension, 3: 2.0 * limit - tension, 4: 2.0 * limit}
    return ends | {stage + 4: -total for stage, total in ends.items() if stage}


def figure2() -> Exhibit:
    """Reproduce figure 2 as a static law and as two runs; show what the slave's lag does."""
    strong = {"motors.T_max": LIMIT, "controller.T_ten": TENSION}
    ramp = _ramp(strong)
    data = Figure2(
        ramp=ramp,
        move=_run("550t", strong, move(0.04, 0.05, 0.03, 0.06, start=2.0, end=14.0)),
        stages=_located(ramp),
        lag=slave_lag.lagging(),
    )
    return Exhibit(
        name="fig2",
        title="Figure 2: torques of both motors through stages 0 to 8",
        about=(
            "From the paper's text, which tells both torques M1 and M2 stage by stage. Here they "
            "are a law "
            "of the torque sum, a run that holds the table against a slowly rising load, and "
            "a run through a move."
        ),
        chosen=(
            f"heavy table with 550 t, motors limited to {LIMIT:g} N·m, tension {TENSION:g} N·m "
            "(each motor ± 30 N·m)",
            "slow load: to 97 % of what both motors have, either way, in 20 s each",
            "move: 0.04 rad, 0.05 rad/s, 0.03 rad/s², 0.06 rad/s³ from 2 s",
            slave_lag.CHOSEN,
        ),
        claims=(
            *_stage_claims(data),
            _move_claim(data.move),
            slave_lag.claim(data.lag),
        ),
        tables=(_stage_table(data), slave_lag.table(data.lag)),
        notes=(
            "Motor torques lie 2 N·m off the law where pinion friction (300 N·m, 2 at the motor) "
            "has to be overcome: stage 2 is where the flank opens, M2 then still holds the "
            "pinion's friction.",
            "From stage 3 on the master's limit keeps the torque difference below the tension. "
            "The equaliser's integral then runs to its limit Ω_E and holds the table off its "
            f"command by Ω_E / (i_m K_v) = {_offset() / ARCSEC:.0f}″. The paper "
            "does not mention it.",
        ),
        data=data,
    )


def _run(load: str, numbers: Mapping[str, float], motion: Motion) -> Run:
    return simulated(heavy_table(load, numbers), motion, signals=_SIGNALS)


def _ramp(numbers: Mapping[str, float]) -> Run:
    """The table held at rest; the load rises so slowly that inertia has no part in it."""
    machine = heavy_table("550t", numbers)
    to_table = machine.get("gearbox_1.ratio") * machine.get("mesh_1.ratio")
    times, parts = np.array(_RAMP).T
    load = (times, parts * 2.0 * LIMIT * to_table)
    end = float(times[-1]) + 2.0
    return simulated(
        machine, step(0.0, settle=end), load=load, end=end, signals=_SIGNALS, output_step=5e-3
    )  # fmt: skip


def _located(run: Run) -> tuple[Stage, ...]:
    """Where the slow run passes the paper's stages: flanks that open, limits that are met."""
    top, bottom = int(np.argmax(run["T_1"] + run["T_2"])), int(np.argmin(run["T_1"] + run["T_2"]))
    at = {
        0: _RAMP[1][0],
        2: _first(run, "mesh_2", "gap", since=_RAMP[1][0]),
        3: _first(run, "controller.speed_1", "high"),
        4: float(run.t[top]),
        6: _first(run, "mesh_1", "gap", since=_RAMP[3][0]),
        7: _first(run, "controller.speed_2", "low"),
        8: float(run.t[bottom]),
    }
    return tuple(_stage(run, number, t) for number, t in at.items() if t is not None)


def _stage(run: Run, number: int, t: float) -> Stage:
    first, second, error = (float(np.interp(t, run.t, run[n])) for n in ("T_1", "T_2", "e"))
    return Stage(number, t, first, second, error)


def _first(run: Run, element: str, mode: str, since: float = 0.0) -> float | None:
    return next((e.t for e in run.events if e[1::2] == (element, mode) and e.t >= since), None)


def _stage_claims(data: Figure2) -> tuple[Claim, ...]:
    """What the slow run shows."""
    at = {stage.number: stage for stage in data.stages}
    run = data.ramp
    rising = (run.t >= at[3].t) & (run.t <= at[4].t)
    held = float(np.ptp(run["T_1"][rising]))
    closed = _first(run, "mesh_2", "front", since=at[2].t)
    begin = flanks_since(run, at[0].t)[0]
    mirrored = [(a, b) for a, b in ((2, 6), (3, 7), (4, 8))]
    apart = max(abs(at[a].T_1 + at[b].T_2) for a, b in mirrored)
    return (
        Claim(
            "0: torques equal and opposite, gears on opposite flanks",
            f"{at[0].T_1:.1f} and {at[0].T_2:.1f} N·m, flanks {begin}",
            verdict(abs(at[0].T_1 + at[0].T_2) < 0.5, begin == (1, -1)),
        ),
        Claim(
            "0-1-2: M1 rises, M2 falls to zero",
            f"M1 {at[0].T_1:.0f} → {at[2].T_1:.0f}, M2 {at[0].T_2:.0f} → {at[2].T_2:+.0f} N·m",
            verdict(at[2].T_1 > at[0].T_1 and abs(at[2].T_2) < 3.0),
        ),
        Claim(
            "2-3: M1 rises on, gear 2 meshes on its other flank and drives too",
            f"flank closes {_after(closed, at[2].t)} s later; stage 3 with M1 {at[3].T_1:.0f}, "
            f"M2 {at[3].T_2:.0f} N·m",
            verdict(closed is not None and closed < at[3].t, at[3].T_2 > 0),
        ),
        Claim(
            "3-4: M1 unchanged, M2 rises",
            f"M1 within {held:.3f} N·m of {LIMIT:g}, M2 {at[3].T_2:.0f} → {at[4].T_2:.0f} N·m",
            verdict(held < 0.5, at[4].T_2 > at[3].T_2),
        ),
        _falling(run, at[4].t),
        Claim(
            "5 to 8: the same with the roles exchanged",
            f"M1 at 2, 3, 4 and −M2 at 6, 7, 8 within {apart:.3f} N·m",
            verdict(apart < 0.5),
        ),
    )


def _move_claim(run: Run) -> Claim:
    met, first, second = flanks_since(run, 1.9)[:3], run["T_1"], run["T_2"]
    return Claim(
        "accelerating, the pair goes through 0 to 4",
        f"flanks {' → '.join(map(str, met))}; M1 to {first.max():.1f}, M2 to "
        f"{second.max():.1f} N·m; braking, {first.min():.1f} and {second.min():.1f} N·m",
        verdict(met == [(1, -1), (1, 0), (1, 1)], first.max() > LIMIT - 0.1),
    )


def _falling(run: Run, top: float) -> Claim:
    """The way back from stage 4: until the load is gone."""
    back = (run.t >= top) & (run.t <= _RAMP[3][0])
    leaves = _first(run, "controller.speed_1", "linear", since=top)
    total = float(np.interp(leaves or top, run.t, run["T_1"] + run["T_2"]))
    law = stage_totals(TENSION, LIMIT)[3]
    return Claim(
        "4-2-0: both fall, M1 never below M2, gear 2 changes back",
        f"so it is, but M1 leaves its limit only where both give {total:.0f} N·m ({law:.0f} by the "
        "law): the equaliser first has to come off its own limit",
        verdict(bool((run["T_1"] >= run["T_2"])[back].all()), abs(total - law) < 2.0),
    )


def _stage_table(data: Figure2) -> Table:
    totals = stage_totals(TENSION, LIMIT)
    rows = []
    for s in data.stages:
        first, second = shared(totals[s.number], TENSION, LIMIT)
        here = s.T_1 - float(shared(s.T_1 + s.T_2, TENSION, LIMIT)[0])
        row = (float(first), float(second), s.T_1, s.T_2, round(here, 2), s.error / ARCSEC)
        rows.append((str(s.number), *row))
    columns = (
        "stage", "law T_1 [N·m]", "law T_2", "run T_1", "run T_2",
        "run T_1 off the law of its own sum", "table behind [″]",
    )  # fmt: skip
    title = "Stages: the law, and the slow run (whose load ends at 97 % of stages 4 and 8)"
    return Table(title, columns, tuple(rows))


def _after(t: float | None, since: float) -> str:
    return "never" if t is None else f"{t - since:.2f}"


def _offset() -> float:
    """The table's offset while the equaliser stands on its limit, rad."""
    machine = heavy_table("550t")
    limit, gain = machine.get("controller.Omega_E"), machine.get("controller.K_v")
    return limit / (machine.get("mesh_1.ratio") * gain)

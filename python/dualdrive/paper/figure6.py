"""Figure 6: torques of master and slave under tension, before and after tuning."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from dualdrive.machine import Machine
from dualdrive.motion import Motion, move
from dualdrive.paper.exhibit import Claim, Exhibit, Table, verdict
from dualdrive.paper.flanks import flanks_since
from dualdrive.paper.response import Oscillation, oscillation
from dualdrive.paper.settings import ARCSEC, heavy_table, short, simulated
from dualdrive.run import Run

__all__ = ["REST", "Figure6", "figure6"]

#: s: the end of the run, over which the table is looked at at rest
REST: Final = 2.0
_STEP: Final = 5e-4  # s between samples: vibrations of 100 Hz are counted
#: N m and rad: what counts as no oscillation, 0.1 % of a motor's rated torque
FLOOR_TORQUE, FLOOR_ANGLE = 0.1, 0.01 * ARCSEC
LATE: Final = "M1 and M2 under tension, MD37256 too high"
TUNED: Final = "M1 and M2 under tension, adjusted"
HIGH_GAIN: Final = "K_v 16/s"
UNTUNED: Final = "equaliser gain 0"
#: s: sample time of the torque equaliser, and as much to compute; the paper says neither
SAMPLE: Final = 3e-3
GAINS: Final = (0.05, 0.2, 0.5, 1.0, 2.0)
TIMES: Final = (0.0, 0.03, 0.1, 0.5)


@dataclass(frozen=True)
class Figure6:
    """What the picture is drawn from.

    runs:     panels (a) and (b): state of tuning -> the same move of the 550 t table
    others:   other ways for a table to vibrate -> the same
    settings: (equaliser gain, its integral time in s) -> the same
    """

    runs: Mapping[str, Run]
    others: Mapping[str, Run]
    settings: Mapping[tuple[float, float], Run]


def figure6() -> Exhibit:
    """Reproduce figure 6 with 550 t: step (7), the equaliser's gain too high and then adjusted."""
    start = _equalised(2.0, 0.1)
    after, how = _tuned(start)
    data = Figure6(
        runs={LATE: _run(start), TUNED: _run(after)},
        others={
            HIGH_GAIN: _run(heavy_table("550t", {"controller.K_v": 16.0})),
            UNTUNED: _run(heavy_table("550t", {"controller.g_E": 0.0})),
        },
        settings={(gain, time): _run(_equalised(gain, time)) for gain in GAINS for time in TIMES},
    )
    return Exhibit(
        name="fig6",
        title="Figure 6: torques of master and slave, before and after tuning",
        about=(
            "From the paper's text: a trace of both torques in tension condition, (a) "
            "fluctuating and "
            "(b) after the equaliser's gain MD37256 and integral time MD37258 were changed until "
            "it "
            "is smooth. Here the same move of the heaviest table in both states."
        ),
        chosen=(
            "heavy table with 550 t; 0.02 rad, 0.03 rad/s, 0.01 rad/s², 0.05 rad/s³ from 2 s",
            f"the equaliser is computed every {1e3 * SAMPLE:g} ms and put out as much later, as "
            "in a "
            "control of that time; a continuous one vibrates at no gain",
            "(a): tension 60 N·m, equaliser gain g_E 2, twice what small gain allows",
            f"(b): {how}",
        ),
        claims=_claims(data),
        tables=(_states(data), _map(data)),
        notes=(
            "What vibrates in (a) is the loop of the equaliser through both drives: from g_E 2 "
            "on it "
            "is unstable at a quarter of its sampling rate, and grows until the limits of torque "
            "and flanks hold it. The table itself moves slowly, if at all, at that frequency.",
            "Other ways to vibrate are not the paper's step (7): at K_v 16/s the position loop "
            "is at "
            "its edge; with the equaliser off there is no tension, and the table hunts.",
        ),
        data=data,
    )


def _tuned(start: Machine) -> tuple[Machine, str]:
    """The machine after the commissioning steps, and which numbers they set."""
    from dualdrive.tune import tune

    machine = tune(start, _motion()).machine
    how = "`dualdrive tune`, steps (1) to (8), for this move from the state before"
    return machine, f"{how}: {_numbers(machine)}"


def _numbers(machine: Machine) -> str:
    def value(name: str) -> float:
        return machine.get(f"controller.{name}")

    return (
        f"K_v {value('K_v'):.3g}/s, k_p {short(value('k_p'))} N·m·s/rad, "
        f"T_N {value('T_N'):.3g} s, tension {value('T_ten'):.3g} N·m, "
        f"g_E {value('g_E'):.3g}, T_E {value('T_E'):.3g} s"
    )


def _equalised(gain: float, time: float) -> Machine:
    clock = {f"controller.tension_{what}": SAMPLE for what in ("sample", "latency")}
    return heavy_table("550t", {"controller.g_E": gain, "controller.T_E": time, **clock})


def _motion() -> Motion:
    return move(0.02, 0.03, 0.01, 0.05, start=2.0, end=14.0)


def _run(machine: Machine) -> Run:
    signals = ["T_1", "T_2", "e", "theta_m", "theta_ref", "omega_m", "mesh_1.flank", "mesh_2.flank"]
    return simulated(machine, _motion(), signals=signals, output_step=_STEP)


def _torque(run: Run) -> Oscillation:
    return oscillation(run.t, run["T_1"], REST, FLOOR_TORQUE)


def _angle(run: Run) -> Oscillation:
    return oscillation(run.t, run["theta_m"], REST, FLOOR_ANGLE)


def _claims(data: Figure6) -> tuple[Claim, Claim]:
    before, after = (_torque(data.runs[name]) for name in (LATE, TUNED))
    table, still = (_angle(data.runs[name]) for name in (LATE, TUNED))
    changes = len(flanks_since(data.runs[TUNED], 2.0)) - 1
    moved = f"{table.frequency:.2f} Hz" if table.frequency else "no single frequency"
    return (
        Claim(
            "the torque fluctuates at the frequency at which the C axis vibrates",
            f"torque {_size(before)} N·m at {before.frequency:.1f} Hz; table "
            f"{_size(table, ARCSEC)}″, "
            f"{moved}: the drives vibrate against each other, the table hardly follows",
            verdict(
                before.amplitude > FLOOR_TORQUE,
                abs(before.frequency - table.frequency) < 0.01 * before.frequency,
            ),
        ),
        Claim(
            "with MD37256 and MD37258 adjusted, the torques are smooth",
            f"torque at rest {_size(before)} N·m before, {_size(after)} after; table "
            f"{_size(table, ARCSEC)}″ before, {_size(still, ARCSEC)}″ after; in the move {changes} "
            "flank changes",
            verdict(after.amplitude < FLOOR_TORQUE, still.amplitude < FLOOR_ANGLE, changes == 0),
        ),
    )


def _size(swing: Oscillation, unit: float = 1.0) -> str:
    return f"± {swing.amplitude / unit:.2f}"


def _states(data: Figure6) -> Table:
    rows: list[tuple[float | str | None, ...]] = [
        (name, *_row(run)) for name, run in {**data.runs, **data.others}.items()
    ]
    return Table("Before and after", ("state", *_COLUMNS), tuple(rows))


def _map(data: Figure6) -> Table:
    rows: list[tuple[float | str | None, ...]] = [
        (gain, f"{1e3 * time:g}" if time else "off", *_row(run))
        for (gain, time), run in data.settings.items()
    ]
    return Table(f"Step (7): MD37256 as g_E and MD37258 as T_E, 60 N·m, every {1e3 * SAMPLE:g} ms",
                 ("g_E", "T_E [ms]", *_COLUMNS), tuple(rows))  # fmt: skip


_COLUMNS = (
    "torque at rest, ± [N·m]",
    "frequency [Hz]",
    "table at rest, ± [″]",
    "T_1 − T_2 at rest [N·m]",
    "RMS error in the move [″]",
    "flank changes",
)


def _row(run: Run) -> tuple[float, ...]:
    torque, angle = _torque(run), _angle(run)
    rest = run.t >= run.t[-1] - REST
    moving = (run.t >= 2.0) & ~rest
    return (
        round(torque.amplitude, 2),
        torque.frequency,
        round(angle.amplitude / ARCSEC, 2),
        round(float(np.mean((run["T_1"] - run["T_2"])[rest])), 1),
        float(np.sqrt(np.mean(run["e"][moving] ** 2))) / ARCSEC,
        float(len(flanks_since(run, 2.0)) - 1),
    )

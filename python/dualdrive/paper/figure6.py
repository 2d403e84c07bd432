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
#: N m and rad: what counts as no oscillation, 0.1 % of a motor's rated torque
FLOOR_TORQUE, FLOOR_ANGLE = 0.1, 0.01 * ARCSEC
UNTUNED: Final = "equaliser gain 0"
HIGH_GAIN: Final = "tension on, K_v 16/s"
TUNED: Final = "tuned"
GAINS: Final = (0.05, 0.2, 0.5, 1.0, 2.0)
TIMES: Final = (0.0, 0.03, 0.1, 0.5)


@dataclass(frozen=True)
class Figure6:
    """What the picture is drawn from.

    runs:     state of tuning -> the same move of the 550 t table
    settings: (equaliser gain, its integral time in s) -> the same
    """

    runs: Mapping[str, Run]
    settings: Mapping[tuple[float, float], Run]


def figure6() -> Exhibit:
    """Reproduce figure 6 with 550 t, where the table hunts without tension."""
    start = heavy_table("550t", {"controller.g_E": 0.0})
    after, how = _tuned(start)
    data = Figure6(
        runs={
            UNTUNED: _run(start),
            HIGH_GAIN: _run(heavy_table("550t", {"controller.K_v": 16.0})),
            TUNED: _run(after),
        },
        settings={(gain, time): _run(_equalised(gain, time)) for gain in GAINS for time in TIMES},
    )
    return Exhibit(
        name="fig6",
        title="Figure 6: torques of master and slave, before and after tuning",
        about=(
            "The paper shows two screens of a drive's trace, without scales: torques that vibrate, "
            "then smooth ones. Here the same move of the heaviest table in three states."
        ),
        chosen=(
            "heavy table with 550 t; 0.02 rad, 0.03 rad/s, 0.01 rad/s², 0.05 rad/s³ from 2 s",
            "before: MD37256 (equaliser gain) 0, as step (7) begins, tension 60 N·m set in vain",
            "before, with tension: position gain 16/s, at the edge of vibration of step (4)",
            f"after: {how}",
        ),
        claims=_claims(data),
        tables=(_states(data), _map(data)),
        notes=(
            "Once tension is on, this model is smooth at rest over a wide range of MD37256 and "
            "MD37258: the pair decides how fast the tension comes back after a flank change, not "
            "whether the table stands still.",
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
    return heavy_table("550t", {"controller.g_E": gain, "controller.T_E": time})


def _motion() -> Motion:
    return move(0.02, 0.03, 0.01, 0.05, start=2.0, end=14.0)


def _run(machine: Machine) -> Run:
    signals = ["T_1", "T_2", "e", "theta_m", "theta_ref", "omega_m", "mesh_1.flank", "mesh_2.flank"]
    return simulated(machine, _motion(), signals=signals)


def _torque(run: Run) -> Oscillation:
    return oscillation(run.t, run["T_1"], REST, FLOOR_TORQUE)


def _angle(run: Run) -> Oscillation:
    return oscillation(run.t, run["theta_m"], REST, FLOOR_ANGLE)


def _claims(data: Figure6) -> tuple[Claim, Claim]:
    pairs = {name: (_torque(run), _angle(run)) for name, run in data.runs.items()}
    before = [pairs[UNTUNED], pairs[HIGH_GAIN]]
    after = pairs[TUNED]
    changes = len(flanks_since(data.runs[TUNED], 2.0)) - 1
    same = [t.frequency > 0 and abs(t.frequency - a.frequency) < 0.01 for t, a in before]
    found = ", ".join(f"{t.frequency:.2f} and {a.frequency:.2f} Hz" for t, a in before)
    return (
        Claim(
            "the torque fluctuates at the frequency at which the C axis vibrates",
            f"torque and table angle: {found}",
            verdict(*same),
        ),
        Claim(
            "tuned, the torques are smooth",
            f"torque at rest {_size(before[0][0])} and {_size(before[1][0])} N·m before, "
            f"{_size(after[0])} after; table {_size(before[0][1], ARCSEC)} and "
            f"{_size(before[1][1], ARCSEC)}″ before, {_size(after[1], ARCSEC)}″ after; in the move "
            f"{changes} flank changes",
            verdict(
                after[0].amplitude < FLOOR_TORQUE, after[1].amplitude < FLOOR_ANGLE, changes == 0
            ),
        ),
    )


def _size(swing: Oscillation, unit: float = 1.0) -> str:
    return f"± {swing.amplitude / unit:.2f}"


def _states(data: Figure6) -> Table:
    rows: list[tuple[float | str | None, ...]] = [
        (name, *_row(run)) for name, run in data.runs.items()
    ]
    return Table("Before and after", ("state", *_COLUMNS), tuple(rows))


def _map(data: Figure6) -> Table:
    rows: list[tuple[float | str | None, ...]] = [
        (gain, f"{1e3 * time:g}" if time else "off", *_row(run))
        for (gain, time), run in data.settings.items()
    ]
    return Table("Step (7): equaliser gain and integral time, 60 N·m",
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

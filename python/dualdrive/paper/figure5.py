"""Figure 5: unit step and sine after tuning, in two readings of where time begins."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import degrees, pi
from typing import Final, NamedTuple

from dualdrive.machine import Machine
from dualdrive.motion import sine, step
from dualdrive.paper.exhibit import Exhibit, Number, Table
from dualdrive.paper.response import Sine, Step, sine_response, step_response
from dualdrive.paper.settings import STEP, UNIT_SINE_HZ, frictionless, simulated
from dualdrive.run import Run

__all__ = ["PRINTED", "READINGS", "Figure5", "Reading", "figure5"]

#: s of tensioning before the step, and the end of the run
TENSIONING, END = 3.0, 13.0

PRINTED: Final = {
    "delay time t_d": 1.243,
    "rise time t_r": 1.557,
    "settling time t_s": 3.1,
    "overshoot": 17.0,
    "oscillations N": 2.0,
}
_UNITS: Final = ("s", "s", "s", "%", "")


class Reading(NamedTuple):
    """Where the printed times begin, and the gains that go with it.

    lead: s from there to the step
    """

    name: str
    text: str
    lead: float
    K_v: float
    K_i: float
    K_d: float
    k_p: float


READINGS: Final = (
    Reading(
        "H2", "time runs from 1 s before the step, as where a step block steps at 1 s",
        1.0, 7.66, 0.054, 1.446, 6580.0,
    ),
    Reading(
        "H1", "time runs from a command that reaches the drives after 0.877 s of dead time",
        0.877, 3.707, 0.046, 0.0, 16214.0,
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Figure5:
    """What the picture is drawn from, each by the name of its reading.

    steps: time counts from the step's tensioning (the step is at 3 s); sines from rest
    """

    steps: Mapping[str, Run]
    sines: Mapping[str, Run]


def figure5() -> Exhibit:
    """Reproduce figure 5 beside its five printed numbers."""
    data = Figure5(
        steps={reading.name: _step(reading) for reading in READINGS},
        sines={reading.name: _sine(reading) for reading in READINGS},
    )
    return Exhibit(
        name="fig5",
        title="Figure 5: step and sine after tuning",
        about=(
            "From the paper's text, which prints rise 1.557 s, delay 1.243 s, settling 3.1 s, "
            "overshoot "
            "17 % and two oscillations, and no gain. A second-order step of 17 % overshoot is at "
            "half after 0.54 of its rise "
            "time; the printed one after 0.80. So time must begin before the step; two ways fit."
        ),
        chosen=(
            *(f"{r.name}: {r.text}" for r in READINGS),
            *(f"fitted, {r.name}: {_law(r)}" for r in READINGS),
            f"empty heavy table, {STEP * 1e3:g} mrad after {TENSIONING:g} s of tensioning, no dry "
            "friction, no feed-forward, T_N off, T_E 0.1 s, g_E 0.5, τ_t 0.05 s, τ_d 0.02 s, "
            "Ω_E 0.2 rad/s, motors to 157 rad/s (Ω_max 1.047 rad/s)",
            "delay to 50 %, rise from 0 to 100 %, settling within ± 2 %, N crossings of the final "
            "value before that; percentages of the step",
        ),
        numbers=tuple(_numbers(READINGS[0], data)),
        fitted=4,
        tables=(_other(data), _from_the_step(data), _tension(data), _sines(data)),
        notes=(
            "Printed are five numbers, and four gains of each reading were searched for with "
            "them as "
            "the target: that they fit shows that the model can do it, not that the paper's "
            "machine "
            "had them. Other inertias would give other gains.",
            "It is not the machine of figure 4 with other gains of the position loop: the speed "
            "loop "
            "has another gain and no integral, and there is tension.",
            "H2 is preferred: it needs no dead time of which the paper says nothing.",
            "The limit Ω_E caps the tension that the equaliser reaches without T_N: 2 k_p Ω_E / i.",
        ),
        data=data,
    )


def _law(r: Reading) -> str:
    return f"K_v {r.K_v:g}/s, K_i {r.K_i:g}/s², K_d {r.K_d:g}, k_p {r.k_p:g} N·m·s/rad"


def figures(reading: Reading, run: Run) -> Step:
    """The figures of the step in this reading of time."""
    k = run.t >= TENSIONING
    return step_response(run.t[k] - TENSIONING + reading.lead, run["theta_m"][k], STEP)


def _step(reading: Reading) -> Run:
    motion = step(STEP, at=TENSIONING)
    signals = ["theta_ref", "theta_m", "T_1", "T_2"]
    return simulated(_machine(reading), motion, end=END, signals=signals)


def _sine(reading: Reading) -> Run:
    motion = sine(STEP, UNIT_SINE_HZ, start=TENSIONING, periods=6)
    signals = ["theta_ref", "theta_m"]
    return simulated(_machine(reading), motion, signals=signals)


def _machine(reading: Reading) -> Machine:
    return frictionless(
        K_v=reading.K_v, K_i=reading.K_i, K_d=reading.K_d, tau_d=0.02, k_p=reading.k_p, T_N=0.0,
        g_E=0.5, T_E=0.1, tau_t=0.05, Omega_E=0.2, f_v=0.0,
    )  # fmt: skip


def _numbers(reading: Reading, data: Figure5) -> list[Number]:
    found = figures(reading, data.steps[reading.name])
    crossings = None if found.crossings is None else float(found.crossings)
    values = (found.delay, found.rise, found.settling, 100.0 * found.overshoot, crossings)
    return [
        Number(what, unit, printed, value, f"{reading.name}: four gains fitted to these five")
        for (what, printed), unit, value in zip(PRINTED.items(), _UNITS, values, strict=True)
    ]


def _other(data: Figure5) -> Table:
    """The five printed numbers in the other reading."""
    rows = tuple(
        (f"{n.what} [{n.unit}]" if n.unit else n.what, n.printed, n.found)
        for n in _numbers(READINGS[1], data)
    )
    return Table(
        f"The same five in the other reading, {READINGS[1].name}, its four gains fitted too",
        ("", "printed", "here"),
        rows,
    )


def _from_the_step(data: Figure5) -> Table:
    """The same responses with time counted from the step, as is usual."""
    rows = []
    for r in READINGS:
        s = figures(r._replace(lead=0.0), data.steps[r.name])
        rows.append((r.name, s.delay, s.rise, s.settling))
    columns = ("reading", "delay [s]", "rise [s]", "settling [s]")
    return Table("The same steps, time counted from the step itself", columns, tuple(rows))


def _tension(data: Figure5) -> Table:
    """The tension reached just before the step, beside the cap that Omega_E sets."""
    rows = []
    for r in READINGS:
        run = data.steps[r.name]
        k = int((run.t < TENSIONING).sum()) - 1
        rows.append((r.name, float(run["T_1"][k] - run["T_2"][k]), 2.0 * r.k_p * 0.2 / 150.0))
    columns = ("reading", "T_1 − T_2 before the step [N·m]", "cap 2 k_p Ω_E / i [N·m]")
    return Table("Tension reached", columns, tuple(rows))


def _sines(data: Figure5) -> Table:
    answers = {name: _answer(run) for name, run in data.sines.items()}
    rows = ((name, a.gain, degrees(a.lag), a.peak) for name, a in answers.items())
    columns = ("reading", "gain", "lag [°]", "peak")
    return Table(f"Sine of 1 rad/s ({1 / (2 * pi):.3f} Hz)", columns, tuple(rows))


def _answer(run: Run) -> Sine:
    return sine_response(run.t - TENSIONING, run["theta_m"], STEP, UNIT_SINE_HZ, 3)

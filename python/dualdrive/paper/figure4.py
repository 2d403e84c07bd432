"""Figure 4: unit step and sine before tuning, with and without backlash."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import degrees
from typing import Final

from dualdrive.motion import sine, step
from dualdrive.paper import limit_cycle
from dualdrive.paper.exhibit import Claim, Exhibit, Table, verdict
from dualdrive.paper.limit_cycle import Lasting
from dualdrive.paper.response import (
    Oscillation,
    Sine,
    Step,
    oscillation,
    sine_response,
    step_response,
)
from dualdrive.paper.settings import ARCSEC, GAP_HALF, STEP, UNIT_SINE_HZ, simulated, untuned
from dualdrive.run import Run

__all__ = ["Figure4", "Swing", "figure4"]

#: 1/s; the gain at which the picture is drawn
GAIN: Final = 6.0
GAINS: Final = (1.0, 2.0, 4.0, 6.0, 8.0, 10.0)
GAPS: Final = (0.275e-3, 0.55e-3, 1.1e-3, 2.2e-3, 4.4e-3)
TENSIONS: Final = (0.0, 3.0, 3.35, 3.5, 5.0)
SINE_GAINS: Final = (2.0, 6.0)
SINES_HZ: Final = (0.05, 0.1, UNIT_SINE_HZ, 0.5, 1.0)
#: s, of 30 s; below the floor (rad) nothing oscillates
LAST, END, FLOOR = 10.0, 30.0, 0.01 * ARCSEC


@dataclass(frozen=True)
class Swing:
    """What a step sets going: its figures, and what is left of it after twenty seconds."""

    step: Step
    left: Oscillation


@dataclass(frozen=True)
class Figure4:
    """What the picture is drawn from.

    steps, sines: without (False) and with (True) backlash, at GAIN
    plain, played: gain -> step without and with backlash
    lasting:      gain -> whether its limit cycle is stable
    gaps:         half gap -> step at GAIN
    tensions:     N m -> step at GAIN
    answers:      (gain, frequency in Hz) -> answer to a sine without and with backlash
    """

    steps: Mapping[bool, Run]
    sines: Mapping[bool, Run]
    plain: Mapping[float, Swing]
    played: Mapping[float, Swing]
    lasting: dict[float, Lasting]
    gaps: Mapping[float, Swing]
    tensions: Mapping[float, Swing]
    answers: Mapping[tuple[float, float], tuple[Sine, Sine]]


def figure4() -> Exhibit:
    """Reproduce figure 4 and put the paper's claims about it to the test."""
    played = {gain: _swing(_step(gain, GAP_HALF)) for gain in GAINS}
    data = Figure4(
        steps={play: _step(GAIN, GAP_HALF * play) for play in (False, True)},
        sines={play: _sine(GAIN, GAP_HALF * play, UNIT_SINE_HZ) for play in (False, True)},
        plain={gain: _swing(_step(gain, 0.0)) for gain in GAINS},
        played=played,
        lasting={gain: limit_cycle.lasting(gain, played[gain].left) for gain in GAINS},
        gaps={gap: _swing(_step(GAIN, gap)) for gap in GAPS},
        tensions={tension: _swing(_step(GAIN, GAP_HALF, tension)) for tension in TENSIONS},
        answers={
            (gain, hertz): (_answer(gain, 0.0, hertz), _answer(gain, GAP_HALF, hertz))
            for gain in SINE_GAINS
            for hertz in SINES_HZ
        },
    )
    return Exhibit(
        name="fig4",
        title="Figure 4: step and sine before tuning, without and with backlash",
        about=(
            "From the paper's text, which says in words what four responses show: what backlash "
            "and "
            "gain do to them. Here the same four, and each of its sentences over a range of gains, "
            "gaps and frequencies."
        ),
        chosen=(
            "empty heavy table, no dry friction, no tension, no feed-forward; from rest, mid-gap",
            f"unit step: {STEP * 1e3:g} mrad at t = 0; unit sine: {STEP * 1e3:g} mrad, 1 rad/s",
            "proportional gain K = K_v, integral time 0.5 s; k_p 8e4 N·m·s/rad, T_N 0.1 s",
            f"half gap Δ {GAP_HALF * 1e3:g} mrad at the pinion, 22.7″ of play at the table",
            "oscillation: half of peak to peak in the last 10 s of 30 s",
        ),
        claims=_claims(data),
        tables=_tables(data),
        notes=(
            "Backlash without tension or dry friction always ends in a limit cycle here: within "
            "the gap integral action pushes the table back and forth. Enough tension closes the "
            f"flanks and ends it: {_ending(data)}.",
            limit_cycle.note(data.lasting),
            "Amplitude in proportion to Δ at one frequency is what scaling demands where play is "
            "the only nonlinearity; it is the oscillation, not stability, that grows with Δ.",
        ),
        data=data,
    )


def _step(gain: float, gap: float, tension: float = 0.0) -> Run:
    machine = untuned(gain, gap, tension)
    return simulated(machine, step(STEP), end=END, signals=["theta_ref", "theta_m"])


def _sine(gain: float, gap: float, hertz: float) -> Run:
    periods = max(8, 4 + round(20 * hertz))
    motion = sine(STEP, hertz, periods=periods)
    signals = ["theta_ref", "theta_m"]
    return simulated(untuned(gain, gap), motion, signals=signals)


def _answer(gain: float, gap: float, hertz: float) -> Sine:
    run = _sine(gain, gap, hertz)
    return sine_response(run.t, run["theta_m"], STEP, hertz, 4)


def _swing(run: Run) -> Swing:
    angle = run["theta_m"]
    return Swing(step_response(run.t, angle, STEP), oscillation(run.t, angle, LAST, FLOOR))


def _claims(data: Figure4) -> tuple[Claim, ...]:
    plain, played = data.plain, data.played
    lower = [k for k in GAINS if played[k].step.overshoot < plain[k].step.overshoot]
    slower = [k for k in GAINS if _time(played[k].step.rise) > _time(plain[k].step.rise)]
    later = [k for k in GAINS if _time(played[k].step.delay) > _time(plain[k].step.delay)]
    hertz = [played[k].left.frequency for k in GAINS]
    sizes = [played[k].left.amplitude for k in GAINS]
    wide = [data.gaps[gap].left for gap in GAPS]
    return (
        Claim(
            "backlash lowers the overshoot",
            f"lower at {_gains(lower)}; elsewhere higher",
            verdict(*(k in lower for k in GAINS)),
        ),
        Claim(
            "backlash lengthens the response time",
            f"half the step comes later at {_gains(later)}, the whole step at {_gains(slower)}; "
            "with backlash none settles within 2 % for good",
            verdict(*(k in later for k in GAINS), *(k in slower for k in GAINS)),
        ),
        Claim(
            "more backlash: unstable, a continuing oscillation",
            f"it oscillates at every Δ > 0, {_span(o.frequency for o in wide)} Hz, amplitude "
            f"{_span(o.amplitude / g * 1e-3 / ARCSEC for o, g in zip(wide, GAPS, strict=True))}″ "
            "per mrad of Δ: bounded, no threshold; without play it dies away",
            verdict(all(o.frequency > 0 for o in wide), False),
        ),
        Claim(
            "the frequency rises with K at one integral time",
            f"{_span(hertz)} Hz from K = {GAINS[0]:g} to {GAINS[-1]:g}, rising throughout",
            verdict(all(a < b for a, b in pairwise(hertz))),
        ),
        Claim(
            "the amplitude rises with K",
            "; ".join(f"K {k:g}: {a / ARCSEC:.1f}″" for k, a in zip(GAINS, sizes, strict=True)),
            verdict(*(a < b for a, b in pairwise(sizes))),
        ),
        _gain_claim(data),
        *_sine_claims(data),
    )


def _gain_claim(data: Figure4) -> Claim:
    """Of K too small and too large; settling exists without backlash only."""
    settling = [_time(data.plain[k].step.settling) for k in GAINS]
    over = [data.plain[k].step.overshoot for k in GAINS]
    over_play = [data.played[k].step.overshoot for k in GAINS]
    least = GAINS[over.index(min(over))]
    return Claim(
        "small K: long settling; large K: short settling, large overshoot",
        f"without backlash settling falls {_span(settling)} s; overshoot is least at K = {least:g} "
        f"({100 * min(over):.0f} %), {100 * over[0]:.0f} % at K = {GAINS[0]:g}, "
        f"{100 * over[-1]:.0f} % at {GAINS[-1]:g} (with backlash {100 * over_play[0]:.0f} and "
        f"{100 * over_play[-1]:.0f} %)",
        verdict(
            all(a > b for a, b in pairwise(settling)),
            over[-1] > over[0],
            all(a < b for a, b in pairwise(over)),
        ),
    )


def _sine_claims(data: Figure4) -> tuple[Claim, Claim]:
    pairs = data.answers.items()
    lower = [_place(key) for key, (plain, played) in pairs if played.gain < plain.gain - 1e-4]
    later = [_place(key) for key, (plain, played) in pairs if played.lag > plain.lag + 1e-4]
    return (
        Claim(
            "sine: backlash lowers the amplitude",
            f"of the sine's own frequency: lower at {'; '.join(lower) or 'none'}, elsewhere equal "
            "or higher; the peak is higher at low frequencies, by the limit cycle on top",
            verdict(*(played.gain < plain.gain - 1e-4 for _, (plain, played) in pairs)),
        ),
        Claim(
            "sine: backlash delays the answer",
            f"more lag at {'; '.join(later) or 'none'}; elsewhere equal or less",
            verdict(*(played.lag > plain.lag + 1e-4 for _, (plain, played) in pairs)),
        ),
    )


def _tables(data: Figure4) -> tuple[Table, ...]:
    gains = tuple(
        (k, *_step_cells(data.plain[k].step), *_step_cells(data.played[k].step)) for k in GAINS
    )
    gaps = tuple(
        (1e3 * g, data.gaps[g].left.frequency, data.gaps[g].left.amplitude / ARCSEC) for g in GAPS
    )
    tensions = tuple(
        (ten, data.tensions[ten].left.frequency, data.tensions[ten].left.amplitude / ARCSEC)
        for ten in TENSIONS
    )
    sines = tuple(
        (k, f, plain.gain, played.gain, degrees(plain.lag), degrees(played.lag), plain.peak,
         played.peak)
        for (k, f), (plain, played) in data.answers.items()
    )  # fmt: skip
    oscillates = ("frequency [Hz]", "amplitude [″]")
    each = ("to 50 % [s]", "to 100 % [s]", "settled [s]", "overshoot [%]")
    return (
        limit_cycle.table(data.lasting),
        Table("Limit cycle against gap, K = 6/s", ("Δ [mrad]", *oscillates), gaps),
        Table("Limit cycle against tension, K = 6/s", ("tension [N·m]", *oscillates), tensions),
        Table(
            "Step without backlash, then with it",
            ("K [1/s]", *each, *(f"with: {name}" for name in each)),
            gains,
        ),
        Table(
            "Sine without and with backlash",
            ("K [1/s]", "f [Hz]", "gain", "with", "lag [°]", "with", "peak", "with"),
            sines,
        ),
    )


def _ending(data: Figure4) -> str:
    """Between which tensions the limit cycle at GAIN ends."""
    alive = [tension for tension, swing in data.tensions.items() if swing.left.frequency]
    return f"{max(alive):g} N·m do not yet, {min(set(TENSIONS) - set(alive)):g} N·m do"


def _step_cells(found: Step) -> tuple[float | None, ...]:
    return (found.delay, found.rise, found.settling, 100 * found.overshoot)


def _time(value: float | None) -> float:
    return float("inf") if value is None else value


def _gains(gains: list[float]) -> str:
    return "K = " + ", ".join(f"{k:g}" for k in gains) if gains else "none"


def _place(key: tuple[float, float]) -> str:
    return f"K {key[0]:g} at {key[1]:.3g} Hz"


def _span(values: Iterable[float]) -> str:
    """From the first to the last, or one number where they are the same."""
    found = [f"{v:.3g}" for v in values]
    return found[0] if len(set(found)) == 1 else f"{found[0]} to {found[-1]}"

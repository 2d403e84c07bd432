"""Frequency responses of a machine with its controller, by linearisation in one contact mode.

Exact for signals so small that no flank, limit or friction switches, around a table that moves:
dry friction slides and is constant (friction="stuck" holds it instead). Delays enter exactly, as
exp(-s T). A sampled loop is approximated by its continuous law, held and late: good to about a
tenth of its sampling rate, and refused beyond half of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualdrive import _core
from dualdrive.assembly import core_of
from dualdrive.linear.closing import Closed
from dualdrive.linear.contacts import Modes
from dualdrive.linear.eigenvalues import in_order, is_stable, poles_of, usual_frequencies
from dualdrive.linear.errors import LinearError
from dualdrive.linear.response import FrequencyResponse
from dualdrive.linear.small_signal import SmallSignal, loops_of, small_signal, state_matrix
from dualdrive.linear.twin import Late, late_paths
from dualdrive.machine import Machine

__all__ = ["frequency_response", "open_loop", "poles"]

Array = NDArray[np.float64]

#: block -> the loops around it, which are open while it is measured
_AROUND: Final[Mapping[str, tuple[str, ...]]] = {
    "position": (),
    "equaliser": (),
    "speed": ("position", "equaliser"),
    "current": ("position", "equaliser", "speed"),
}


def frequency_response(
    machine: Machine | _core.Machine,
    input: str,  # noqa: A002 -- what it is
    output: str,
    frequencies_hz: ArrayLike | None = None,
    *,
    modes: Modes = None,
    cut: Sequence[str] = (),
    friction: str = "forward",
    state: Mapping[str, float] | None = None,
) -> FrequencyResponse:
    """Small-signal response of a signal to an input.

    input:    theta_ref (with its feed-forward), T_load, a torque on a body (torque@motor_1), or
              what is added at a set-point: Omega_1 (of the position loop, to all drives),
              equaliser, Omega_n* (of one drive), T_n*, U_n, or to what a sensor reads:
              sensed.table, sensed.motor_n
    output:   any signal of a run, or ``equaliser``
    frequencies_hz: increasing; default: 400 around the machine's own, more near resonances
    modes:    sides of the gaps, ``"(1, -1)"``, or switching element -> mode; default: the flanks
              that tension closes
    cut:      blocks whose output is taken away: position, equaliser, speed_n, current_n
    friction: forward, backward or stuck
    state:    the operating point of laws that aren't affine, state -> value; others 0

    `stable` of the result says whether the machine is stable in that mode with those cuts. Raises
    LinearError naming what there is.
    """
    core = core_of(machine)
    system = small_signal(core, modes, friction=friction, state=state)
    late = late_paths(core)
    closed = Closed(system, late, outputs_of(core, cut))
    given = _weights(input, system.inputs, core)
    f, s = _at(frequencies_hz, closed, late)
    row = _row(output, system, core)
    C, D = system.C[row], system.D[row]
    values = closed.response(given, C, D, s)
    if input == "theta_ref":  # its rate is an input of its own
        values = values + s * closed.response(_weights("omega_ref", system.inputs, core), C, D, s)
    return FrequencyResponse(
        frequency_hz=f,
        response=values,
        input=input,
        output=output,
        unit=unit_of(machine, system, input, output),
        note=_note(system, late, cut),
        stable=is_stable(closed),
    )


def open_loop(
    machine: Machine | _core.Machine,
    block: str,
    frequencies_hz: ArrayLike | None = None,
    *,
    modes: Modes = None,
    outer: str = "open",
    friction: str = "forward",
    state: Mapping[str, float] | None = None,
) -> FrequencyResponse:
    """The gain around a loop, cut at the output of one block: position, speed_1, current_1, ...

    outer: of the loops around it, open as in commissioning (speed: position loop and equaliser
           off; current: speed loops too) or closed as in operation

    Inner loops and the other drive's stay closed. The result is L with 1 + L the return
    difference, so that `margins` reads it; its `stable` is that of the closed loop. Other
    arguments and errors are those of `frequency_response`.
    """
    core = core_of(machine)
    blocks = loops_of(core)
    (output,) = outputs_of(core, [block])
    if outer not in ("open", "closed"):
        raise LinearError(f"outer = {outer!r}: choose open or closed")
    around = _AROUND[block.partition("_")[0]] if outer == "open" else ()
    others = [name for name in blocks if name.partition("_")[0] in around]
    system, late = small_signal(core, modes, friction=friction, state=state), late_paths(core)
    opened = Closed(system, late, [*(blocks[name] for name in others), output])
    closed = Closed(system, late, [blocks[name] for name in others])
    f, s = _at(frequencies_hz, closed, late)
    row, given = system.signals.index(output), _weights(output, system.inputs, core)
    # with the output cut, the block's own answer is what its states and the other inputs make
    C, D = system.C[row], system.D[row] - given
    own = [path.factor(s) for path in closed.paths if path.source == path.enters == output]
    return FrequencyResponse(
        frequency_hz=f,
        response=-np.prod(own, axis=0) * opened.response(given, C, D, s),
        input=output,
        output=output,
        note=_note(system, late, [*others, block]),
        stable=is_stable(closed),
    )


def poles(
    machine: Machine | _core.Machine,
    *,
    modes: Modes = None,
    cut: Sequence[str] = (),
    friction: str = "forward",
    state: Mapping[str, float] | None = None,
) -> NDArray[np.complex128]:
    """Poles of the whole machine with its loops, 1/s, the slowest first, shape (states,).

    Arguments and errors are those of `frequency_response`; delays and sampled loops add the poles
    of their Padé approximants.
    """
    core = core_of(machine)
    late = late_paths(core)
    if not late and not cut:  # all is in the states' own matrix
        return in_order(state_matrix(core, modes, friction=friction, state=state))
    system = small_signal(core, modes, friction=friction, state=state)
    return poles_of(Closed(system, late, outputs_of(core, cut)))


def outputs_of(core: _core.Machine, cut: Sequence[str]) -> list[str]:
    blocks = loops_of(core)
    for name in cut:
        if name not in blocks:
            known = ", ".join(blocks) or "none: it has no controller"
            raise LinearError(f"{core.name or 'machine'}: no block {name!r}; there are {known}")
    return [blocks[name] for name in cut]


def _weights(name: str, inputs: Sequence[str], core: _core.Machine) -> Array:
    if name not in inputs:
        raise LinearError(
            f"{core.name or 'machine'}: no input {name!r}; there are {', '.join(inputs)}"
        )
    return np.array([float(name == one) for one in inputs])


def _row(output: str, system: SmallSignal, core: _core.Machine) -> int:
    if output not in system.signals:
        known = ", ".join(system.signals)
        raise LinearError(f"{core.name or 'machine'}: no signal {output!r}; there are {known}")
    return system.signals.index(output)


def _at(
    frequencies_hz: ArrayLike | None, closed: Closed, late: Sequence[Late]
) -> tuple[Array, NDArray[np.complex128]]:
    """Frequencies in Hz and s = j 2 pi f; those a sampled loop can't follow are refused."""
    slowest = max((path.hold for path in late), default=0.0)
    if frequencies_hz is None:
        f = usual_frequencies(closed.system.A)
        f = f[f < 0.5 / slowest] if slowest else f
    else:
        f = np.atleast_1d(np.asarray(frequencies_hz, float))
    if not (f.size and (f > 0).all() and (np.diff(f) > 0).all() and np.isfinite(f).all()):
        raise LinearError("frequencies_hz: must be positive and increasing, at least one")
    if slowest and f[-1] > 0.5 / slowest:
        raise LinearError(
            f"frequencies_hz: {f[-1]:g} Hz is beyond half the sampling rate of a loop, "
            f"{0.5 / slowest:g} Hz; a linear model without sampling says nothing there"
        )
    return f, np.asarray(2j * np.pi * f, np.complex128)


def unit_of(machine: Machine | _core.Machine, system: SmallSignal, source: str, output: str) -> str:
    """The unit of an output over an input, on this machine's axis."""
    above, below = (own_unit(machine, system, name) for name in (output, source))
    if above == below:
        return ""
    return f"{above or '1'}/({below})" if below else above


def own_unit(machine: Machine | _core.Machine, system: SmallSignal, name: str) -> str:
    """The unit of an input or output on this machine's axis."""
    unit = system.units.get(name, "")
    return machine.unit_of(name, unit) if isinstance(machine, Machine) else unit


def _note(system: SmallSignal, late: Sequence[Late], cut: Sequence[str]) -> str:
    parts = [f"{element} {mode}" for element, mode in system.modes.items()]
    if cut:
        parts.append(f"cut at {', '.join(cut)}")
    parts += dict.fromkeys(
        path.reason + (" (approximated by hold and delay)" if path.hold else "") for path in late
    )
    return "; ".join(parts)

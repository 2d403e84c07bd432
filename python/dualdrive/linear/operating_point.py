"""Where a machine is while its table turns: the point of slopes of laws that are not affine."""

from __future__ import annotations

import numpy as np

from dualdrive import _core
from dualdrive.machine import Machine
from dualdrive.motion import Motion
from dualdrive.simulation import simulate

__all__ = ["operating_point"]

_LOOKS = 1001  # at the commanded speed, to find its fastest stretch


def operating_point(machine: Machine, motion: Motion) -> dict[str, float]:
    """The states halfway through the fastest stretch of the move, where the table surely turns.

    Poles of laws that aren't affine belong to a point: of an inverter's dead time the slope at zero
    current says nothing about motors that carry torque. Nothing for a machine of affine laws.
    """
    core = machine.core
    affine = {kind.name: kind.affine for kind in (*_core.effect_types(), *_core.user_laws())}
    if all(affine[effect["effect"]] for effect in core.effects):
        return {}
    times = np.linspace(0.0, motion.end, _LOOKS)
    speed = np.abs(motion.waveform.rate(times))
    fastest = times[speed >= (1.0 - 1e-6) * speed.max()]
    end = float(fastest[len(fastest) // 2])
    run = simulate(machine, motion, end=end, signals=["e"], output_step=end, energy=False)
    # the controller is affine between its limits, and a step may take one of its states away
    moved = run.final_state.items() if run.ok else ()
    return {name: value for name, value in moved if not name.startswith("controller.")}

"""What a nonlinear machine is driven with while its frequency response is measured."""

from __future__ import annotations

from dataclasses import dataclass

from dualdrive import _core
from dualdrive.linear.errors import LinearError
from dualdrive.linear.small_signal import push
from dualdrive.machine import Machine

__all__ = ["Bench", "bench_for"]

#: inputs that a simulation can be given
_KINDS = "theta_ref, T_load, Omega_1 (position loop open) or torque@BODY"


@dataclass(frozen=True, eq=False)
class Bench:
    """A machine made ready for one input.

    machine:    the machine, changed so that the input can be given
    bare:       the same without a way in for a torque, so that it can be linearised
    name:       the core's input that carries it
    factor:     what that input is of it
    integrated: whether it is its integral besides
    inputs:     what else is given: steady motion and load
    """

    machine: Machine
    bare: Machine
    name: str
    factor: float
    integrated: bool
    inputs: dict[str, _core.Waveform]

    def driven(self, excitation: _core.Waveform) -> dict[str, _core.Waveform]:
        """All inputs of a run with this excitation (of the bench's own input)."""
        waves = dict(self.inputs)
        scaled = self.factor * excitation
        waves[self.name] = waves[self.name] + scaled if self.name in waves else scaled
        return waves


def bench_for(machine: Machine, source: str, speed: float, load: float) -> Bench:
    """Make a machine ready. speed: the table's steady speed; load: its steady load.

    Raises LinearError for an input that a simulation can't be given.
    """
    m = machine.copy()
    inputs = {"theta_ref": _core.ramp(speed), "T_load": _core.constant(load)}
    if m.core.controller_options["kind"] == "none":
        del inputs["theta_ref"]
    if source in ("theta_ref", "T_load") and source in inputs:
        return Bench(m, m, source, 1.0, False, inputs)
    if source == "Omega_1" and "theta_ref" in inputs:
        return _speed_bench(m, inputs)
    kind, _, body = source.partition("@")
    if kind == "torque" and body in m.core.bodies:
        pushed = m.copy()
        return Bench(pushed, m, push(pushed.core, body), 1.0, False, inputs)
    raise LinearError(f"{m.name}: {source!r} can't be simulated; give {_KINDS}")


def _speed_bench(machine: Machine, inputs: dict[str, _core.Waveform]) -> Bench:
    """The speed set-point of all drives: the feed-forward of a loop without position gains.

    Omega_1 = i_m f_v d(theta_ref)/dt then, so that theta_ref is its integral over i_m.
    """
    for name in ("K_v", "K_i", "K_d"):
        machine.set(f"controller.{name}", 0.0)
    machine.set("controller.f_v", 1.0)
    known = machine.core.connections
    ratio = machine.get("mesh_1.ratio") if "mesh_1" in known else 1.0
    return Bench(machine, machine, "theta_ref", 1.0 / ratio, True, inputs)

"""Limit cycles foretold by the describing function of the play.

With x = A sin(w t) across a play of half width D < A the flank passes on the fundamental

    n(A) = N/K = 1 - (2/pi) (asin(D/A) + (D/A) sqrt(1 - (D/A)^2))

of what a closed flank, K + c s, would. All meshes move alike; the rest of the machine answers the
mesh torque T with x = -G(s) T, and a cycle needs 1 + n (K + c jw) G(jw) = 0. G is the core's
linear model with all flanks open. Source: Gelb, Vander Velde, *Multiple-Input Describing
Functions*, 1968, ch. 2. Good where n is large: within 7 % in frequency and 15 % in amplitude for
n >= 0.4, useless below 0.1, where the motion across the play is no sine any more.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.assembly import core_of, gaps
from dualdrive.cycles.errors import CycleError
from dualdrive.display import Tabled
from dualdrive.linear.closing import Closed
from dualdrive.linear.frequency import poles
from dualdrive.linear.small_signal import SmallSignal, small_signal
from dualdrive.linear.twin import late_paths
from dualdrive.machine import Machine
from dualdrive.units import human

__all__ = ["Predicted", "describing_function", "phasors", "share_of_stiffness", "size_for_share"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: n below which the prediction is off by more than 7 % in frequency or 15 % in amplitude
TRUSTED: Final = 0.4
_POINTS: Final = 4000


@dataclass(frozen=True)
class Predicted(Tabled):
    """A limit cycle as the describing function has it; SI, amplitudes are half peak to peak.

    amplitude:       of the table, rad
    mesh_amplitude:  A, of the mesh deflection at the pinion, rad
    n_over_k:        N/K; below 0.4 frequency and amplitude are rough, below 0.1 useless
    stable:          whether a larger swing decays and a smaller one grows
    note:            what was left out
    """

    frequency_hz: float
    amplitude: float
    mesh_amplitude: float
    n_over_k: float
    stable: bool
    note: str = ""

    @property
    def trusted(self) -> bool:
        """Whether n is large enough for the method."""
        return self.n_over_k >= TRUSTED

    def figures(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {**asdict(self), "trusted": self.trusted}

    def _cells(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        rows = [
            ("frequency", human(self.frequency_hz, "Hz")),
            ("amplitude of the table", human(self.amplitude, "rad")),
            ("amplitude of the mesh", human(self.mesh_amplitude, "rad")),
            ("N/K", f"{self.n_over_k:.3g}"),
            ("stable", "yes" if self.stable else "no"),
            ("trusted", "yes" if self.trusted else "no"),
        ]
        return ("limit cycle", "predicted"), [*rows, *([("note", self.note)] if self.note else [])]


def share_of_stiffness(size: float) -> float:
    """N for an amplitude of `size` half gaps; 0 within the gap."""
    if size <= 1:
        return 0.0
    r = 1 / size
    return float(1 - 2 / np.pi * (np.arcsin(r) + r * np.sqrt(1 - r * r)))


def size_for_share(n: float) -> float:
    """The amplitude in half gaps at which the play passes on n, 0 < n < 1."""
    from scipy.optimize import brentq

    if not 0 < n < 1:
        raise CycleError(f"n = {n:g}: the play passes on more than nothing and less than all")
    # r = 1/size; asin r + r sqrt(1 - r^2) = 2 r for small r, so that ends are bracketed
    r = brentq(lambda r: share_of_stiffness(1 / r) - n, 1e-12, 1.0, xtol=1e-15)
    return float(1 / r)


def describing_function(machine: Machine | _core.Machine) -> list[Predicted]:
    """Every limit cycle around standstill that the describing function foretells; lowest first.

    Dry friction is left out (and this noted): it only takes energy away. Raises CycleError for a
    machine without play, with tension, or with drives that differ.
    """
    core = core_of(machine)
    meshes, loop = _loop(core)
    loop.refuse_unequal()
    note = _note(core)
    found = []
    for omega in loop.real_axis():
        n = -1 / float(loop.gain(np.array([omega]))[0].real)
        if not 0 < n < 1:
            continue
        A = size_for_share(n) * core.get(f"{meshes[0]}.gap")
        table = abs(loop.table_per_torque(omega) * loop.torque_of(omega, n) * A)
        stable = _decays_when_larger(core, meshes, n, omega)
        found.append(Predicted(omega / (2 * np.pi), float(table), A, n, stable, note))
    return found


def phasors(machine: Machine | _core.Machine, cycle: Predicted) -> dict[str, complex]:
    """The states of the machine in a foretold cycle, each the real part of phasor e^(j w t)."""
    core = core_of(machine)
    _, loop = _loop(core)
    omega = 2 * np.pi * cycle.frequency_hz
    system = loop.closed.system
    torque = loop.torque_of(omega, cycle.n_over_k) * cycle.mesh_amplitude
    at = 1j * omega * np.eye(len(system.states)) - system.A
    z = np.linalg.solve(at, system.B @ loop.torque) * torque
    return dict(zip(system.states, z.tolist(), strict=True))


def _loop(core: _core.Machine) -> tuple[list[str], _Loop]:
    """The meshes and the loop around their play. Raises CycleError as `describing_function`."""
    meshes = _refuse_others(core)
    closed = Closed(small_signal(core, dict.fromkeys(meshes, "gap")), late_paths(core))
    return meshes, _Loop(closed, core, meshes, *_flank(core, meshes[0]))


class _Loop:
    """The gain around the play, (K + c s) G(s), with all meshes moving alike."""

    def __init__(
        self, closed: Closed, core: _core.Machine, meshes: list[str], K: float, c: float
    ) -> None:
        self.closed, self.meshes, self.K, self.c = closed, meshes, K, c
        system = closed.system
        self.torque = np.zeros(len(system.inputs))
        for mesh in meshes:
            pinion = f"torque@pinion_{mesh.removeprefix('mesh_')}"
            self.torque[system.inputs.index(pinion)] -= 1.0
            self.torque[system.inputs.index("torque@table")] += core.get(f"{mesh}.ratio")

    def _answer(self, signal: str, omega: Array) -> Complex:
        system: SmallSignal = self.closed.system
        row = system.signals.index(signal)
        s = np.asarray(1j * omega, np.complex128)
        return self.closed.response(self.torque, system.C[row], system.D[row], s)

    def gain(self, omega: Array) -> Complex:
        """(K + c jw) G(jw), shape as omega."""
        G = -self._answer(f"{self.meshes[0]}.twist", omega)
        return np.asarray((self.K + 1j * omega * self.c) * G, np.complex128)

    def torque_of(self, omega: float, n: float) -> complex:
        """Mesh torque per amplitude of the deflection, where the play passes on n."""
        return n * (self.K + 1j * omega * self.c)

    def table_per_torque(self, omega: float) -> complex:
        """Table angle per torque of each mesh."""
        return complex(self._answer("theta_m", np.array([omega]))[0])

    def refuse_unequal(self) -> None:
        """Meshes move alike only where the drives are alike."""
        omega = np.geomspace(0.1, 1000, 30)
        first, *others = (self._answer(f"{mesh}.twist", omega) for mesh in self.meshes)
        for other in others:
            apart = float(np.abs(other / first - 1).max())
            if apart > 1e-6:
                raise CycleError(
                    f"describing function: the drives differ (their meshes answer {apart:.2g} "
                    "apart), so that their meshes don't move alike; use shooting"
                )

    def real_axis(self) -> list[float]:
        """Frequencies, rad/s, at which the gain is real and beyond -1."""
        from scipy.optimize import brentq

        speeds = np.abs(np.linalg.eigvals(self.closed.system.A))
        speeds = speeds[speeds > 1e-7 * speeds.max()]
        omega = np.geomspace(speeds.min() / 100, speeds.max() * 3, _POINTS)
        gain = self.gain(omega)
        crossed = np.flatnonzero((gain.imag[:-1] * gain.imag[1:] < 0) & (gain.real[:-1] < 0))
        found = []
        for k in crossed:
            low, high = float(omega[k]), float(omega[k + 1])
            found.append(float(brentq(self._imaginary, low, high, xtol=1e-14 * low, rtol=1e-14)))
        return found

    def _imaginary(self, omega: float) -> float:
        return float(self.gain(np.array([omega]))[0].imag)


def _refuse_others(core: _core.Machine) -> list[str]:
    meshes, name = gaps(core), core.name or "machine"
    if not meshes or any(not mesh.startswith("mesh_") for mesh in meshes):
        raise CycleError(
            f"{name}: the describing function takes play in the meshes alone; it has play in "
            f"{', '.join(meshes) or 'no connection'}"
        )
    options = core.controller_options
    if options["kind"] == "none":
        raise CycleError(f"{name}: has no controller, and nothing that would keep a cycle going")
    if len(meshes) > 1 and options["tension"] != "off" and core.get("controller.T_ten") != 0:
        raise CycleError(
            f"{name}: the describing function is that of a play around mid-gap; set "
            "controller.T_ten=0, or use shooting"
        )
    widths = {core.get(f"{mesh}.gap") for mesh in meshes}
    if len(widths) > 1 or min(widths) <= 0:
        raise CycleError(f"{name}: half gaps {sorted(widths)}: must be equal and positive")
    return meshes


def _flank(core: _core.Machine, mesh: str) -> tuple[float, float]:
    """Stiffness and damping of a closed flank, from the core's own law."""
    system = small_signal(core, dict.fromkeys(gaps(core), "front"))
    torque = system.C[system.signals.index(f"{mesh}.torque")]
    pinion = f"omega_c{mesh.removeprefix('mesh_')}"
    return (
        float(torque[system.states.index(f"{mesh}.twist")]),
        float(torque[system.states.index(pinion)]),
    )


def _note(core: _core.Machine) -> str:
    kinds = ("coulomb", "stribeck", "lugre", "angle_dependent_friction")
    labels = [str(effect["label"]) for effect in core.effects if effect["effect"] in kinds]
    rubbing = [label for label in labels if core.get(f"{label}.torque") > 0]
    return f"{', '.join(rubbing)} left out" if rubbing else ""


def _decays_when_larger(core: _core.Machine, meshes: list[str], n: float, omega: float) -> bool:
    """Whether the oscillating pair of the machine with flanks of n K moves left as n grows."""
    real = []
    for share in (n * (1 - 1e-3), n * (1 + 1e-3)):
        softer = core.copy()
        for mesh in meshes:
            softer.set(f"{mesh}.stiffness", share * core.get(f"{mesh}.stiffness"))
        for effect in core.effects:
            if effect["effect"] == "mesh_damping":
                path = f"{effect['label']}.coefficient"
                softer.set(path, share * core.get(path))
        found = poles(softer, modes=dict.fromkeys(meshes, "front"))
        real.append(float(found[np.abs(found - 1j * omega).argmin()].real))
    return real[1] < real[0]

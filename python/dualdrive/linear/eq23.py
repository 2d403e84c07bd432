"""Eq. 23 of the source paper, corrected: the plant in each of its nine contact modes.

    dX/dt = A'(s) X + B' U + C(s) v,   X = (omega_c1, omega_c2, theta_c1, theta_c2, I_1, I_2,
                                            theta_m, omega_m),   v = (s_1 gap_1, s_2 gap_2)

The matrices are read off the core's model of the machine without its controller; nothing of the
plant's law is written here. Frames, signs and the misprints of the paper: docs/theory/plant.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.assembly import core_of, gaps
from dualdrive.linear.contacts import all_sides, frozen, spoken
from dualdrive.linear.errors import LinearError
from dualdrive.machine import Machine

__all__ = ["INPUTS", "STATES", "Mode", "modes"]

Array = NDArray[np.float64]

#: X, in the order of Eq. 23; pinion speeds and angles, motor currents, table angle and speed; SI
STATES: Final = (
    "omega_c1", "omega_c2", "theta_c1", "theta_c2", "I_1", "I_2", "theta_m", "omega_m",
)  # fmt: skip
#: U, V
INPUTS: Final = ("U_1", "U_2")
#: what effects act on that goes with the controller
_CONTROL: Final = {"sensor delay", "sensor reading", "torque estimate", "command delay"}


@dataclass(frozen=True, eq=False)
class Mode:
    """The plant while contacts stay as they are: dX/dt = A X + B U + C v + load T_load + offset.

    sides:   (s_1, s_2), each -1 (back flank), 0 (in the gap) or 1 (front flank)
    A:       A'(s), shape (8, 8)
    B:       B', shape (8, 2), per volt
    C:       C(s), shape (8, 2), per rad of the half gaps
    v:       (s_1 gap_1, s_2 gap_2), rad at the pinions, shape (2,)
    guards:  g_n as rows: the flanks are reached where guards X = (+-gap_1, +-gap_2), shape (2, 8)
    load:    of T_load, which Eq. 23 leaves out, shape (8,)
    offset:  what Eq. 23 has not got, dry friction sliding forward say, shape (8,); else 0
    """

    sides: tuple[int, int]
    A: Array
    B: Array
    C: Array
    v: Array
    guards: Array
    load: Array
    offset: Array
    states: tuple[str, ...] = STATES
    inputs: tuple[str, ...] = INPUTS

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Poles in 1/s, shape (8,), the slowest first; 0 for each angle that nothing holds."""
        poles = np.linalg.eigvals(self.A).astype(np.complex128)
        return poles[np.lexsort((poles.imag, np.abs(poles)))]


def modes(machine: Machine | _core.Machine) -> dict[str, Mode]:
    """The nine modes of Eq. 23 by their sides, ``"(1, -1)"`` say.

    Effects on the plant are in the matrices: mesh damping in A'; what is not linear as its tangent
    at rest. Raises LinearError for a machine that is no instance of Eq. 23.
    """
    plant = _without_controller(core_of(machine))
    _refuse_others(plant)
    return {spoken(sides): _mode(plant, (sides[0], sides[1])) for sides in all_sides(2)}


def _without_controller(core: _core.Machine) -> _core.Machine:
    plant = core.copy()
    acts_on = {effect.name: effect.acts_on for effect in _core.effect_types()}
    for effect in core.effects:
        if acts_on.get(str(effect["effect"])) in _CONTROL:
            plant.remove_effect(str(effect["label"]))
    plant.set_controller(kind="none")
    return plant


def _refuse_others(plant: _core.Machine) -> None:
    names = [name for name, _ in plant.states()]
    meshes = gaps(plant)
    twists = {f"{mesh}.twist" for mesh in meshes}
    own = {name for name in STATES if not name.startswith("theta_c")}
    if len(meshes) == 2 and set(names) == own | twists:
        return
    raise LinearError(
        f"{plant.name or 'machine'}: Eq. 23 is two motors with windings, each on a rigid reducer "
        f"and one mesh with play; this plant has the states {', '.join(names)}; "
        "linear.frequency_response takes any machine"
    )


def _mode(plant: _core.Machine, sides: tuple[int, int]) -> Mode:
    """Change from the core's states, which hold twists, to X, and take the offsets apart."""
    meshes = gaps(plant)
    half = np.array([plant.get(f"{mesh}.gap") for mesh in meshes])
    plant = plant.copy()
    for mesh in meshes:  # the law is affine in a half gap; one of zero would be no switch
        plant.set(f"{mesh}.gap", 1.0)
    closed = frozen(plant, sides)
    system = _core.linearise(plant, modes=closed)
    X = np.array([system.C[system.signals.index(name)] for name in STATES])
    back = np.linalg.inv(X)

    def offset(machine: _core.Machine, **inputs: float) -> Array:
        given = {name: _core.constant(value) for name, value in inputs.items()}
        return np.asarray(X @ _core.linearise(machine, given, modes=closed).a)

    still = offset(plant)
    C = np.zeros((len(STATES), 2))
    for n, mesh in enumerate(meshes):
        if sides[n]:
            wide = plant.copy()
            wide.set(f"{mesh}.gap", 2.0)
            C[:, n] += sides[n] * (offset(wide) - still)
    rest = still - C @ np.array(sides)
    rest[np.abs(rest) <= 1e-12 * np.abs(C).sum(1)] = 0.0
    return Mode(
        sides=sides,
        A=X @ system.A @ back,
        B=np.column_stack([offset(plant, **{name: 1.0}) - still for name in INPUTS]),
        C=C,
        v=np.array(sides) * half,
        guards=np.array([system.C[system.signals.index(f"{m}.deflection")] for m in meshes]) @ back,
        load=offset(plant, T_load=1.0) - still,
        offset=rest,
    )

"""Which effects can be taken for which, and how far apart the records keep them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from tests.blind.generator import effects
from tests.blind.generator.effects import Hidden, Setting, UnfitError
from tests.blind.generator.engine import Array, EngineError
from tests.blind.generator.evidence import Nominals
from tests.blind.scoring.match import same_place

#: effects that resemble each other; one may stand in several
KIN = (
    ("viscous", "coulomb", "stribeck", "lugre", "load_dependent_mesh_loss", "hydrostatic_drag"),
    ("coulomb", "angle_dependent_friction", "unbalance", "cutting_torque"),
    ("cogging", "torque_ripple", "encoder_eccentricity", "torque_constant_saturation"),
    ("eccentricity", "encoder_eccentricity", "transmission_error", "time_varying_mesh_stiffness"),
    ("wear", "gearbox_backlash", "shaft_compliance", "hertzian_stiffness", "eccentricity"),
    ("sensor_delay", "transport_delay", "shaft_compliance", "stribeck", "mesh_damping", "viscous"),
    ("position_dependent_inertia", "unbalance", "torque_constant_saturation", "thermal_drift"),
    ("dead_time", "current_limit", "voltage_limit", "torque_constant_saturation", "thermal_drift"),
    ("tension_mismatch", "thermal_drift", "torque_constant_saturation", "transport_delay"),
)
#: effect -> those that contain it as a special case; the simpler one is the better name
CONTAINS = {
    "coulomb": {"stribeck", "lugre", "angle_dependent_friction"},
    "stribeck": {"lugre"},
    "viscous": {"hydrostatic_drag"},
    "unbalance": {"cutting_torque"},
}
_DRAWS = 3
_SHARE = 0.05


def nearest(true: Hidden, setting: Setting, nominals: Nominals, change: Array) -> tuple[float, str]:
    """(log-likelihood ratio, rival): what of the true effect's change no rival of it explains.

    First order in the rival's size; nominal numbers are free beside the rival.
    """
    left = nominals.left(change)[0]
    best, name = float(left @ left) / 2, "none"
    for rival, drawn in _columns(true, setting).items():
        try:
            sides = [nominals.change((one,)) for one in drawn]
        except EngineError:
            continue
        basis = np.stack([nominals.left(side)[0] for side in sides], axis=1)
        weights = np.linalg.lstsq(basis.T @ basis, basis.T @ left, rcond=1e-12)[0]
        rest = left - basis @ weights
        if float(rest @ rest) / 2 < best:
            best, name = float(rest @ rest) / 2, rival
    return best, name


def _columns(true: Hidden, setting: Setting) -> dict[str, list[Hidden]]:
    """Rivals by name, each with a draw or two: the second one for another phase."""
    names = {name for kin in KIN if true.effect in kin for name in kin}
    names -= CONTAINS.get(true.effect, set())
    found: dict[str, list[Hidden]] = {}
    for name in sorted(names & set(effects.EFFECTS)):
        for seed in range(_DRAWS):
            try:
                one = _tuned(effects.draw(name, setting, seed, _SHARE), true)
            except UnfitError:
                break
            own = found.setdefault(f"{one.effect}@{one.place}", [])
            if len(own) < (2 if any("phase" in key for key in one.numbers) else 1):
                own.append(one)
    return {label: own for label, own in found.items() if not _same(own[0], true)}


def _same(rival: Hidden, true: Hidden) -> bool:
    """Another word for the true effect: motor and pinion are one body."""
    return rival.effect == true.effect and same_place(rival.effect, rival.place, true.place)


def _tuned(rival: Hidden, true: Hidden) -> Hidden:
    """A periodic rival takes the order of the true effect."""
    order = next((v for key, v in true.numbers.items() if "_order" in key), None)
    if order is None:
        return rival
    numbers = {k: order if "_order" in k else v for k, v in rival.numbers.items()}
    return replace(rival, numbers=numbers)

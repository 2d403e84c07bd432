"""Which effects can be taken for which, and how far apart the records keep them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from tests.blind.generator import effects
from tests.blind.generator.distance import Nominals
from tests.blind.generator.effects import Hidden, Setting
from tests.blind.scoring.match import same_place

Array = NDArray[np.float64]
#: effects that resemble each other; one may stand in several
KIN = (
    ("viscous", "coulomb", "stribeck", "lugre", "load_dependent_mesh_loss", "hydrostatic_drag"),
    ("coulomb", "angle_dependent_friction", "unbalance", "cutting_torque"),
    ("cogging", "torque_ripple", "encoder_eccentricity", "torque_constant_saturation"),
    ("eccentricity", "encoder_eccentricity", "transmission_error", "time_varying_mesh_stiffness"),
    ("wear", "gearbox_backlash", "shaft_compliance", "hertzian_stiffness", "eccentricity"),
    ("sensor_delay", "transport_delay", "shaft_compliance", "stribeck", "mesh_damping", "viscous"),
    ("position_dependent_inertia", "unbalance", "torque_constant_saturation", "thermal_drift"),
    ("dead_time", "current_limit", "torque_constant_saturation", "thermal_drift"),
    ("tension_mismatch", "thermal_drift", "torque_constant_saturation", "transport_delay"),
)
#: effect -> those that contain it as a special case; the simpler one is the better name
CONTAINS = {
    "coulomb": {"stribeck", "lugre", "angle_dependent_friction"},
    "stribeck": {"lugre"},
    "viscous": {"hydrostatic_drag"},
    "unbalance": {"cutting_torque"},
}
_DRAWS = 5
_SHARE = 0.05


def nearest(true: Hidden, setting: Setting, nominals: Nominals) -> tuple[float, str]:
    """(delta-lambda, rival): what of the true effect's record no rival of it explains.

    First order in the rival's size; nominal numbers are free beside the rival.
    """
    change = nominals.project(nominals.bench.record((true,)) - nominals.at_truth)[0]
    best, name = float(change @ change), "none"
    for rival, columns in _columns(true, setting).items():
        sides = [nominals.bench.record((one,)) - nominals.at_truth for one in columns]
        basis = np.stack([nominals.project(side)[0] for side in sides], axis=1)
        fitted, *_ = np.linalg.lstsq(basis, change, rcond=1e-9)
        left = change - basis @ fitted
        if float(left @ left) < best:
            best, name = float(left @ left), rival
    return best, name


def _columns(true: Hidden, setting: Setting) -> dict[str, list[Hidden]]:
    """Rivals by name, each with a draw or two: the second one for another phase."""
    names = {name for kin in KIN if true.effect in kin for name in kin}
    names -= CONTAINS.get(true.effect, set())
    found: dict[str, list[Hidden]] = {}
    for name in sorted(names & set(effects.EFFECTS)):
        for seed in range(_DRAWS):
            one = _tuned(effects.draw(name, setting, seed, _SHARE), true)
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

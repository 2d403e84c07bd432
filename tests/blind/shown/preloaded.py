"""Reversals under tension on which two effects look alike: records that allow no single name.

The hidden effect is as large as it can be with both hardly told apart: the squared distance of its
record from the nearest one of the rival is APART (11 would tell them apart in 95 of 100 cases),
while that from a machine without either is SEEN at least. Both are counted by `generator.distance`
in units of the sensors' noise, the sheet's numbers refitted within their tolerances. The drive
stores its following error and its currents: motor angles would show where along the train a torque
is lost.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from tests.blind.generator.effects import Hidden, UnfitError
from tests.blind.shown import distance, families, motion, records
from tests.blind.shown.ordered import FAMILIES, Order
from tests.blind.shown.records import Plan

Array = NDArray[np.float64]
APART, SEEN = 6.0, 250.0
_LARGEST = 0.1  # of one motor's rated torque: what a sheet could not forget
_TRIAL = 1e-3
_ATTEMPTS = 8
OLD = "old"
STORED = ("theta_m", "I_1", "I_2")


def _dry(place: str, key: str, torque: float) -> Hidden:
    return Hidden("coulomb", place, "", {key: torque}, {"torque": torque})


def _loss(fraction: float) -> Hidden:
    numbers = {"fraction": fraction}
    return Hidden("load_dependent_mesh_loss", "pinions", "", {"loss": fraction}, numbers)


def _wave(effect: str, word: str, amplitude: float) -> Hidden:
    """Of the first motor, six waves a turn: there its torque is tension, more or less."""
    numbers = {f"{word}_1": amplitude, f"{word}_order_1": 6.0, f"{word}_phase_1": 0.7}
    own = {"amplitude": amplitude, "order": 6.0, "phase": 0.7}
    return Hidden(effect, "motor_1", "", numbers, own)


#: effects by label, each made from the torque that it amounts to at one motor and from tension
MAKERS: Mapping[str, Callable[[float, Mapping[str, float]], Hidden]] = {
    "coulomb@table": lambda T, m: _dry("table", "t_dry", 2 * T * _table(m)),
    "coulomb@motors": lambda T, m: _dry("motors", "m_dry", T),
    "coulomb@pinions": lambda T, m: _dry("pinions", "p_dry", T * m["gearboxes.ratio"]),
    "load_dependent_mesh_loss@pinions": lambda T, m: _loss(2 * T / m["controller.T_ten"]),
    "cogging@motor_1": lambda T, m: _wave("cogging", "cog", T),
    "torque_ripple@motor_1": lambda T, m: _wave(
        "torque_ripple", "ripple", 2 * T / m["controller.T_ten"]
    ),
}
PAIRS = (
    ("coulomb@table", "coulomb@motors"),
    ("coulomb@pinions", "load_dependent_mesh_loss@pinions"),
    ("cogging@motor_1", "torque_ripple@motor_1"),
)
_ORDER = {label: k for k, label in enumerate(MAKERS)}


def _table(machine: Mapping[str, float]) -> float:
    return machine["gearboxes.ratio"] * machine["meshes.ratio"]


class Stored(distance.Bench):
    """What is seen without the motors' angles."""

    def _white(self, plan: Plan, name: str, values: Array) -> Array:
        return np.zeros(0) if name.startswith("x_") else super()._white(plan, name, values)


@dataclass(frozen=True)
class Alike:
    """A record that two effects explain; the first of the pair is the true one.

    seen, apart: squared distances from a machine without either, and from the rival's
    """

    order: Order
    truth: str
    rival: str
    seen: float
    apart: float


def every(seed: int) -> list[tuple[str, str, str, int]]:
    """(family, truth, rival, seed): both ways round on every family."""
    both = [way for pair in PAIRS for way in (pair, pair[::-1])]
    return [(family, *way, seed) for way in both for family in FAMILIES]


def alike(family: str, truth: str, rival: str, seed: int) -> Alike:
    """The first machine of the family on which that pair can be seen but not told apart.

    Raises UnfitError where a few draws have none.
    """
    for attempt in range(_ATTEMPTS):
        rng = np.random.default_rng([seed, FAMILIES.index(family), _ORDER[truth], attempt])
        try:
            return _drawn(family, truth, rival, seed, rng)
        except UnfitError:
            continue
    raise UnfitError(f"{family}: {truth} is told from {rival} wherever it is seen")


def _drawn(family: str, truth: str, rival: str, seed: int, rng: np.random.Generator) -> Alike:
    sheet = families.draw(family, rng)
    sheet = {path: value for path, value in sheet.items() if not path.startswith("dry_")}
    real = families.drift(sheet, rng)
    plan = reversals(family, sheet, rng)
    recorder = replace(records.recorder(family, sheet["motors.K_d"], rng), jitter=0.0)
    nominals = distance.Nominals(Stored(real, (plan,), recorder))
    torque, seen, apart = _sized(truth, rival, nominals)
    hidden = {OLD: (MAKERS[truth](torque, real),)}
    made = plan.truth(real, hidden[OLD])
    if any(np.ptp(made[flank]) or not made[flank][0] for flank in ("flank_1", "flank_2")):
        raise UnfitError("a flank is left")
    name = f"{family} {seed}: {truth} or {rival}"
    order = Order(name, sheet, real, (plan,), recorder, hidden, STORED)
    return Alike(order, truth, rival, seen, apart)


def reversals(family: str, machine: Mapping[str, float], rng: np.random.Generator) -> Plan:
    """Twice there and back at one speed, the drives pressed on their flanks throughout."""
    kind = families.FAMILIES[family]
    most = machine["controller.T_ten"] * _table(machine) / machine["table.J"]  # then flanks part
    a, j = min(0.15 * most, float(kind["a"][0])), float(kind["j"][0])
    v = min(float(rng.uniform(*kind["v"])) / 2, 0.5 * a)
    length = v * (0.6 + v / a)
    there_and_back = [(length, v, a, j), (-length, v, a, j)]
    jerks, end = motion.course(2 * there_and_back, [0.6, 0.2, 0.2, 0.2, 0.5])
    end, lead = round(end / 4e-3) * 4e-3, float(kind["settle"])
    return Plan(OLD, jerks, end, 2e-3, lead, machine["controller.T_ten"], v, length)


def _sized(truth: str, rival: str, nominals: distance.Nominals) -> tuple[float, float, float]:
    """Torque at one motor, and both squared distances: as large as can't be told apart."""
    machine = nominals.bench.machine
    torque = _TRIAL * machine["motors.T_rated"]
    for _ in range(3):
        seen, apart = _distances(truth, rival, torque, nominals)
        step = float(np.sqrt(APART / max(apart, 1e-9)))
        if 0.7 < step < 1.4:
            break
        torque = min(torque * step, _LARGEST * machine["motors.T_rated"])
    seen, apart = _distances(truth, rival, torque, nominals)
    if seen < SEEN or apart > 1.5 * APART:
        raise UnfitError(f"seen {seen:.3g}, apart {apart:.3g}")
    return torque, seen, apart


def _distances(
    truth: str, rival: str, torque: float, nominals: distance.Nominals
) -> tuple[float, float]:
    bench = nominals.bench
    own, other = (
        nominals.project(bench.record((MAKERS[label](torque, bench.machine),)) - nominals.at_truth)[
            0
        ]
        for label in (truth, rival)
    )
    size = float(own @ other) / float(other @ other)
    left = own - size * other
    return float(own @ own), float(left @ left)

"""Two answers that need no name: a drifted inertia, and a load that sets in."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product

from tests.blind.shown import ordered
from tests.blind.shown.ordered import FAMILIES, Order

from dualdrive.diagnose import Diagnosis

#: names that a load in time must not get
FRICTION = frozenset(
    {
        *("coulomb", "stribeck", "lugre", "viscous", "angle_dependent_friction"),
        *("load_dependent_mesh_loss", "hydrostatic_drag"),
    }
)
#: the sheet's inertia over the real one; of one motor's rated torque
OFF, SHARES = (1.25, 0.75), (0.3, 0.1)


def drifts(seeds: Iterable[int]) -> list[Order]:
    """Every family, a sheet too heavy and too light in turn."""
    return [
        ordered.drifted(family, seed, OFF[(k + seed) % 2])
        for seed, (k, family) in product(seeds, enumerate(FAMILIES))
    ]


def loads(seeds: Iterable[int]) -> list[Order]:
    """Every family, a heavy and a light load in turn."""
    return [
        ordered.loaded(family, seed, SHARES[(k + seed) % 2])
        for seed, (k, family) in product(seeds, enumerate(FAMILIES))
    ]


def named(found: Diagnosis) -> list[str]:
    """Every effect that the verdict names, without its place."""
    if found.best is None:
        return []
    labels = [found.best.label, *(label for group in found.groups for label in group)]
    return [one.partition("@")[0] for label in dict.fromkeys(labels) for one in label.split(" + ")]


def is_parameters(found: Diagnosis) -> bool:
    """The right answer to a drifted number."""
    return found.verdict == "parameters"


def is_no_friction(found: Diagnosis) -> bool:
    """A right answer to a load in time."""
    return not FRICTION & set(named(found))


def row(order: Order, found: Diagnosis) -> Sequence[str]:
    """Cells: machine, verdict, leader with its probability, errors refitted and at the floor."""
    best = found.candidates[0] if found.candidates else None
    leader = f"{best.label} {best.probability:.2f}" if best else ""
    error = [f"{100 * found.error.get(key, float('nan')):.3g} %" for key in ("refitted", "best")]
    floor = f"{100 * found.error.get('noise_floor', float('nan')):.3g} %"
    return order.name, found.verdict, leader, *error, floor, f"{found.seconds:.0f} s"


HEAD = ("machine", "verdict", "leading candidate", "refitted", "best", "floor", "took")

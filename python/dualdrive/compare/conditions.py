"""The conditions under which a machine may fail: samples of a record, flagged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
#: (kind, condition)
Key = tuple[str, str]

#: share of the largest speed below which the table counts as standing
STANDSTILL = 0.02
#: s on either side of a change of direction, a start or a stop that count as reversal, at most,
#: and of the time between two of them
REVERSAL, SHARE = 0.25, 0.1
WINDOWS = 12
_BANDS = ("slow", "medium", "fast")
_LOADS = ("light", "medium", "heavy")
_SIDES = {"on its back flank": -1, "in its gap": 0, "on its front flank": 1}


class Stretch(Protocol):
    """What of a :class:`~dualdrive.compare.where.Situation` decides its conditions."""

    @property
    def record(self) -> str: ...  # noqa: D102
    @property
    def t(self) -> Array: ...  # noqa: D102
    @property
    def speed(self) -> Array: ...  # noqa: D102
    @property
    def flanks(self) -> Mapping[str, Array]: ...  # noqa: D102
    @property
    def load(self) -> Array | None: ...  # noqa: D102


@dataclass(frozen=True)
class Bands:
    """Limits between three bands of speed and of load, the same for all records.

    Thirds of the moving samples, so that each band has something to say; none where too few
    values occur (constant speed, no torque recorded).
    """

    speed: tuple[float, ...]
    load: tuple[float, ...]

    @classmethod
    def of(cls, speeds: Sequence[Array], loads: Sequence[Array | None]) -> Bands:
        """From all records."""
        size = np.concatenate([np.abs(s) for s in speeds])
        known = [np.abs(load) for load in loads if load is not None]
        load = np.concatenate(known) if len(known) == len(loads) else np.zeros(0)
        return cls(_thirds(size[size > STANDSTILL * np.max(size, initial=0.0)]), _thirds(load))


def _thirds(values: Array) -> tuple[float, ...]:
    if len(values) < 30:
        return ()
    low, high = np.quantile(values, [1 / 3, 2 / 3]).tolist()
    return (low, high) if low < 0.9 * high else ()


def conditions(s: Stretch, bands: Bands, *, many: bool) -> dict[Key, Flags]:
    """Every condition of one record: (kind, condition) -> flags of shape (n,).

    many: there are other records, so that a time is told with the record's name
    """
    limit = STANDSTILL * float(np.max(np.abs(s.speed)))
    sign = np.where(np.abs(s.speed) <= limit, 0, np.sign(s.speed)).astype(int)
    found: dict[Key, Flags] = {
        ("motion", "reversal"): (near := _near_changes(s.t, sign)),
        ("motion", "steady"): ~near & (sign != 0),
        ("motion", "standstill"): ~near & (sign == 0),
        ("direction", "forward"): sign > 0,
        ("direction", "backward"): sign < 0,
    }
    for name, band in zip(_BANDS, _banded(np.abs(s.speed), bands.speed), strict=False):
        for way, own in (("forward", sign > 0), ("backward", sign < 0)):
            found[("speed", f"{name}, {way}")] = band & own
    if s.load is not None:
        for name, band in zip(_LOADS, _banded(np.abs(s.load), bands.load), strict=False):
            found[("torque", f"{name} load")] = band
    found |= _contacts(s.flanks)
    edges = np.linspace(s.t[0], s.t[-1], WINDOWS + 1)
    for low, high in pairwise(edges.tolist()):
        span = f"{low:.3g} .. {high:.3g} s"
        inside = (s.t >= low) & ((s.t < high) | (high == edges[-1]))
        found[("time", f"{s.record}: {span}" if many else span)] = inside
    return found


def _banded(values: Array, limits: tuple[float, ...]) -> list[Flags]:
    edges = [-np.inf, *limits, np.inf]
    return [(values > low) & (values <= high) for low, high in pairwise(edges)] if limits else []


def _contacts(flanks: Mapping[str, Array]) -> dict[Key, Flags]:
    """All meshes together, then each by itself."""
    if not flanks:
        return {}
    contact = np.stack([np.asarray(f, dtype=int) for f in flanks.values()])
    drives = " and ".join(flanks)
    found: dict[Key, Flags] = {
        ("flanks", f"{drives} braced"): (contact.min(0) < 0) & (contact.max(0) > 0),
        ("flanks", f"{drives} on one side"): np.all(contact == contact[0], 0) & (contact[0] != 0),
        ("flanks", "a flank open"): np.any(contact == 0, 0),
    }
    if len(flanks) > 1:
        for mesh, own in zip(flanks, contact, strict=True):
            found |= {("flanks", f"{mesh} {side}"): own == s for side, s in _SIDES.items()}
    return found


def _near_changes(t: Array, sign: NDArray[np.int64]) -> Flags:
    """Samples close to where the direction changes, starts and stops included."""
    changes = t[1:][np.diff(sign) != 0]
    if not len(changes):
        return np.zeros(len(t), dtype=bool)
    after = np.clip(np.searchsorted(changes, t), 0, len(changes) - 1)
    before = np.clip(after - 1, 0, None)
    distance = np.minimum(np.abs(t - changes[after]), np.abs(t - changes[before]))
    between = float(np.median(np.diff(np.concatenate([t[:1], changes, t[-1:]]))))
    near: Flags = distance <= min(REVERSAL, SHARE * between)
    return near

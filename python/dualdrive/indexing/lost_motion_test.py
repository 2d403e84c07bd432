"""Lost motion: by how much a held shaft gives when it is pulled one way and then the other.

    loaded   = | mean position while pulled one way - the same the other way |
    released = | mean position after a pull one way was let go - the same the other way |

The first contains the wind-up under the load; the second is what play and friction keep.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualdrive.display import Tabled
from dualdrive.files import FileError, read_text
from dualdrive.toml_text import parse_toml
from dualdrive.traces.log import Recorder
from dualdrive.traces.mapping import TraceMap
from dualdrive.traces.reading import read_table
from dualdrive.traces.table import numbers

from .rules import IndexingError

__all__ = ["LostMotion", "Pull", "lost_motion", "read_lost_motion"]

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class LostMotion(Tabled):
    """Lost motion of one shaft, in the unit of its positions.

    loaded, released:  as defined above
    pulls:             how often it was pulled either way
    means:             mean positions: (loaded one way, the other way), (released, released)
    """

    name: str
    loaded: float
    released: float
    pulls: tuple[int, int]
    means: tuple[tuple[float, float], tuple[float, float]]

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return vars(self)

    def _cells(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        head = (self.name, "lost motion", "pulled one way", "the other way")
        pulled = tuple(map(str, self.pulls))
        means = [tuple(f"{x:.6g}" for x in pair) for pair in self.means]
        return head, [
            ("loaded", f"{self.loaded:.4g}", *means[0]),
            ("released", f"{self.released:.4g}", *means[1]),
            ("pulls", "", *pulled),
        ]


@dataclass(frozen=True)
class Pull:
    """What pulls one way: columns of its command and position, where it pulls and where it rests.

    reached, at_rest: how far the position may be from either
    """

    command: str
    position: str
    pulled: float
    rest: float
    reached: float
    at_rest: float


def lost_motion(
    position: ArrayLike, pulled: Sequence[ArrayLike], released: ArrayLike, name: str = ""
) -> LostMotion:
    """Lost motion from positions over time and what was done meanwhile.

    position:  of the held shaft, shape (n,);  pulled: two masks, pulled one way and the other
    released:  mask, pulled by nothing. Counted is the first released stretch after each pull

    Samples count alike. Raises IndexingError where a direction is missing.
    """
    x = np.asarray(position, float)
    free = np.asarray(released, bool)
    if len(pulled) != 2:
        raise IndexingError(f"{name}: {len(pulled)} directions of pulling; two are needed")
    sides = [_side(x, np.asarray(mask, bool), free) for mask in pulled]
    for way, (_, loaded, after) in zip(("one way", "the other way"), sides, strict=True):
        if not loaded.size or not after.size:
            missing = "pulled" if not loaded.size else "released after a pull"
            raise IndexingError(f"{name}: never {missing} {way}: lost motion needs both directions")
    (one, up, up_after), (other, down, down_after) = sides
    means = (
        (float(up.mean()), float(down.mean())),
        (float(up_after.mean()), float(down_after.mean())),
    )
    wound_up, kept = (abs(a - b) for a, b in means)
    return LostMotion(name, wound_up, kept, (one, other), means)


def _side(x: Floats, pulled: Mask, free: Mask) -> tuple[int, Floats, Floats]:
    """Pulls one way: how many, positions during them, positions in the release after each."""
    pulls, releases = _stretches(pulled), _stretches(free)
    after = [next((r for r in releases if r.start >= p.stop), None) for p in pulls]
    during = [x[p] for p in pulls]
    then = [x[r] for r in after if r is not None]
    return len(pulls), np.concatenate([[], *during]), np.concatenate([[], *then])


def _stretches(mask: Mask) -> list[slice]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def read_lost_motion(path: str | Path, layout: str | Path) -> list[LostMotion]:
    """Lost motion of every held shaft of a log, as a layout file says.

    layout: TOML with ``shafts`` (columns of positions), ``hold`` (command column -> value while
    the shafts are held), optional ``least`` (samples of a held stretch) and two ``[[pulls]]`` (see
    `Pull`).

    Raises IndexingError or TraceError naming file, column, rule and way out.
    """
    path, layout = Path(path), Path(layout)
    shafts, hold, least, pulls = _layout(layout)
    recorder = Recorder(path, strict=False)
    table = read_table(path, TraceMap(), recorder)

    def column(name: str) -> Floats:
        if name not in table.columns:
            has = ", ".join(list(table.columns)[:8])
            raise IndexingError(f"{path}: no column {name!r} (named in {layout}); it has {has} ...")
        return numbers(table.columns[name])[0]

    held = np.all([column(name) == value for name, value in hold.items()], axis=0)
    for stretch in _stretches(held):
        if stretch.stop - stretch.start < least:
            held[stretch] = False
    pulled = [
        held
        & (column(p.command) == p.pulled)
        & (np.abs(column(p.position) - p.pulled) <= p.reached)
        for p in pulls
    ]
    free = held & np.all(
        [
            (column(p.command) == p.rest) & (np.abs(column(p.position) - p.rest) <= p.at_rest)
            for p in pulls
        ],
        axis=0,
    )
    return [lost_motion(column(shaft), pulled, free, shaft) for shaft in shafts]


def _layout(path: Path) -> tuple[list[str], dict[str, float], int, list[Pull]]:
    try:
        given = parse_toml(read_text(path))
        pulls = [Pull(**pull) for pull in given["pulls"]]
        return list(given["shafts"]), dict(given["hold"]), int(given.get("least", 1)), pulls
    except FileNotFoundError:
        raise IndexingError(f"{path}: there is no such file; check its name") from None
    except FileError as error:
        raise IndexingError(str(error)) from None
    except (TypeError, KeyError, ValueError) as error:
        raise IndexingError(
            f"{path}: {error}: it takes shafts, hold, least and two [[pulls]] with command, "
            "position, pulled, rest, reached, at_rest"
        ) from None

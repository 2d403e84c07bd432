"""A small-signal model with delays put back and loops cut open, at given frequencies.

Each late or open path k has a factor d_k(s): a delay, or 0 where it is cut. What enters there is
less by (1 - d_k) of what leaves its source. With G the model without delays, rows q, columns u:

    u_k = (d_k - 1) q_k,   q = G_qr r + G_qu u   =>   u = (I - (d - 1) G_qu)^-1 (d - 1) G_qr r
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dualdrive.linear.small_signal import SmallSignal
from dualdrive.linear.twin import Late

__all__ = ["Closed", "Path"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Path:
    """A source, the input where it enters, and what happens between them: lateness, or a cut."""

    source: str
    enters: str
    late: tuple[Late, ...] = ()
    cut: bool = False

    def factor(self, s: Complex) -> Complex:
        """d(s), shape as s."""
        passed = np.full(s.shape, not self.cut, np.complex128)
        for late in self.late:
            passed = passed * late.factor(s)
        return passed


class Closed:
    """The machine with these paths late or cut."""

    def __init__(self, system: SmallSignal, late: Sequence[Late], cut: Sequence[str] = ()) -> None:
        self.system = system
        places = dict.fromkeys([*((p.source, p.enters) for p in late), *((c, c) for c in cut)])
        self.paths = [
            Path(
                source,
                enters,
                tuple(p for p in late if (p.source, p.enters) == (source, enters)),
                cut=source == enters and source in cut,
            )
            for source, enters in places
        ]
        self.columns = [system.inputs.index(path.enters) for path in self.paths]
        rows = [system.signals.index(path.source) for path in self.paths]
        self.rows = system.C[rows]
        self.through = system.D[rows]
        for k, path in enumerate(self.paths):  # what enters is no part of what the source gave
            if path.source == path.enters:
                self.through[k, self.columns[k]] -= 1.0

    def response(self, given: Array, read: Array, read_through: Array, s: Complex) -> Complex:
        """From a mix of inputs to a mix of signals, shape as s.

        given: weight of each input, shape (inputs,); read: of each state, shape (states,);
        read_through: of each input, shape (inputs,)
        """
        system = self.system
        mixed = np.column_stack([system.B @ given, system.B[:, self.columns]])
        at = s[:, None, None] * np.eye(len(system.states)) - system.A
        z = np.linalg.solve(at, np.broadcast_to(mixed, (s.size, *mixed.shape)))
        direct = np.column_stack([self.through @ given, self.through[:, self.columns]])
        q = self.rows @ z + direct
        change = np.array([path.factor(s) - 1 for path in self.paths]).reshape(-1, s.size).T
        loop = np.eye(len(self.paths)) - change[:, :, None] * q[:, :, 1:]
        u = np.linalg.solve(loop, change[:, :, None] * q[:, :, :1])[:, :, 0]
        out = read @ z + np.concatenate([[read_through @ given], read_through[self.columns]])
        return np.asarray(out[:, 0] + (out[:, 1:] * u).sum(-1), np.complex128)

"""State space of a machine with its delays: matrices that other programs take.

A delay is its Padé approximant of order 6: all-pass, its phase true to 1 deg up to 1.2 / delay, in
Hz. A held signal is late by half its sample time.
"""

from __future__ import annotations

from math import comb, factorial

import numpy as np
from numpy.typing import NDArray

from dualdrive.linear.closing import Closed, Path
from dualdrive.linear.small_signal import SmallSignal

__all__ = ["ORDER", "realise"]

Array = NDArray[np.float64]

ORDER = 6


def realise(closed: Closed, order: int = ORDER) -> SmallSignal:
    """The same inputs and signals with the paths of `closed` late or cut; SI."""
    system = closed.system
    delays = [_pade(path, order) for path in closed.paths]
    n = len(system.states)
    extra = [f"delay of {p.source}[{k}]" for p, d in zip(closed.paths, delays, strict=True)
             for k in range(d[0].shape[0])]  # fmt: skip
    size = n + len(extra)
    # q = R z + S r + T u,  u = H x + E q with dx/dt = F x + G q and E = d(infinity) - 1
    R, through = closed.rows, closed.through
    columns = closed.columns
    F, G = np.zeros((len(extra), len(extra))), np.zeros((len(extra), len(delays)))
    H, E = np.zeros((len(delays), len(extra))), np.zeros(len(delays))
    at = 0
    for k, (f, g, h, e) in enumerate(delays):
        span = slice(at, at := at + f.shape[0])
        F[span, span], G[span, k], H[k, span], E[k] = f, g, h, e
    T = through[:, columns]
    loop = np.linalg.inv(np.eye(len(delays)) - E[:, None] * T)
    # u as a law of (z, x) and of the inputs r
    u_of_state = loop @ np.hstack([E[:, None] * R, H])
    u_of_input = loop @ (E[:, None] * through)
    q_of_state = np.hstack([R, np.zeros_like(H)]) + T @ u_of_state
    q_of_input = through + T @ u_of_input
    inner, out = system.B[:, columns], system.D[:, columns]
    A = np.zeros((size, size))
    A[:n, :n] = system.A
    A[n:, n:] = F
    A[:n] += inner @ u_of_state
    A[n:] += G @ q_of_state
    return SmallSignal(
        states=(*system.states, *extra),
        inputs=system.inputs,
        signals=system.signals,
        units=system.units,
        A=A,
        B=np.vstack([system.B + inner @ u_of_input, G @ q_of_input]),
        C=np.hstack([system.C, np.zeros((len(system.signals), len(extra)))]) + out @ u_of_state,
        D=system.D + out @ u_of_input,
        modes=system.modes,
    )


def _pade(path: Path, order: int) -> tuple[Array, Array, Array, float]:
    """(F, G, H, E) of d(s) - 1, d a delay or 0."""
    delay = sum(late.mean for late in path.late)
    if path.cut or delay == 0:
        return np.zeros((0, 0)), np.zeros(0), np.zeros(0), -1.0 if path.cut else 0.0
    # exp(-p) ~ N(-p)/N(p), N(p) = sum c_k p^k; time is counted in delays, so that sizes stay near 1
    c = [factorial(2 * order - k) * comb(order, k) / factorial(2 * order) for k in range(order + 1)]
    F = np.diag(np.ones(order - 1), 1)
    F[-1] = [-c[k] / c[order] for k in range(order)]
    G = np.zeros(order)
    G[-1] = 1.0
    top = (-1.0) ** order
    H = np.array([(c[k] * (-1) ** k - top * c[k]) / c[order] for k in range(order)])
    return F / delay, G / delay, H, top - 1.0

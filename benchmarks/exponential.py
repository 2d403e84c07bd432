"""Which exponential method: error by step, on the bench with one law in frozen modes.

    python benchmarks/exponential.py

z' = A z + b(t) + n(z), A and b of the bench of laws.py read off the library with both meshes
closed, one second of its sine, n written out here: 2 % torque ripple, six to a turn of the motors.
Constant steps and no switches: this says how long a step may be, not what an engine would cost.
Errors are those of the worst state at the end over its own size, against the finest run.

Lawson: classical order 4, and order 8 by Dormand and Prince. Krogstad: order 4 with φ-functions
(J. Comput. Phys. 203 (2005) 72-88). Adams: exponential predictor and corrector of order 6.
Collocation: eight steps as one, n a polynomial through the nine points, predicted by
extrapolation of up to six values and swept once more; what cpp/src/solvers/exponential does.
"""

from __future__ import annotations

from collections.abc import Callable
from math import factorial, pi

import numpy as np
from scipy.integrate._ivp import dop853_coefficients as dop853
from scipy.linalg import expm

import laws
import report
from case import Array, reference
from dualdrive import _core

END = 1.0  # s
RIPPLE, ORDER = 0.02, 6
MODES = {"mesh_1": "front", "mesh_2": "back"}
HALVINGS = range(7, 13)  # of a second
ORDER_OF_ADAMS, PARTS_OF_START = 6, 32
Law = Callable[[Array], Array]
#: c, A, b
RK4: tuple[Array, Array, Array] = (
    np.array([0, 0.5, 0.5, 1]),
    np.diag([0.5, 0.5, 1.0], -1),
    np.array([1, 2, 2, 1]) / 6,
)
DOP853: tuple[Array, Array, Array] = (dop853.C[:12], dop853.A[:12, :12], dop853.B)


def system() -> tuple[Array, Law, Array, int]:
    """A with the sine as two more states and 1 as the last, n, the start, how many are states."""

    def excited(command: _core.Waveform) -> _core.LinearSystem:
        return _core.linearise(laws.machine("bench"), {"theta_ref": command}, modes=MODES)

    plain, sine = excited(_core.constant(0.0)), laws.MACHINES["bench"]
    n, w = len(plain.states), 2 * pi * sine.frequency
    A = np.zeros((n + 3, n + 3))
    A[:n, :n] = plain.A
    A[:n, n] = sine.amplitude * (excited(_core.constant(1.0)).a - plain.a)
    A[:n, n + 1] = sine.amplitude * w * (excited(_core.ramp(1.0)).a - plain.a)
    A[:n, n + 2] = plain.a
    A[n, n + 1], A[n + 1, n] = w, -w
    at = {name: k for k, name in enumerate(plain.states)}
    drive = reference.bench().drives[0]
    inertia = drive.J_c + drive.i**2 * drive.J_d

    def ripple(y: Array) -> Array:
        f = np.zeros(n + 3)
        for k in (1, 2):
            pinion = 4 * y[at["theta_m"]] + y[at[f"mesh_{k}.twist"]]
            torque = drive.i * drive.K_d * y[at[f"I_{k}"]]
            f[at[f"omega_c{k}"]] = RIPPLE * torque * np.sin(ORDER * drive.i * pinion + k) / inertia
        return f

    start = np.zeros(n + 3)
    start[-2:] = 1.0
    return A, ripple, start, n


def phi(A: Array, h: float, most: int) -> list[Array]:
    """φ_0 to φ_most of A h, read off one exponential."""
    n = len(A)
    M = np.kron(np.eye(most + 1, k=1), np.eye(n))
    M[:n, :n] = h * A
    return list(np.split(expm(M)[:n], most + 1, axis=1))


def lawson(A: Array, f: Law, y: Array, h: float, tableau: tuple[Array, Array, Array]) -> Array:
    c, a, b = tableau
    stages = range(len(b))
    into = [[expm(A * h * (c[i] - c[j])) for j in range(i)] for i in stages]
    start, end = [expm(A * h * x) for x in c], [expm(A * h * (1 - x)) for x in c]
    whole = expm(A * h)
    for _ in range(round(END / h)):
        k: list[Array] = []
        for i in stages:
            k.append(f(start[i] @ y + h * sum(a[i, j] * (into[i][j] @ k[j]) for j in range(i))))
        y = whole @ y + h * sum(b[j] * (end[j] @ k[j]) for j in stages)
    return y


def krogstad(A: Array, f: Law, y: Array, h: float, steps: int) -> Array:
    P, Q = phi(A, h, 3), phi(A, h / 2, 2)
    for _ in range(steps):
        k1 = f(y)
        k2 = f(Q[0] @ y + h / 2 * Q[1] @ k1)
        k3 = f(Q[0] @ y + h * ((Q[1] / 2 - Q[2]) @ k1 + Q[2] @ k2))
        k4 = f(P[0] @ y + h * ((P[1] - 2 * P[2]) @ k1 + 2 * P[2] @ k3))
        ends = (P[1] - 3 * P[2] + 4 * P[3]) @ k1 + (4 * P[3] - P[2]) @ k4
        y = P[0] @ y + h * (ends + (2 * P[2] - 4 * P[3]) @ (k2 + k3))
    return y


def adams(A: Array, f: Law, y: Array, h: float) -> Array:
    q = ORDER_OF_ADAMS
    P = phi(A, h, q + 1)

    def weights(first: int) -> list[Array]:
        """Of n at times first, first − 1, ... −q + 1, in steps from the step's begin."""
        times = np.arange(first, -q, -1.0)
        inverse = np.linalg.inv(np.vander(times, increasing=True).T)
        return [
            np.sum([row[j] * factorial(j) * P[j + 1] for j in range(len(times))], axis=0)
            for row in inverse
        ]

    before, beside = weights(0), weights(1)
    past = [f(y)]
    for _ in range(q - 1):
        y = krogstad(A, f, y, h / PARTS_OF_START, PARTS_OF_START)
        past.insert(0, f(y))
    for _ in range(round(END / h) - (q - 1)):
        guess = P[0] @ y + h * sum(w @ k for w, k in zip(before, past, strict=True))
        y = P[0] @ y + h * sum(w @ k for w, k in zip(beside, [f(guess), *past], strict=True))
        past = [f(y), *past[: q - 1]]
    return y


def through(times: Array, at: float) -> Array:
    """Derivatives at `at` of the polynomial through values at `times`, order by order."""
    powers = np.linalg.inv(np.vander(times - at, increasing=True))
    return np.array([factorial(k) * row for k, row in enumerate(powers)])


def collocation(A: Array, f: Law, y: Array, h: float, sweeps: int = 1) -> Array:
    """`sweeps` after the prediction; values of n beside the last sweep's are not taken again."""
    intervals, back = 8, 6
    places = np.arange(intervals + 1.0)
    P = phi(A, h, intervals + 1)
    at_node = [through(places, j) for j in range(intervals)]
    backward = [through(-np.arange(p + 1.0), 0.0) for p in range(back)]

    def step(y: Array, derivatives: Array) -> Array:
        return P[0] @ y + h * sum(P[k + 1] @ c for k, c in enumerate(derivatives))

    past: list[Array] = []
    for _ in range(round(END / h / intervals)):
        states = [y]
        values = [f(y)]
        for _ in range(intervals):
            latest = [*reversed(values), *past][:back]
            states.append(step(states[-1], backward[len(latest) - 1] @ np.array(latest)))
            values.append(f(states[-1]))
        for sweep in range(sweeps):
            for j in range(intervals):
                states[j + 1] = step(states[j], at_node[j] @ np.array(values))
            if sweep + 1 < sweeps:
                values[1:] = [f(state) for state in states[1:]]
        past = values[-2::-1]
        y = states[-1]
    return y


def main() -> None:
    A, f, start, n = system()
    true = adams(A, f, start, 2.0 ** -(HALVINGS[-1] + 1))[:n]
    size = np.maximum(np.abs(true), 1e-3 * np.abs(true).max())
    methods: dict[str, Callable[[float], Array]] = {
        "Lawson 4 (4)": lambda h: lawson(A, f, start, h, RK4),
        "Lawson 8 (12)": lambda h: lawson(A, f, start, h, DOP853),
        "Krogstad 4 (4)": lambda h: krogstad(A, f, start, h, round(END / h)),
        "Adams 6 (2)": lambda h: adams(A, f, start, h),
        "Collocation 9 (1)": lambda h: collocation(A, f, start, h),
        "Collocation 9 (2)": lambda h: collocation(A, f, start, h, sweeps=2),
    }
    rows = [
        [
            f"{1e3 * h:.2f}",
            *(f"{(np.abs(do(h)[:n] - true) / size).max():.0e}" for do in methods.values()),
        ]
        for h in (2.0**-k for k in HALVINGS)
    ]
    poles = sorted(abs(np.linalg.eigvals(A)))[-2:]
    print(f"Fastest poles {poles[0]:.0f} and {poles[1]:.0f} 1/s.")
    print("In brackets: evaluations of n a step.\n")
    print(report.table(["step, ms", *methods], rows))


if __name__ == "__main__":
    main()

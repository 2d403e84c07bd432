"""How far apart a case's own kind of record keeps an effect from its rivals.

Amplitudes are drawn by what the loop shows of a machine whose friction is alike both ways
(`distance.py`). A user knows less. Dry friction may lean: its asymmetry is free here, beside the
nominal numbers. And whose controller is unknown has but torques and motion: what their equations
of motion show above the noise that the sensors leave in them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from tests.blind.generator import rivals
from tests.blind.generator.distance import COARSE, Bench, Nominals
from tests.blind.generator.effects import Hidden, Setting
from tests.blind.generator.records import Plan

Array = NDArray[np.float64]
LEAN = 0.2  # one sigma of the asymmetry of dry friction
_STEP = 0.05
_REACH = 4  # samples
_STILL = 0.01  # of the highest speed: below it dry friction may take any value
#: the sheet's dry friction -> the engine's word for how it leans
_LEANS = {"dry_table": "t_asymmetry", "dry_pinions": "p_asymmetry"}


def apart(hidden: Hidden, setting: Setting, bench: Bench, mode: str) -> tuple[float, str]:
    """(squared distance, rival): what of that record neither the sheet's numbers nor a rival has.

    mode: of the record, ``closed_loop`` or ``balance``
    """
    own = Equations(bench.machine, bench.plans, bench.recorder) if mode == "balance" else bench
    return rivals.nearest(hidden, setting, Leaning(own))


class Leaning(Nominals):
    """Nominal numbers, and the asymmetry of every dry friction that the sheet states."""

    def __init__(self, bench: Bench) -> None:
        super().__init__(bench)
        columns = []
        for path, word in _LEANS.items():
            if bench.machine.get(path, 0.0) > 0.0:
                leaning = Hidden("asymmetry", path, "", {word: _STEP}, {})
                columns.append((bench.record((leaning,)) - self.at_truth) * LEAN / _STEP)
        self.slopes = np.column_stack([self.slopes, *columns])
        count = self.slopes.shape[1]
        self._normal = np.linalg.inv(self.slopes.T @ self.slopes + np.eye(count))


class Equations(Bench):
    """The same records as three equations of motion: of the table and of both drives.

    What a changed machine leaves in the equations of the true one, white in units of the noise
    that the sensors of torques and angles leave there; nothing where a body stands or a flank is
    met or left, which no difference of samples follows.
    """

    def _records(self, machine: Mapping[str, float], effects: tuple[Hidden, ...]) -> Array:
        rows = []
        for plan in self.plans:
            made = plan.truth(machine, effects, step=COARSE)
            rows.append(self._whitened(plan, self._left(made, plan.sample)))
        return np.concatenate(rows)

    def _left(self, made: Mapping[str, Array], dt: float) -> Array:
        """Residuals of table and drives, N*m in each body's frame, (3, n)."""
        m = self.machine
        i, i_m = m["gearboxes.ratio"], m["meshes.ratio"]
        inertia = m["pinions.J"] + i**2 * m["motors.J"]
        drag = m.get("pinions.b", 0.0) + i**2 * m.get("motors.b", 0.0)
        table = made["theta_m"]
        speed = np.gradient(table, dt)
        moving = np.abs(speed) > _STILL * np.abs(speed).max()
        at_table = -m["table.J"] * np.gradient(speed, dt) - m.get("table.b", 0.0) * speed
        at_table -= m.get("dry_table", 0.0) * np.sign(speed)
        rows = []
        for n in (1, 2):
            angle = made[f"theta_{n}"] / i
            rate = np.gradient(angle, dt)
            moving &= np.abs(rate) > _STILL * np.abs(rate).max()
            twist = angle - i_m * table
            beyond = twist - np.clip(twist, -m["meshes.gap"], m["meshes.gap"])
            damping = m.get("mesh_damping", 0.0) * (rate - i_m * speed)
            moving &= ~_near_a_change(np.sign(beyond))
            mesh = np.where(beyond != 0.0, m["meshes.stiffness"] * beyond + damping, 0.0)
            at_table = at_table + i_m * mesh
            friction = m.get("dry_pinions", 0.0) * np.sign(rate)
            left = i * made[f"T_{n}"] - inertia * np.gradient(rate, dt) - drag * rate
            rows.append(left - friction - mesh)
        return np.where(moving, np.stack([at_table, *rows]), 0.0)

    def _whitened(self, plan: Plan, left: Array) -> Array:
        """Real and imaginary parts of every bin but the first, a constant, in units of noise."""
        n = left.shape[1]
        bins = np.fft.rfft(left, axis=1, norm="ortho").T
        white = np.linalg.solve(np.linalg.cholesky(self._noise(n, plan.sample)), bins[:, :, None])
        kept = np.sqrt(2.0) * white[1:, :, 0]
        return np.concatenate([kept.real.ravel(), kept.imag.ravel()])

    def _noise(self, n: int, dt: float) -> NDArray[np.complex128]:
        """Covariance of each bin of the three equations, (bins, 3, 3), flanks closed."""
        m, sensors = self.machine, self.recorder.sensors
        i, i_m = m["gearboxes.ratio"], m["meshes.ratio"]
        slope = 1j * np.sin(2 * np.pi * np.fft.rfftfreq(n)) / dt  # central differences
        mesh = m["meshes.stiffness"] + m.get("mesh_damping", 0.0) * slope
        inertia = m["pinions.J"] + i**2 * m["motors.J"]
        drag = m.get("pinions.b", 0.0) + i**2 * m.get("motors.b", 0.0)
        own = -(inertia * slope**2 + drag * slope + mesh)
        table = -(m["table.J"] * slope**2 + m.get("table.b", 0.0) * slope + 2 * i_m**2 * mesh)
        none = np.zeros_like(mesh)
        turned = i_m * mesh
        ways = {
            "theta_m": np.stack([table, turned, turned]),
            "theta_1": np.stack([turned, own, none]) / i,
            "theta_2": np.stack([turned, none, own]) / i,
            "T_1": np.stack([none, none + i, none]),
            "T_2": np.stack([none, none, none + i]),
        }
        whole = np.zeros((len(slope), 3, 3), dtype=np.complex128)
        for name, way in ways.items():
            spectrum = sensors[name].spectrum(n, dt)
            whole += np.einsum("ak,bk,k->kab", way, way.conj(), spectrum)
        size = np.real(np.einsum("kaa->ka", whole))
        result: NDArray[np.complex128] = whole + 1e-9 * size[:, :, None] * np.eye(3)
        return result


def _near_a_change(flank: Array) -> NDArray[np.bool_]:
    """Samples next to those at which a flank is met or left, (n,)."""
    near = np.zeros(len(flank), dtype=bool)
    for k in np.flatnonzero(np.diff(flank) != 0.0):
        near[max(0, k - _REACH) : k + 2 + _REACH] = True
    return near

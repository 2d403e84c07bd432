"""Every equation of motion and mesh law on one record: what it leaves, and what may excuse it.

On the recorded motion each body's equation must close. A mesh law that is wrong by a torque e
leaves e at its pinion and −i_m e at the table; a body's own equation that is wrong leaves its
torque there alone. So the directions in which the residuals move tell which law fails, once
everything that may excuse them is free: nominal numbers within their tolerances, a constant torque
per motor, and the unknown zeros of the encoders.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.compare.held import Held, Samples
from dualdrive.identify.filtering import ANGLES
from dualdrive.identify.model import TORQUES
from dualdrive.identify.readings import before_sensors

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: constant of a torque sensor, as a share of its signal: more is a torque, not a sensor
CONSTANT = 0.03
#: constant of the law, whose integrators begin somewhere, as a share of the torque
LAW_CONSTANT = 0.01
#: no equation is believed better than this share of the torque measured in it
BELIEF = 0.01


@dataclass(frozen=True, eq=False)
class Laws:
    """What a machine's equations, and its controller's law, leave: m rows, n samples.

    residual:   shape (m, n), N*m in each equation's own frame
    slopes:     by the model's parameters, shape (m, n, parameters)
    angles:     by the angle that each drive's encoder reads, shape (m, n, encoders)
    table:      by the angle that the table's encoder reads, shape (m, n)
    directions: mesh -> how a torque of it enters the equations, shape (m,)
    noise:      covariance that the sensors alone leave, shape (n, m, m)
    driven:     equations with a motor's torque, whose sensor may have a constant; the law has none
    constants:  how large one is believed to be, one sigma, shape (len(driven),)
    """

    held: Held
    residual: Array
    slopes: Array
    angles: Array
    table: Array
    directions: Mapping[str, Array]
    noise: Array
    driven: tuple[int, ...]
    constants: Array
    rates: Array

    @property
    def keep(self) -> Flags:
        """Samples that count, shape (n,)."""
        return self.held.keep

    @property
    def speeds(self) -> Array:
        """Of the angles that the drives' encoders read, shape (n, encoders)."""
        found = [self.held.samples[ANGLES[angle][0]] for angle in self.held.encoders]
        return np.stack(found, axis=1) if found else np.zeros((len(self.held.t), 0))


def balance(
    core: Any, held: Held, samples: Samples, paths: Sequence[str] = ()
) -> tuple[Array, Array]:
    """Residual (m, n) and its slopes (m, n, paths)."""
    found = _core.torque_balance(core, dict(before_sensors(core, samples)), list(paths))
    rows = [found["equations"].index(name) for name in held.equations]
    return found["residual"][rows], found["jacobian"][rows]


def shifted(samples: Samples, zeros: Mapping[str, float]) -> Samples:
    """The same with constants taken off the angles."""
    return {**samples, **{angle: samples[angle] - zero for angle, zero in zeros.items()}}


def laws(core: Any, held: Held, paths: Sequence[str], zeros: Mapping[str, float]) -> Laws:
    """The equations of a machine, with the encoders' zeros (channel -> rad) taken off."""
    samples = shifted(held.samples, zeros)
    residual, slopes = balance(core, held, samples, paths)
    idle = {**samples, **{name: 0.0 * samples[name] for name in TORQUES if name in samples}}
    measured = balance(core, held, idle)[0] - residual
    known = (*held.encoders, "theta_m") if held.encoders else ()
    errors = {a: held.noisy[a] - held.samples[a] for a in known}
    by_angle = {a: _by_angle(core, held, samples, residual, a) for a in known}
    angles = [by_angle[a] for a in held.encoders]
    by_encoder = np.stack(angles, axis=2) if angles else np.zeros((*residual.shape, 0))
    more, count = len(held.asked), len(residual)
    noise = np.zeros((len(held.t), count + more, count + more))
    noise[:, :count, :count] = _noise(core, held, zeros, residual, measured, errors)
    noise[:, range(count, count + more), range(count, count + more)] = held.doubt**2
    directions = _directions(core, held, samples)
    driven = [k for k, row in enumerate(measured) if np.any(row != 0.0)]
    sizes = np.sqrt(np.mean(measured[driven] ** 2, axis=1))
    return Laws(
        held,
        np.concatenate([residual, held.asked]),
        _with_rows(slopes, more),
        _with_rows(by_encoder, more),
        _with_rows(by_angle.get("theta_m", np.zeros(residual.shape)), more),
        {mesh: _with_rows(own, more) for mesh, own in directions.items()},
        noise,
        (*driven, *range(count, count + more)),
        np.concatenate([CONSTANT * sizes, LAW_CONSTANT * _sizes(core, samples)[:more]]),
        _with_rows(np.gradient(measured, held.t, axis=1), more),
    )


def _sizes(core: Any, samples: Samples) -> Array:
    """RMS torque of each motor, shape (motors,)."""
    torques = [samples[f"T_{motor.rpartition('_')[2]}"] for motor in core.motors]
    found: Array = np.sqrt(np.mean(np.square(torques), axis=1))
    return found


def _with_rows(values: Array, more: int) -> Array:
    """The same with rows of zeros below: the controller's law knows no number of the plant."""
    return np.concatenate([values, np.zeros((more, *values.shape[1:]))])


def _by_angle(core: Any, held: Held, samples: Samples, residual: Array, angle: str) -> Array:
    """How the equations move with a constant added to an angle, shape (m, n)."""
    step = 1e-7 * float(np.ptp(samples[angle])) + 1e-12
    moved, _ = balance(core, held, shifted(samples, {angle: -step}))
    return (moved - residual) / step


def _noise(
    core: Any,
    held: Held,
    zeros: Mapping[str, float],
    residual: Array,
    measured: Array,
    errors: Mapping[str, Array],
) -> Array:
    """Covariance per sample: of torques and accelerations everywhere, of twists while in contact.

    Near the end of a contact the twist's noise decides whether there is one, so its effect is taken
    over twice its size to either side.
    """
    samples = shifted(held.samples, zeros)
    angles_as_they_are = {a: samples[a] for a in errors}
    shaken, _ = balance(core, held, {**shifted(held.noisy, zeros), **angles_as_they_are})
    left = (shaken - residual)[:, held.keep]
    size = np.quantile(np.abs(left), 0.9, axis=1) if left.size else np.zeros(len(left))
    calm = np.all(np.abs(left) <= 5.0 * size[:, None], axis=0)
    base = np.cov(left[:, calm]).reshape(len(left), len(left)) if calm.sum() > 8 else 0.0
    base = base + np.diag(_beliefs(residual, measured) ** 2)
    whole: Array = np.broadcast_to(base, (residual.shape[1], *base.shape)).copy()
    for angle, error in errors.items():
        spread = float(np.std(error))
        reach = 2.0 * spread + 1e-15
        sides = [
            (balance(core, held, shifted(samples, {angle: -s}))[0] - residual) / s
            for s in (reach, -reach)
        ]
        larger = np.abs(sides[0]).sum(axis=0) > np.abs(sides[1]).sum(axis=0)
        column = spread * np.where(larger, *sides).T
        whole += column[:, :, None] * column[:, None, :]
    return whole


def _beliefs(residual: Array, measured: Array) -> Array:
    """A share of the torque in each equation; of all torques where none is measured."""
    own = np.sqrt(np.mean(measured**2, axis=1))
    own = np.where(own > 0.0, own, np.max(own, initial=0.0))
    reach = np.sqrt(np.mean(residual**2, axis=1))
    result: Array = BELIEF * np.maximum(own, 1e-3 * reach) + 1e-300
    return result


def _directions(core: Any, held: Held, samples: Samples) -> dict[str, Array]:
    """How the torque of every mesh, or other connection that gives, enters the equations."""
    given = [c for c in core.connections if core.kind(c) != "rigid"]
    if not given or held.equations == ("total",):
        return {}
    found = {}
    _, slopes = balance(core, held, samples, [f"{c}.stiffness" for c in given])
    for k, name in enumerate(given):
        size = np.abs(slopes[:, :, k]).sum(axis=0)
        if np.max(size, initial=0.0) > 0.0:
            own = slopes[:, int(np.argmax(size)), k]
            found[name] = own / np.linalg.norm(own)
    return found

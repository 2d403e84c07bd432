"""Whether estimates reach the Cramér-Rao bound, and what unknown torque costs.

    python benchmarks/cramer_rao.py                  100 draws of the noise, about two minutes
    python benchmarks/cramer_rao.py --draws 400

The bench at its reversals, sensors' noise of known colour, nothing else unknown: numbers are fitted
to each draw from 5 % beside the truth, gains as the true noise has them. Their scatter is compared
with the inverse of the information that the slopes of the residuals hold (priors as the estimator
has them: van Trees, Detection, Estimation, and Modulation Theory I, 2.4). Then the same draws with
a torque of unknown course allowed for that was not there.
"""

from __future__ import annotations

import argparse

import numpy as np
from numpy.typing import NDArray

import dualdrive as dd
from dualdrive.estimation.unknowns import unknowns
from dualdrive.innovations import GreyBox, Noise, Variant, first_noise, fit, predictable, slopes
from dualdrive.replay import core_of, records
from dualdrive.traces import Trace
from landscape import KINDS, SENSORS, coloured
from report import table

Array = NDArray[np.float64]

STEP, SPAN = 1e-3, 4.0  # s
#: what is estimated
NUMBERS = ("table.J", "table.b", "motors.J", "motors.b", "meshes.stiffness")
TOLERANCE = 1.0  # of each: so little is believed before that the record decides
BEGIN = 0.05  # off the truth, where fits begin
#: of the drives' torque, what of unknown course the filter allows for
SHARES = (0.0, 1e-5, 1e-4, 1e-3, 1e-2)


def run(machine: dd.Machine) -> tuple[Array, dict[str, Array]]:
    """Times and what is true at them."""
    t = STEP * np.arange(round(SPAN / STEP))
    motion = dd.motion.shuttle(0.05, 0.1, 1.0, 20.0)
    found = dd.simulate(machine, motion, times=t, signals=["theta_ref", *SENSORS], energy=False)
    return t, {c: np.array(found[c]) for c in ("theta_ref", *SENSORS)}


def noisy(t: Array, true: dict[str, Array], draw: int) -> Trace:
    """The same as sensors say it."""
    random = np.random.default_rng([17, draw])
    columns = {"theta_ref": true["theta_ref"]}
    for channel, sensor in SENSORS.items():
        # a simulation begins at the first sample's angles, which nothing corrects later
        columns[channel] = true[channel] + coloured(random, len(t), *sensor, first=0.0)
    return Trace(t, columns, name="record")


def box(machine: dd.Machine, trace: Trace) -> GreyBox:
    """The numbers, and one record."""
    core = core_of(machine)
    free = unknowns(core, list(NUMBERS), dict.fromkeys(NUMBERS, TOLERANCE), {})
    played = predictable(core, records(machine, {"record": trace}, start="rest"))
    return GreyBox(core, played, free)


def bound(grey: GreyBox, theta: Array, noise: Noise) -> Array:
    """Standard deviations that the information allows the estimator, of its unknowns."""
    nothing = Variant(grey.core)
    gains = grey.gains(nothing, theta, noise)
    [point] = grey.points([nothing], [theta], gains)
    J = np.stack(slopes(grey, point, range(len(theta)), gains))
    information = J @ J.T
    inverse = np.linalg.inv(information + np.diag(1.0 / grey.sigma**2))
    return np.sqrt(np.diag(inverse @ information @ inverse))


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--draws", type=int, default=100, help="of the noise")
    asked = parser.parse_args()
    machine = dd.Machine.load("bench")
    t, true = run(machine)
    grey = box(machine, noisy(t, true, 0))
    nothing = Variant(grey.core)
    theta = grey.start(nothing)
    count = len(grey.nominal)
    wide = first_noise(grey.core, grey.records, 1.0)
    sensors = Noise(
        {KINDS[c]: SENSORS[c][0] for c in KINDS}, {KINDS[c]: SENSORS[c][1] for c in KINDS}, {}
    )
    least = bound(grey, theta, sensors)[:count]
    names = [p.path for p in grey.nominal]
    rows, lost = [], []
    for share in SHARES:
        torque = {body: share * s for body, s in wide.torque.items()} if share else {}
        noise = Noise(sensors.drive, sensors.memory, torque, wide.course)
        found = []
        for draw in range(asked.draws):
            own = box(machine, noisy(t, true, draw))
            begin = theta.copy()
            begin[:count] += BEGIN * np.random.default_rng([18, draw]).choice([-1.0, 1.0], count)
            gains = own.gains(nothing, theta, noise)
            found.append(fit(own, nothing, begin, gains, steps=30).theta[:count] - theta[:count])
        off = np.stack(found)
        scatter, bias = off.std(axis=0, ddof=1), off.mean(axis=0)
        if not share:
            sure = bias / (scatter / np.sqrt(asked.draws))
            rows = [
                [n, f"{b:.2e}", f"{s:.2e}", f"{s / b:.2f}", f"{z:+.1f}"]
                for n, b, s, z in zip(names, least, scatter, sure, strict=True)
            ]
        own_bound = bound(grey, theta, noise)[:count]
        lost.append(
            [
                f"{share:g}",
                *(
                    f"{s / b:.2f} ({o / b:.2f})"
                    for s, b, o in zip(scatter, least, own_bound, strict=True)
                ),
            ]
        )
    print(table(["number", "bound", "scatter", "over the bound", "bias, sigma of the mean"], rows))
    print(f"\nScatter of {asked.draws} draws over the bound; in brackets what the filter's own")
    print("information says.\n")
    print(table(["unknown torque allowed for, of the drives'", *names], lost))


if __name__ == "__main__":
    main()

"""Make the demo's measured traces: a heavy rotary table with an effect its data sheet lacks.

    python tools/make_demo_trace.py [FOLDER]        default: python/dualdrive/demo

Two records of the same machine are written, `fit.csv` and `held_out.csv`, each 18 s at 100 Hz. The
table carries 100 t and starts at rest with its pinions mid-gap; the drives are switched on at t = 0
with `controller.T_ten` = 28 N m, brace the ring within half a second, and then make the
jerk-limited moves listed below. The tension is low for this table: now and then a flank lifts for a
moment.

    tools/demo_nominal.toml   the machine as its data sheet has it: every number, by parameter path
    tests/py/demo_truth.toml  by how much the recorded one differs, the hidden effect, the noise

The commanded motion is recorded without noise (theta_ref, omega_ref). The table angle, both motor
angles and both currents carry coloured noise and are rounded to the step of their encoder or
converter. The loop itself runs on the true signals. Everything comes from the plain reference model
(exact solution mode by mode, true sticking), never from the product.
"""

from __future__ import annotations

import sys
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import lfilter

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "py"))

from reference_model import (  # noqa: E402
    Array,
    Controller,
    Drive,
    Machine,
    Motion,
    Trajectory,
    move,
    simulate,
)

ARCSEC = np.pi / 180 / 3600
DURATION, SAMPLE = 18.0, 1e-2
FOLDER = ROOT / "python" / "dualdrive" / "demo"

Move = tuple[float, float, float, float, float]
RECORDS: dict[str, tuple[Move, ...]] = {  # distance rad, v, a, j, start s: each begins at rest
    "fit": (
        (0.020, 0.020, 0.012, 0.05, 1.5),
        (-0.020, 0.020, 0.012, 0.05, 5.0),
        (0.004, 0.002, 0.008, 0.05, 8.5),
        (-0.004, 0.002, 0.008, 0.05, 11.5),
        (0.001, 0.005, 0.010, 0.10, 14.5),
        (-0.001, 0.005, 0.010, 0.10, 16.0),
    ),
    "held_out": (
        (-0.012, 0.012, 0.010, 0.04, 1.5),
        (0.030, 0.025, 0.012, 0.05, 4.5),
        (-0.003, 0.003, 0.008, 0.05, 9.0),
        (-0.015, 0.015, 0.012, 0.06, 11.5),
        (0.0015, 0.003, 0.010, 0.10, 15.0),
        (0.0015, 0.003, 0.010, 0.10, 16.5),
    ),
}
COLUMNS = {  # header: format
    "t [s]": "%.2f",
    "theta_ref [rad]": "%.9f",
    "omega_ref [rad/s]": "%.8f",
    "theta_m [arcsec]": "%.2f",
    "theta_1 [rad]": "%.6f",
    "theta_2 [rad]": "%.6f",
    "I_1 [A]": "%.2f",
    "I_2 [A]": "%.2f",
}


def nominal() -> dict[str, float]:
    """Return the data sheet: parameter path to SI value."""
    file = ROOT / "tools" / "demo_nominal.toml"
    return dict(tomllib.loads(file.read_text(encoding="utf-8"))["nominal"])


def truth() -> dict[str, Any]:
    """Return what the recorded machine really is, and the noise of its sensors."""
    file = ROOT / "tests" / "py" / "demo_truth.toml"
    return tomllib.loads(file.read_text(encoding="utf-8"))


def recorded_machine() -> Machine:
    """Return the machine behind the records."""
    sealed, value = truth(), nominal()
    for path, factor in sealed["factors"].items():
        value[path] *= factor
    return build(value, sealed["effect"]["torque"])


def build(value: dict[str, float], friction: float = 0.0) -> Machine:
    """Return the machine with these parameters and Coulomb friction at the table."""
    drive = Drive(
        i=value["gearboxes.ratio"],
        J_d=value["motors.J"],
        J_c=value["pinions.J"],
        b_d=value["motors.b"],
        b_c=value["pinions.b"],
        K_d=value["motors.K_d"],
        C_e=value["motors.C_e"],
        R=value["motors.R"],
        L=value["motors.L"],
        T_max=value["motors.T_max"],
        U_max=value["motors.U_max"],
        K_t=value["meshes.stiffness"],
        gap=value["meshes.gap"],
        c=value["meshes.damping"],
    )
    settings: dict[str, Any] = {
        path.removeprefix("controller."): number
        for path, number in value.items()
        if path.startswith("controller.")
    }
    machine = Machine(
        (drive, drive),
        value["meshes.ratio"],
        value["table.J"],
        value["table.b"],
        Controller(**settings),
    )
    return replace(machine, friction=(friction, friction))


def commanded(record: str) -> Motion:
    """Return the moves of a record one after the other."""
    motion, angle = Motion(), 0.0
    for distance, v, a, j, start in RECORDS[record]:
        if motion.breakpoints and start < motion.breakpoints[-1][0]:
            raise ValueError(
                f"{record}: the move at {start} s begins before the last one has ended"
            )
        motion += move(distance, v, a, j, start, origin=angle)
        angle += distance
    return motion


def run(machine: Machine, record: str) -> Trajectory:
    """Let a machine make the moves of a record, sampled as recorded."""
    return simulate(machine, commanded(record), DURATION, grid=SAMPLE)


def signals(machine: Machine, trajectory: Trajectory) -> dict[str, Array]:
    """Return the recorded channels without noise, in the units of the file."""
    ratio = machine.drives[0].i
    return {
        "t": trajectory.t,
        "theta_ref": trajectory["theta_ref"],
        "omega_ref": trajectory["omega_ref"],
        "theta_m": trajectory["theta_m"] / ARCSEC,
        "theta_1": trajectory["theta_c1"] * ratio,
        "theta_2": trajectory["theta_c2"] * ratio,
        "I_1": trajectory["I_1"],
        "I_2": trajectory["I_2"],
    }


def coloured(size: int, rms: float, corner: float, random: np.random.Generator) -> Array:
    """Return first-order low-pass noise of this rms and corner frequency in Hz."""
    memory = np.exp(-2 * np.pi * corner * SAMPLE)
    white = random.standard_normal(size + 100) * rms * np.sqrt(1 - memory**2)
    return np.asarray(lfilter([1.0], [1.0, -memory], white)[100:], dtype=np.float64)


def measured(clean: dict[str, Array], noise: dict[str, Any], seed: int) -> dict[str, Array]:
    """Return the channels with coloured noise, rounded to the step of their sensor."""
    random = np.random.default_rng(seed)
    seen = dict(clean)
    for name, signal in clean.items():
        if name in noise:
            rms, step = noise[name]["rms"], noise[name]["step"]
            disturbed = signal + coloured(len(signal), rms, noise["corner"], random)
            seen[name] = step * np.round(disturbed / step)
    return seen


def main(folder: Path) -> None:
    """Write both records."""
    machine, noise = recorded_machine(), truth()["noise"]
    folder.mkdir(parents=True, exist_ok=True)
    for seed, record in enumerate(RECORDS, start=20):
        trajectory = run(machine, record)
        channels = measured(signals(machine, trajectory), noise, seed)
        file = folder / f"{record}.csv"
        np.savetxt(
            file,
            np.column_stack(list(channels.values())),
            fmt=list(COLUMNS.values()),
            delimiter=",",
            header=",".join(COLUMNS),
            comments="",
        )
        contacts = len(trajectory.contacts)
        print(f"{file}: {file.stat().st_size / 1e3:.0f} kB, {contacts} contacts made or lost")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)

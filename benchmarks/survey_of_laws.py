"""Which law `diagnose` names where one law of the library, or none, is hidden in the bench.

    python benchmarks/survey_of_laws.py                        every law
    python benchmarks/survey_of_laws.py cogging stribeck --jobs 2
    python benchmarks/survey_of_laws.py coulomb_table+ripple   two laws at once
    python benchmarks/survey_of_laws.py --draw 3               other sizes and numbers
    python benchmarks/survey_of_laws.py --noise 1              sensors of another size and colour
    python benchmarks/survey_of_laws.py stribeck --creep 1e-3  friction that sets in over a speed

The motions are those of the independent bench (`DUALDRIVE_DATA`), its sensors' coloured noise and
rounding as well unless drawn; the machine behind them is this program's own. So the survey shows
what a search misses, and nothing of what the physics lacks.
"""

from __future__ import annotations

import argparse
import math
import re
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
from numpy.typing import NDArray

import dualdrive as dd
from dualdrive._core import effect_type, recorder_delay
from dualdrive.diagnose import diagnose
from dualdrive.recorder import reading_times, written
from dualdrive.replay import ratio_to_table
from dualdrive.traces import Trace
from dualdrive.traces import read as read_trace
from independent_bench import DATA, SLACK, told
from report import table

Array = NDArray[np.float64]

#: name -> effect, place, numbers at a size that is usual here
LAWS: dict[str, tuple[str, str, dict[str, float]]] = {
    "coulomb_motors": ("coulomb", "motors", {"torque": 0.02}),
    "coulomb_pinions": ("coulomb", "pinions", {"torque": 0.15}),
    "coulomb_table": ("coulomb", "table", {"torque": 0.7}),
    "stribeck": ("stribeck", "table", {"torque": 0.7, "static_ratio": 1.5, "speed": 0.05}),
    "lugre": (
        "lugre",
        "table",
        {"torque": 0.7, "static_ratio": 1.4, "speed": 0.02, "stiffness": 2000.0, "damping": 2.0},
    ),
    "angle_friction": (
        "angle_dependent_friction",
        "table",
        {"torque": 0.6, "order": 1, "phase": 0.7},
    ),
    "mesh_loss": ("load_dependent_mesh_loss", "pinions", {"fraction": 0.05}),
    "mesh_damping": ("mesh_damping", "meshes", {"coefficient": 0.5}),
    "eccentricity": ("eccentricity", "table", {"amplitude": 1e-3, "phase": 0.5, "spacing": np.pi}),
    "transmission_error": (
        "transmission_error",
        "pinions",
        {"amplitude": 3e-4, "teeth": 20, "phase": 0.3},
    ),
    "pitch_error": (
        "pitch_error",
        "table",
        {"amplitude": 5e-4, "order": 3, "phase": 0.3, "spacing": np.pi},
    ),
    "mesh_stiffness": (
        "time_varying_mesh_stiffness",
        "pinions",
        {"amplitude": 0.2, "teeth": 20, "phase": 0.3},
    ),
    "hertz": ("hertzian_stiffness", "meshes", {"growth": 0.6, "overlap": 2e-3}),
    "wear": ("wear", "table", {"depth": 2e-3, "centre": 0.05, "width": 0.3}),
    "cogging": ("cogging", "motors", {"amplitude": 0.02, "order": 24, "phase": 0.3}),
    "ripple": ("torque_ripple", "motor_1", {"amplitude": 0.06, "order": 6, "phase": 0.3}),
    "unbalance": ("unbalance", "table", {"amplitude": 0.5, "phase": 0.4}),
    "drag": ("hydrostatic_drag", "table", {"quadratic": 0.8}),
    "inertia": (
        "position_dependent_inertia",
        "table",
        {"amplitude": 0.15, "order": 1, "phase": 0.3},
    ),
    "delay_motors": ("sensor_delay", "motors", {"time": 2e-3}),
    "encoder": ("encoder_eccentricity", "table", {"amplitude": 4e-4, "phase": 0.3}),
    "radial_shift": ("radial_shift", "table", {"compliance": 2e-6}),
    "tilt": ("table_tilt", "table", {"compliance": 2e-6}),
    "saturation": ("torque_constant_saturation", "motors", {"loss": 0.1}),
    "thermal": ("thermal_drift", "motors", {"rise": 40.0, "flux_loss": 0.002}),
    "dead_time": ("dead_time", "motors", {"voltage": 1.0, "current": 0.05}),
    "mismatch": ("tension_mismatch", "motor_2", {"error": 0.15}),
    "current_limit": ("current_limit", "motors", {"T_max": 0.09}),
    "voltage_limit": ("voltage_limit", "motors", {"U_max": 10.6}),
    "transport_delay": ("transport_delay", "controller", {"delta_c": 2e-3}),
    "play": ("gearbox_backlash", "gearboxes", {"gap": 5e-4, "stiffness": 1e6}),
    "shafts": ("shaft_compliance", "gearboxes", {"stiffness": 600.0}),
    "cut": (
        "cutting_torque",
        "table",
        {"mean": 0.5, "amplitude": 0.2, "frequency": 14.0, "start": 2.0, "duration": 3.0},
    ),
}
#: dry friction -> the same as other programs have it: the sign of the speed as tanh(speed/range)
FORMULAS = {
    "coulomb": "-torque*tanh(speed/range)",
    "stribeck": "-torque*(1 + (static_ratio - 1)*exp(-(speed/speed_0)*(speed/speed_0)))"
    "*tanh(speed/range)",
    "angle_dependent_friction": "-torque*(1 + cos(order*angle + phase))*tanh(speed/range)",
}
NOTHING = "nothing"
#: channel -> one-sigma of its noise, its rounding; the noise remembers MEMORY of itself each ms
NOISE = {
    "theta_m": (2e-6, 1e-6),
    "theta_1": (3e-5, 5e-6),
    "theta_2": (3e-5, 5e-6),
    "I_1": (5e-3, 0.0),
    "I_2": (5e-3, 0.0),
}
MEMORY = 0.9
#: factors of the sizes and roundings, and memories, of which noise is drawn, each channel's own
LOUDER, MEMORIES = (0.3, 4.0), (0.0, 0.97)
UNITS = {"t": "s", "theta_ref": "rad", "omega_ref": "rad/s"}
#: number of the data sheet -> one-sigma of the logarithm of what it is really
OFF = {"table.J": 0.04, "motors.R": 0.03, "table.b": 0.1}
#: numbers of a law that are no sizes: they stand, or turn freely
STANDING, TURNING = ("order", "teeth", "spacing", "start", "duration", "frequency"), "phase"
HEAD = [
    "hidden", "verdict", "named", "sizes", "refitted", "with it", "cross-val.", "floor", "CPU",
]  # fmt: skip


def hidden(
    name: str, draw: int, creep: float = 0.0
) -> tuple[dd.Machine, dict[str, float], np.random.Generator]:
    """A machine whose numbers are a little off, with its laws; path -> number of these.

    creep: rad/s of the table, over which its dry friction sets in; 0: at once
    """
    rng = np.random.default_rng([draw, *name.encode()])
    machine = dd.Machine.load(DATA / "nominal.toml")
    for path, sigma in OFF.items():
        machine.set(path, machine.get(path) * float(np.exp(sigma * rng.standard_normal())))
    known: dict[str, float] = {}
    for part in name.split("+") if name != NOTHING else ():
        effect, place, usual = LAWS[part]
        numbers = dict(usual)
        for key in numbers if draw else ():  # the first draw has the usual sizes
            if key == TURNING:
                numbers[key] = float(rng.uniform(-np.pi, np.pi))
            elif key not in STANDING:
                numbers[key] *= float(np.exp(rng.uniform(-0.35, 0.35)))
        label = machine.add(effect, place, **numbers)
        if creep and effect in FORMULAS:
            _creeping(machine, label, creep)
        known |= {f"{effect}@{place}.{key}": x for key, x in numbers.items()}
    return machine, known, rng


def _creeping(machine: dd.Machine, label: str, over: float) -> None:
    """A dry friction of the library by its formula, at every member of its place.

    over: rad/s of the table
    """
    [law] = (e for e in machine.core.effects if e["label"] == label)
    formula = FORMULAS[law["effect"]]
    units = {p.path: p.unit for p in effect_type(law["effect"]).parameters}
    numbers = {key: {"value": machine.get(f"{label}.{key}"), "unit": units[key]} for key in units}
    if "speed" in numbers:  # a formula knows the body's own by that name
        numbers["speed_0"] = numbers.pop("speed")
    machine.remove(label)
    for body in law["members"]:
        own = over * abs(ratio_to_table(machine.core, body))
        used = {**numbers, "range": {"value": own, "unit": "rad/s"}}
        named = {key: x for key, x in used.items() if re.search(rf"\b{key}\b", formula)}
        machine.add("expression", body, formula=formula, parameters=named)


#: channel -> one-sigma, rounding, memory over 1 ms
Sensors = dict[str, tuple[float, float, float]]


def sensors(draw: int) -> Sensors:
    """The bench's, or others: those of the motors alike, as are those of the currents."""
    rng, found = np.random.default_rng([draw, 1]), Sensors()
    for channel, (sigma, step) in NOISE.items():
        if channel.endswith("_2"):
            found[channel] = found[channel[:-1] + "1"]
        elif draw:
            louder, coarser = np.exp(rng.uniform(math.log(LOUDER[0]), math.log(LOUDER[1]), 2))
            memory = float(rng.uniform(*MEMORIES))
            found[channel] = (sigma * float(louder), step * float(coarser), memory)
        else:
            found[channel] = (sigma, step, MEMORY)
    return found


def records(
    machine: dd.Machine,
    rng: np.random.Generator,
    which: Sequence[str] = (),
    noise: Sensors | None = None,
) -> dict[str, Trace]:
    """What its sensors say on the bench's motions, or on some of them."""
    found = {}
    for path in sorted((DATA / "coulomb_table").glob("*.csv")):
        if which and path.stem not in which:
            continue
        measured = read_trace(path)
        own = machine.copy()
        for key, value in SLACK.get(path.stem, {}).items():
            own.set(key, value)
        motion = dd.motion.sampled(measured.t, measured["theta_ref"])
        late = {f"theta_{n}": recorder_delay(own.core, f"motor_{n}")[0] for n in (1, 2)}
        times = reading_times(measured.t, late, float(measured.t[0]))
        signals = {**{c: c for c in ("theta_ref", "omega_ref", *NOISE)}, "theta_m": "sensed.table"}
        run = dd.simulate(own, motion, times=times, signals=[*signals.values()], energy=False)
        now = np.searchsorted(times, measured.t)
        columns = {c: np.array(run[c])[now] for c in ("theta_ref", "omega_ref")}
        for channel, (sigma, step, memory) in (noise or sensors(0)).items():
            then = np.maximum(measured.t - late.get(channel, 0.0), measured.t[0])
            y = np.array(run[signals[channel]])[np.searchsorted(times, then)]
            if channel in late:  # a record shows what the loop's own encoder says
                place = channel.replace("theta", "motor")
                y, _ = written(own.core, [place], measured.t, y, np.zeros((len(y), 0)), [])
            y = y + coloured(rng, len(measured.t), sigma, memory)
            columns[channel] = np.round(y / step) * step if step else y
        found[path.stem] = Trace(measured.t, columns)
    return found


def coloured(rng: np.random.Generator, n: int, sigma: float, memory: float) -> Array:
    """An autoregression of order one with this standard deviation, shape (n,)."""
    driven = rng.standard_normal(n) * sigma * np.sqrt(1.0 - memory**2)
    x = np.empty(n)
    last = sigma * rng.standard_normal()
    for k, drive in enumerate(driven):
        x[k] = last = memory * last + drive
    return x


def row(name: str, draw: int, noise: int, creep: float, budget: float, effort: str) -> list[str]:
    """One law hidden and sought."""
    machine, numbers, rng = hidden(name, draw, creep)
    traces = records(machine, rng, noise=sensors(noise))
    cpu = time.process_time()
    found = diagnose(
        dd.Machine.load(DATA / "nominal.toml"),
        traces,
        settings=SLACK,
        effort=effort,
        budget=budget,
        experiment=False,
        threads=1,
    )
    took = f"{time.process_time() - cpu:.0f} s"
    named, errors = told(found)
    known = found.candidates[0].parameters if named else {}
    sizes = []
    for key, p in known.items():
        true = numbers.get(key)
        sizes.append(f"{p.value:.3g}" + (f" ({true:.3g})" if true is not None else ""))
    return [
        name, found.verdict, named, ", ".join(sizes), *errors, took,
    ]  # fmt: skip


def _laws(name: str) -> str:
    if name != NOTHING and (stray := set(name.split("+")) - set(LAWS)):
        raise argparse.ArgumentTypeError(
            f"no law {', '.join(sorted(stray))}; there are {NOTHING}, {', '.join(LAWS)}"
        )
    return name


def main() -> None:
    """Print the table, a row as it comes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("law", nargs="*", type=_laws, help="all unless given; `a+b`: both at once")
    parser.add_argument("--draw", type=int, default=0, help="of sizes and numbers")
    parser.add_argument(
        "--noise", type=int, default=0, help="draw of the sensors' noise; 0: the bench's"
    )
    parser.add_argument(
        "--creep",
        type=float,
        default=0.0,
        help="rad/s of the table over which its dry friction sets in, as other programs have it",
    )
    parser.add_argument(
        "--budget",
        type=float,
        default=math.inf,
        help="seconds of a diagnosis, then it is unfinished",
    )
    parser.add_argument("--effort", default="normal", choices=["quick", "normal", "thorough"])
    parser.add_argument("--jobs", type=int, default=1, help="diagnoses side by side")
    asked = parser.parse_args()
    if not DATA.exists():
        parser.exit(1, f"no records in {DATA}; DUALDRIVE_DATA names the folder of measured data\n")
    one = partial(
        row, draw=asked.draw, noise=asked.noise, creep=asked.creep, budget=asked.budget,
        effort=asked.effort,
    )  # fmt: skip
    rows = []
    with ProcessPoolExecutor(asked.jobs) as pool:
        for own in pool.map(one, asked.law or [NOTHING, *LAWS]):
            rows.append(own)
            print("; ".join(own), flush=True)
    print(table(HEAD, rows))


if __name__ == "__main__":
    main()

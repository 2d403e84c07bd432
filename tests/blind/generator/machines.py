"""Machines drawn wide: one to four drives, ratios of inertia and stiffness over three decades.

A machine is its numbers by the keys of machine files. Beside those, `drives`, and the effects that
its sheet states: `mesh_damping`, `dry_table`, `dry_pinions`; `equaliser`: who is corrected.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

Numbers = dict[str, float]
Rng = np.random.Generator
PARTS = ("motors", "gearboxes", "pinions", "meshes", "table", "controller")

#: numbers of a data sheet that carry a tolerance, and its usual size (one sigma)
UNCERTAIN = {
    "table.J": 0.1,
    "motors.J": 0.1,
    "pinions.J": 0.1,
    "table.b": 0.5,
    "motors.b": 0.5,
    "pinions.b": 0.5,
    "meshes.stiffness": 0.2,
    "meshes.gap": 0.2,
    "gearboxes.stiffness": 0.2,
    "mesh_damping": 0.5,
    "dry_table": 0.5,
    "dry_pinions": 0.5,
}
#: limits that a sheet may leave out where they are never reached
OPTIONAL = ("motors.U_max", "motors.omega_max", "controller.Omega_E")
_EFFECTS = (
    ("mesh_damping", "mesh_damping", "meshes", "coefficient"),
    ("dry_table", "coulomb", "table", "torque"),
    ("dry_pinions", "coulomb", "pinions", "torque"),
)
_EQUALISERS = ("both", "slave", "master")


def logarithmic(rng: Rng, low: float, high: float) -> float:
    """Between the two, each decade as likely."""
    return float(low * (high / low) ** rng.random())


def draw(rng: Rng) -> Numbers:
    """A machine: motors of a size, a table of any weight behind them, loops tuned to match."""
    numbers = _train(rng)
    numbers |= _controller(numbers, rng)
    return {path: float(f"{value:.4g}") for path, value in numbers.items()}


def _train(rng: Rng) -> Numbers:
    """Motors, gears and table."""
    drives = int(rng.choice([1, 2, 3, 4], p=[0.12, 0.64, 0.12, 0.12]))
    rated, speed = logarithmic(rng, 0.3, 150), logarithmic(rng, 100, 600)
    i, i_m = logarithmic(rng, 2, 150), logarithmic(rng, 2.5, 25)
    whole = rated * logarithmic(rng, 0.01, 0.3) / speed  # rated torque alone takes it to its speed
    share = logarithmic(rng, 0.02, 0.6)
    drive = i**2 * whole
    table = drives * drive * i_m**2 * logarithmic(rng, 0.05, 50)
    natural = 2 * np.pi * logarithmic(rng, 5, 120)
    stiffness = natural**2 / (1 / drive + drives * i_m**2 / table)
    K_d = logarithmic(rng, 0.2, 1.5)
    R = rng.uniform(0.03, 0.12) * K_d**2 * speed / rated
    drag = rng.uniform(0.005, 0.05, size=3)
    numbers = {
        "drives": float(drives),
        "motors.J": (1 - share) * whole,
        "motors.b": drag[0] * rated / speed,
        "motors.K_d": K_d,
        "motors.C_e": K_d,
        "motors.R": R,
        "motors.L": R * logarithmic(rng, 1e-3, 15e-3),
        "motors.U_max": rng.uniform(1.4, 2.2) * K_d * speed,
        "motors.T_rated": rated,
        "motors.T_max": rated * rng.uniform(1.8, 3.5),
        "motors.omega_max": speed,
        "gearboxes.ratio": i,
        "pinions.J": share * drive,
        "pinions.b": drag[1] * rated * i**2 / speed,
        "meshes.ratio": i_m,
        "meshes.stiffness": stiffness,
        "meshes.gap": rated * i / stiffness * logarithmic(rng, 0.05, 5),
        "table.J": table,
        "table.b": drag[2] * drives * rated * (i * i_m) ** 2 / speed,
    }
    if rng.random() < 0.7:
        numbers["mesh_damping"] = 2 * logarithmic(rng, 0.01, 0.15) * stiffness / natural
    if rng.random() < 0.15:
        numbers["gearboxes.stiffness"] = stiffness * logarithmic(rng, 0.5, 5)
    if rng.random() < 0.4:
        numbers["dry_table"] = drives * rated * i * i_m * logarithmic(rng, 0.005, 0.05)
        numbers["dry_pinions"] = rated * i * logarithmic(rng, 0.005, 0.05)
    return numbers


def natural(numbers: Mapping[str, float]) -> float:
    """Frequency at which drives and table swing against each other, rad/s."""
    drives, i_m = numbers["drives"], numbers["meshes.ratio"]
    stiffness = numbers["meshes.stiffness"]
    if "gearboxes.stiffness" in numbers:
        stiffness = 1 / (1 / stiffness + 1 / numbers["gearboxes.stiffness"])
    inverse = 1 / drive_inertia(numbers) + drives * i_m**2 / numbers["table.J"]
    return float(np.sqrt(stiffness * inverse))


def _controller(numbers: Numbers, rng: Rng) -> Numbers:
    """Loops that follow from one bandwidth, slow or fast against the machine's own frequency."""
    i, speed, rated = (
        numbers[f"{k}"] for k in ("gearboxes.ratio", "motors.omega_max", "motors.T_rated")
    )
    drives, i_m, drive = numbers["drives"], numbers["meshes.ratio"], drive_inertia(numbers)
    whole = drive + numbers["table.J"] / (drives * i_m**2)
    bandwidth = natural(numbers) * logarithmic(rng, 0.08, 0.8)
    k_p = bandwidth * float(np.sqrt(whole * drive))
    slow = min(bandwidth, k_p / whole)
    K_v = float(np.clip(slow * logarithmic(rng, 0.1, 0.4), 0.5, 60))
    own = {
        "K_v": K_v,
        "f_v": float(rng.choice([0.0, 1.0, rng.uniform(0.5, 0.95)], p=[0.25, 0.6, 0.15])),
        "k_p": k_p,
        "omega_ci": float(np.clip(6 * k_p / drive * rng.uniform(1, 2), 300, 6000)),
        "T_N": rng.uniform(3, 10) / slow if rng.random() < 0.75 else 0.0,
    }
    if rng.random() < 0.15:
        own["K_i"] = K_v**2 * rng.uniform(0.03, 0.15)
    if rng.random() < 0.1:
        own |= {"K_d": rng.uniform(0.05, 0.2), "tau_d": 0.2 / slow}
    if drives > 1:
        own |= {
            "g_E": rng.uniform(0.2, 0.8),
            "T_E": rng.uniform(3, 15) / slow,
            "tau_t": rng.uniform(1, 10) / slow,
            "Omega_E": rng.uniform(0.1, 0.5) * speed / i,
            "T_ten": 0.0 if rng.random() < 0.2 else rated * rng.uniform(0.1, 0.5),
        }
        if rng.random() < 0.25:
            numbers["equaliser"] = float(rng.integers(1, 3))
    if rng.random() < 0.45:
        own |= _clocks(slow, k_p / drive, drives, rng)
    return {f"controller.{key}": float(value) for key, value in own.items()}


def _clocks(slow: float, fast: float, drives: float, rng: Rng) -> Numbers:
    """A sampled drive, as real ones are; as slow as its loops bear, or faster."""
    ticks = np.array([1.25e-4, 2.5e-4, 5e-4, 1e-3, 2e-3, 4e-3])
    made = {
        "speed_sample": float(rng.choice(ticks[ticks <= max(0.25 / fast, 1.3e-4)])),
        "position_sample": float(rng.choice(ticks[ticks <= max(0.25 / slow, 1.3e-4)])),
    }
    made["position_sample"] = max(made.values())
    if drives > 1 and rng.random() < 0.5:
        made["tension_sample"] = made["position_sample"]
    return made


def drift(numbers: Numbers, spread: float, rng: Rng) -> Numbers:
    """The same sheet, each uncertain number off by so much (one sigma), friction by twice that."""
    made = dict(numbers)
    for path in UNCERTAIN:
        size = spread * (2 if UNCERTAIN[path] == 0.5 else 1)
        off = float(np.exp(np.clip(rng.normal(), -2, 2) * size))
        if path in made:
            made[path] = float(f"{made[path] * off:.5g}")
    return made


def drive_inertia(numbers: Mapping[str, float]) -> float:
    """Motor and pinion in the pinion's frame."""
    return numbers["gearboxes.ratio"] ** 2 * numbers["motors.J"] + numbers["pinions.J"]


_WORDS = {
    "drives": "drives",
    "gearboxes.ratio": "i",
    "gearboxes.stiffness": "shaft_k",
    "meshes.ratio": "i_m",
    "table.J": "J_m",
    "table.b": "b_m",
    "motors.J": "J_d",
    "pinions.J": "J_c",
    "motors.b": "b_d",
    "pinions.b": "b_c",
    "meshes.stiffness": "K_t",
    "meshes.gap": "gap",
    "mesh_damping": "c_t",
    "dry_table": "t_dry",
    "dry_pinions": "p_dry",
    "controller.K_d": "K_d_position",
    **{f"motors.{key}": key for key in ("K_d", "C_e", "R", "L", "T_max", "T_rated", "U_max")},
}


def engine_numbers(machine: Mapping[str, float]) -> Numbers:
    """The same machine in the words of ``cpp/parameters.hpp``."""
    i, k_p = machine["gearboxes.ratio"], machine["controller.k_p"]
    numbers = {
        path.removeprefix("controller."): value
        for path, value in machine.items()
        if path.startswith("controller.") and path not in ("controller.g_E", "controller.K_d")
    }
    numbers |= {word: machine[path] for path, word in _WORDS.items() if path in machine}
    numbers["Omega_max"] = machine["motors.omega_max"] / i
    numbers["K_E"] = machine.get("controller.g_E", 0.5) * i / (2 * k_p)
    who = _EQUALISERS[int(machine.get("equaliser", 0))]
    numbers |= {"to_master": float(who != "slave"), "to_slaves": float(who != "master")}
    numbers["chain"] = float("gearboxes.stiffness" in machine)
    return numbers


def fastest(numbers: Mapping[str, float]) -> float:
    """Fastest rate of the machine in the engine's words, rad/s or 1/s: what a step must follow."""
    i = numbers["i"]
    motor = i**2 * numbers["J_d"]
    chain = numbers.get("chain", 0) > 0
    body = numbers["J_c"] if chain else motor + numbers["J_c"]
    stiffness = numbers["K_t"] * (1 + numbers.get("hertz", 0) * 2 + numbers.get("breathing", 0))
    shaft = numbers.get("shaft_k", 0) if chain else 0
    rates = [
        float(np.sqrt(stiffness * numbers["i_m"] ** 2 * numbers["drives"] / numbers["J_m"])),
        float(np.sqrt((stiffness + shaft) / body)),
        numbers.get("c_t", 0) / body,
        numbers["omega_ci"] + numbers["R"] / numbers["L"],
        numbers["k_p"] / (motor if chain else body),
        float(np.sqrt(shaft / motor)),
        numbers["omega_ci"]
        + numbers.get("dead", 0) / numbers.get("dead_current", 1) / numbers["L"],
    ]
    return max(rates)


def text(
    numbers: Mapping[str, float], name: str, controller: bool = True, without: Iterable[str] = ()
) -> str:
    """The machine file handed out, without the controller where it is not known."""
    drives, left_out = int(numbers.get("drives", 2)), set(without)
    lines = ["schema = 1", f'name = "{name}"', 'axis = "rotary"', 'drive_train = "dual_servo"']
    lines += [f"drives = {drives}"] if drives != 2 else []
    kinds = {"motors": "armature", "meshes": "gap", "controller": "master_slave"}
    kinds["gearboxes"] = "compliant" if "gearboxes.stiffness" in numbers else "rigid"
    for part in PARTS[: len(PARTS) if controller else -1]:
        lines += ["", f"[{part}]"]
        lines += [f'kind = "{kinds[part]}"'] if part in kinds else []
        lines += [
            f"{path.split('.')[1]} = {value!r}"
            for path, value in numbers.items()
            if path.startswith(part + ".") and path not in left_out
        ]
        if part == "controller" and numbers.get("equaliser", 0) > 0:
            lines += [f'equaliser = "{_EQUALISERS[int(numbers["equaliser"])]}"']
    for key, effect, place, parameter in _EFFECTS:
        if key in numbers:
            lines += ["", "[[effects]]", f'effect = "{effect}"', f'place = "{place}"']
            lines += [f"{parameter} = {numbers[key]!r}"]
    return "\n".join(lines) + "\n"

"""A case: machine, hidden truth, records; what is handed out and what is kept apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from tests.blind.generator import effects, evidence, machines, outside, records, rivals, sensors
from tests.blind.generator import friction as _friction  # noqa: F401  (enters its effects)
from tests.blind.generator import gearing as _gearing  # noqa: F401
from tests.blind.generator import motors as _motors  # noqa: F401
from tests.blind.generator import sensing as _sensing  # noqa: F401
from tests.blind.generator.effects import Hidden, UnfitError
from tests.blind.generator.engine import Array, EngineError
from tests.blind.generator.records import Plan
from tests.blind.generator.sensors import Recorder

FORMS = ("csv", "csv in other units", "hdf5")
GROUPS = ("single", "empty", "drifted", "pair", "outside")
#: log-likelihood ratios that are drawn from; what is less visible than the first is not hidden
VISIBLE, STRONGEST = 10.0, 1e5
#: smallest share of a strong amplitude
LEAST = 2e-3
#: effects of a controller that is unknown can not be missed, nor can what only the recorder's
#: command would show
OF_THE_LOOP = ("transport_delay", "tension_mismatch", "current_limit", "voltage_limit", "dead_time")
_STRONG = ("table.J", "motors.J", "meshes.stiffness", "meshes.gap", "table.b")
_ATTEMPTS = 60


@dataclass(frozen=True)
class Case:
    """Everything about one case; `truth` is kept apart."""

    name: str
    machine: str
    plans: tuple[Plan, ...]
    recorded: Mapping[str, Mapping[str, Array]]
    form: str
    truth: dict[str, Any]


@dataclass(frozen=True)
class Wanted:
    """What a case is to be: its group, effects to draw from, whether the loop is known."""

    group: str
    names: tuple[str, ...]
    known: bool = True


def build(name: str, seed: int, wanted: Wanted) -> Case:
    """The case of that seed: the same on any computer and in any order."""
    for attempt in range(_ATTEMPTS):
        try:
            return _draw(name, wanted, np.random.default_rng([seed, attempt]))
        except (UnfitError, EngineError):
            continue
    raise RuntimeError(f"{name} of seed {seed}, {wanted}: {_ATTEMPTS} draws, none fit")


def _draw(name: str, wanted: Wanted, rng: np.random.Generator) -> Case:
    machine = machines.draw(rng)
    plans = records.plans(machine, rng)
    recorder = sensors.draw(machine, plans[0].sample, rng)
    made = [plan.truth(machine, coarse=True) for plan in plans]
    for plan, one in zip(plans, made, strict=True):
        check(plan, one, machine)
    setting = records.setting(machine, plans, made)
    hiding = Hiding(wanted, setting, rng)
    real = {path: value for path, value in machine.items() if path not in hiding.without}
    channels = _channels(real, wanted.known, rng)
    if hiding.count:
        quiet = [p for p, one in zip(plans, made, strict=True) if not hunts(one)]
        hiding.size(evidence.Bench(real, quiet, recorder, channels))
    truth = {plan.name: plan.truth(real, hiding.effects) for plan in plans}
    for plan in plans:
        check(plan, truth[plan.name], machine)
    sheet = _sheet(real, wanted.group, rng)
    recorded = {p.name: recorder.read(truth[p.name], channels, p.sample, rng) for p in plans}
    stated = wanted.known or rng.random() < 0.5
    text = machines.text(
        sheet, name, controller=stated, without=_left_out(truth, real, hiding, rng)
    )
    form = str(rng.choice(FORMS, p=[0.65, 0.2, 0.15]))
    label = {
        "case": name,
        "group": wanted.group,
        "loop": "known" if wanted.known else "unknown",
        "effects": [_effect(one) for one in hiding.effects],
        **hiding.figures,
        "real": {p: v for p, v in real.items() if p in machines.UNCERTAIN},
        "sheet": {p: v for p, v in sheet.items() if p in machines.UNCERTAIN},
        "machine": dict(real),
        "traits": traits(real, plans, recorder),
        "records": {p.name: _record(p, truth[p.name]) for p in plans},
        "noise": noise(recorder, channels),
        "floor": floor(sheet, truth, recorded),
    }
    return Case(name, text, plans, recorded, form, label)


def _effect(one: Hidden) -> dict[str, Any]:
    keys = ("effect", "place", "equation", "parameters")
    entry = effects.EFFECTS.get(one.effect)
    family = entry.draw.__module__.rsplit(".", 1)[-1] if entry else "outside"
    return {key: getattr(one, key) for key in keys} | {"family": family, "engine": one.numbers}


def _channels(
    machine: Mapping[str, float], known: bool, rng: np.random.Generator
) -> tuple[str, ...]:
    """Command, angles and currents; of an unknown loop angles, and currents or torques."""
    drives = range(1, int(machine["drives"]) + 1)
    angles = ("theta_m", *(f"theta_{n}" for n in drives))
    power = "I" if known or rng.random() < 0.4 else "T"
    drawn = (*angles, *(f"{power}_{n}" for n in drives))
    if not known:
        return drawn
    return (("theta_ref", "omega_ref") if rng.random() < 0.4 else ("theta_ref",)) + drawn


def _sheet(real: Mapping[str, float], group: str, rng: np.random.Generator) -> dict[str, float]:
    """What the user believes: a few per cent off, or much in the cases of drifted numbers."""
    if group != "drifted":
        exact = group == "empty" and rng.random() < 0.3
        return machines.drift(dict(real), 0.0 if exact else float(rng.uniform(0.005, 0.03)), rng)
    sheet = machines.drift(dict(real), float(rng.uniform(0.04, 0.08)), rng)
    if rng.random() < 0.3:
        path = str(rng.choice(_STRONG))
        sheet[path] = float(f"{real.get(path, 0.0) * rng.choice([0.74, 0.8, 1.25, 1.35]):.5g}")
    return sheet


def _left_out(
    truth: Mapping[str, Mapping[str, Array]],
    machine: Mapping[str, float],
    hiding: Hiding,
    rng: np.random.Generator,
) -> set[str]:
    """Limits that this file does not state. One that the machine meets is stated."""
    gone = {path for path in machines.OPTIONAL[:2] if rng.random() < 0.35}
    if any(one.effect == "voltage_limit" for one in hiding.effects) and rng.random() < 0.5:
        gone.add("motors.U_max")
    i, i_m = machine["gearboxes.ratio"], machine["meshes.ratio"]
    for one in truth.values():
        asked = machine["controller.K_v"] * np.abs(one["theta_ref"] - one["theta_m"])
        asked = asked + machine["controller.f_v"] * np.abs(one["omega_ref"])
        if i * i_m * float(asked.max()) > 0.9 * machine["motors.omega_max"]:
            gone.discard("motors.omega_max")
    return gone


class Hiding:
    """What a case hides, and how much of it."""

    def __init__(self, wanted: Wanted, s: effects.Setting, rng: np.random.Generator) -> None:
        self.count = {"single": 1, "outside": 1, "pair": 2}.get(wanted.group, 0)
        outer = wanted.group == "outside"
        self._draw = outside.draw if outer else effects.draw
        self._setting = s
        pool = [n for n in wanted.names if wanted.known or n not in OF_THE_LOOP]
        self._names = [str(n) for n in rng.choice(pool, size=self.count, replace=False)]
        self._seeds = [int(rng.integers(2**31)) for _ in range(self.count)]
        low, high = np.log10(2 * VISIBLE), np.log10(STRONGEST)
        self._aims = [float(10 ** rng.uniform(low, high)) for _ in range(self.count)]
        self.effects = self._at([1.0] * self.count)
        words = [key for one in self.effects for key in one.numbers if key[0] != "+"]
        if len(set(words)) < len(words):
            raise UnfitError("two effects that are one number")
        if not wanted.known and any(
            one.equation == "sensors" and not one.recorder for one in self.effects
        ):
            raise UnfitError("a late sensor in a loop that nobody knows")
        self.without = {path for one in self.effects for path in one.without}
        self.figures: dict[str, Any] = {}

    def _at(self, shares: list[float]) -> tuple[Hidden, ...]:
        return tuple(
            self._draw(name, self._setting, seed, share)
            for name, seed, share in zip(self._names, self._seeds, shares, strict=True)
        )

    def size(self, bench: evidence.Bench) -> None:
        """Give each effect a visibility of its own, from barely to strong, and say what it is.

        Counted on the records that do not hunt: where flanks come and go by themselves, the last
        bit decides what comes after, and distances between courses say nothing.
        """
        if not bench.plans:
            raise UnfitError("hunts in every record")
        nominals = evidence.Nominals(bench)
        shares = [self._share(k, nominals) for k in range(self.count)]
        self.effects = self._at(shares)
        each = [nominals.best_ratio(bench.record((one,))) for one in self.effects]
        if min(each) < VISIBLE:
            raise UnfitError("can not be seen")
        self.figures = {
            "detectability": each[0]
            if self.count == 1
            else nominals.best_ratio(bench.record(self.effects)),
            "detectability_of_each": each,
            "shares": shares,
        }
        if self.count == 1 and self._draw is effects.draw:
            change = nominals.change(self.effects)
            apart, rival = rivals.nearest(self.effects[0], self._setting, nominals, change)
            self.figures |= {"told": min(apart, each[0]), "rival": rival}

    def _share(self, k: int, nominals: evidence.Nominals) -> float:
        """Share of the strong amplitude, rounded, at which the ratio is near the one aimed at."""
        share, aim = 0.1, self._aims[k]
        for _ in range(5):
            one = self._at([share] * self.count)[k]
            size = nominals.ratio(nominals.change((one,)))
            if aim / 2 < size < 2 * aim:
                break
            step = float(np.sqrt(aim / max(size, 1e-3)))
            wanted = float(np.clip(share * np.clip(step, 0.01, 10), LEAST, 1.0))
            if wanted == share:
                if size < VISIBLE:
                    raise UnfitError("can not be seen")
                break
            share = float(f"{wanted:.3g}")
        return share


def check(plan: Plan, made: Mapping[str, Array], machine: Mapping[str, float]) -> None:
    """A machine that runs away or lives at its limits is no record anybody would keep."""
    if np.ptp(made["theta_ref"]) == 0 or np.ptp(made["theta_m"]) == 0:
        raise UnfitError("stands still")
    error = made["theta_ref"] - made["theta_m"]
    twist = machine["motors.T_rated"] * machine["gearboxes.ratio"] / machine["meshes.stiffness"]
    play = (machine["meshes.gap"] + twist) / machine["meshes.ratio"]
    if np.ptp(error) > 1.2 * np.ptp(made["theta_ref"]) + 6 * play:
        raise UnfitError("does not follow")
    for n in range(1, int(machine["drives"]) + 1):
        if np.mean(np.abs(made[f"T_{n}"]) > 0.97 * machine["motors.T_max"]) > 0.05:
            raise UnfitError("at its torque limit")


def _record(plan: Plan, made: Mapping[str, Array]) -> dict[str, Any]:
    """What kind of record it is."""
    flanks = [made[name] for name in made if name.startswith("flank")]
    changes = sum(int(np.count_nonzero(np.diff(flank))) for flank in flanks)
    return {
        "motion": plan.motion.kind,
        "seconds": plan.motion.end,
        "sample": plan.sample,
        "T_ten": plan.T_ten,
        "lead": plan.lead,
        "flank_changes": changes,
        "hunts": hunts(made),
    }


def hunts(made: Mapping[str, Array]) -> bool:
    """Whether flanks go on changing while the command stands or creeps."""
    speed = np.abs(made["omega_ref"])
    still = speed < 1e-3 * max(float(speed.max()), 1e-12)
    flank = made["flank_1"]
    changes = np.count_nonzero(np.diff(flank) * still[1:])
    return bool(still.mean() > 0.05 and changes > 10)


def traits(
    machine: Mapping[str, float], plans: tuple[Plan, ...], recorder: Recorder
) -> dict[str, Any]:
    """By what the tables of a score are split."""
    i_m, drives = machine["meshes.ratio"], machine["drives"]
    return {
        "drives": int(drives),
        "inertia_ratio": machine["table.J"] / (drives * i_m**2 * machines.drive_inertia(machine)),
        "natural_frequency": machines.natural(machine) / (2 * np.pi),
        "sampled": "controller.speed_sample" in machine,
        "tension": machine.get("controller.T_ten", 0.0) > 0,
        "compliant_gearbox": "gearboxes.stiffness" in machine,
        "rate": round(1 / plans[0].sample),
        "records": len(plans),
        "colour": recorder.sensors["theta_m"].colour,
        "drifting_zero": recorder.sensors["theta_m"].drift > 0,
        "jitter": recorder.jitter,
    }


def noise(recorder: Recorder, channels: tuple[str, ...]) -> dict[str, Any]:
    """Every sensor as it was drawn."""
    sensed = [name for name in channels if name in recorder.sensors]
    return {name: vars(recorder.sensors[name]) for name in sensed} | {"jitter": recorder.jitter}


def floor(
    sheet: Mapping[str, float],
    truth: Mapping[str, Mapping[str, Array]],
    recorded: Mapping[str, Mapping[str, Array]],
) -> float:
    """Headline error of the noise-free truth held against what was recorded."""
    parts: dict[str, list[tuple[float, float]]] = {}
    for name, read in recorded.items():
        measured = headline(sheet, read)
        true = headline(sheet, {key: truth[name][key] for key in read})
        for key, values in measured.items():
            off = values - true[key]
            off = off if key == "e" else off - off.mean()
            size = float(values.size * np.var(values))
            parts.setdefault(key, []).append((float(np.sum(off**2)), size))
    size_of = {
        k: np.sqrt(sum(a for a, _ in v) / max(sum(b for _, b in v), 1e-300))
        for k, v in parts.items()
    }
    kinds = {k[0]: [size_of[n] for n in size_of if n[0] == k[0]] for k in size_of}
    return float(np.mean([np.mean(v) for v in kinds.values()]))


def headline(sheet: Mapping[str, float], made: Mapping[str, Array]) -> dict[str, Array]:
    """Following error, currents or torques, deflections at the meshes."""
    shown = {"e": made["theta_ref"] - made["theta_m"]} if "theta_ref" in made else {}
    shown |= {k: made[k] for k in made if k[:2] in ("I_", "T_")}
    i, i_m = sheet["gearboxes.ratio"], sheet["meshes.ratio"]
    for n in range(1, int(sheet["drives"]) + 1):
        shown[f"x_{n}"] = made[f"theta_{n}"] / i - i_m * made["theta_m"]
    return shown

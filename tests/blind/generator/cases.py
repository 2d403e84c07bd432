"""A case: machine, hidden truth, records; what is handed out and what is sealed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tests.blind.generator import distance, effects, machines, outside, records, rivals, told
from tests.blind.generator import friction as _friction  # noqa: F401  (enters its effects)
from tests.blind.generator import gearing as _gearing  # noqa: F401
from tests.blind.generator import motors as _motors  # noqa: F401
from tests.blind.generator import sensing as _sensing  # noqa: F401
from tests.blind.generator.effects import Hidden
from tests.blind.generator.records import BALANCE, LOOP, Plan

Array = NDArray[np.float64]
GROUPS = ("single", "none", "drifted", "outside", "two")
#: squared distances from the best machine without the effect, in units of the noise: what is less
#: visible than this is not there for anybody, and the middle of the strong ones
VISIBLE, STRONGEST = 12.0, 1e6
#: smallest share of a strong amplitude
LEAST = 1e-3
#: effects of a controller that is unknown can not be missed
OF_THE_LOOP = ("transport_delay", "tension_mismatch", "current_limit", "dead_time")
STRONG = ("table.J", "motors.J", "meshes.stiffness", "meshes.gap", "table.b")


class UnfitError(RuntimeError):
    """This draw makes no case: it runs away, or its effect can not be seen."""


@dataclass(frozen=True)
class Case:
    """Everything about one case; `label` is sealed."""

    name: str
    sheet: Mapping[str, float]
    plans: tuple[Plan, ...]
    recorded: Mapping[str, Mapping[str, Array]]
    label: dict[str, Any] = field(repr=False)

    def write(self, folder: Path) -> None:
        """The folder that is handed out: machine.toml, one CSV per record, case.json."""
        folder.mkdir(parents=True)
        (folder / "machine.toml").write_text(machines.text(self.sheet, "table"))
        for plan in self.plans:
            _write_csv(folder / f"{plan.name}.csv", self.recorded[plan.name])
        known = {
            "machine": "machine.toml",
            "records": [f"{plan.name}.csv" for plan in self.plans],
            "settings": {p.name: {"controller.T_ten": p.T_ten} for p in self.plans},
        }
        (folder / "case.json").write_text(json.dumps(known, indent=1) + "\n")


_UNITS = {"t": "s", "theta": "rad", "I": "A", "T": "N*m"}


def _write_csv(path: Path, columns: Mapping[str, Array]) -> None:
    header = ",".join(f"{name} [{_UNITS[name.split('_')[0]]}]" for name in columns)
    table = np.stack(list(columns.values()), axis=1)
    np.savetxt(path, table, fmt="%.12g", delimiter=",", header=header, comments="")


def build(
    seed: int, number: int, group: str, names: tuple[str, ...] = (), share: float | None = None
) -> Case:
    """Case `number` of a suite.

    names: effects to draw from, all of the library unless given
    share: of a strong amplitude, for all that is hidden; else each is sized by its visibility
    """
    for attempt in range(40):
        rng = np.random.default_rng([seed, number, attempt])
        try:
            name, pool = f"case-{number:04d}", names or tuple(effects.EFFECTS)
            return _draw(name, group, pool, rng, share)
        except UnfitError:
            continue
    raise RuntimeError(f"case {number} of group {group}: forty draws, none fit")


def _draw(
    name: str, group: str, names: tuple[str, ...], rng: np.random.Generator, share: float | None
) -> Case:
    family = str(rng.choice(list(machines.FAMILIES), p=(0.3, 0.35, 0.35)))
    sheet = machines.draw(family, rng)
    plans = records.plans(family, sheet, rng)
    recorder = records.recorder(family, sheet["motors.K_d"], rng)
    unknown_loop = rng.random() < 0.2
    hidden = _Hiding(group, names, records.setting(sheet, plans), rng)
    unknown_loop &= not any(one.effect in OF_THE_LOOP for one in hidden.effects)
    channels = BALANCE if unknown_loop else LOOP
    for path in hidden.without:
        sheet.pop(path, None)
    real = _real(sheet, group, rng)
    bench = distance.Bench(real, plans, recorder)
    if hidden.effects:
        hidden.size(bench, share)
    mode = "balance" if channels is BALANCE else "closed_loop"
    hidden.tell(mode)
    truth = {p.name: p.truth(real, hidden.effects) for p in plans}
    for made in truth.values():
        _check(made, sheet)
    recorded = {p.name: recorder.read(p, truth[p.name], channels) for p in plans}
    label = {
        "case": name,
        "group": group,
        "family": family,
        "mode": mode,
        "effects": [_effect(one) for one in hidden.effects],
        "real": {p: v for p, v in real.items() if p in machines.UNCERTAIN},
        "sheet": {p: v for p, v in sheet.items() if p in machines.UNCERTAIN},
        "floor": floor(sheet, truth, recorded),
        "floors": {p.name: floor(sheet, truth, {p.name: recorded[p.name]}) for p in plans},
        "jitter": recorder.jitter,
        "drift": bench.apart(sheet) if group == "drifted" else 0.0,
        **hidden.figures,
    }
    return Case(name, sheet, plans, recorded, label)


def _effect(one: Hidden) -> dict[str, Any]:
    keys = ("effect", "place", "equation", "parameters")
    return {key: getattr(one, key) for key in keys}


def _real(sheet: dict[str, float], group: str, rng: np.random.Generator) -> dict[str, float]:
    """The machine on which the records are made."""
    if group == "none":
        return dict(sheet)
    real = machines.drift(sheet, rng)
    if group == "drifted" and rng.random() < 0.3:
        path = str(rng.choice(STRONG))
        real[path] = sheet[path] * float(rng.choice([1.25, 0.8, 1.35, 0.74]))
    return real


class _Hiding:
    """What a group hides, and how much of it."""

    def __init__(
        self, group: str, names: tuple[str, ...], s: effects.Setting, rng: np.random.Generator
    ):
        count = {"single": 1, "outside": 1, "two": 2}.get(group, 0)
        pool = tuple(outside.OUTSIDE) if group == "outside" else names
        self._draw = outside.draw if group == "outside" else effects.draw
        self._setting = s
        self._seeds = [int(rng.integers(2**31)) for _ in range(count)]
        self._names = [str(n) for n in rng.choice(pool, size=count, replace=False)]
        low, high = np.log10(VISIBLE * 2), np.log10(STRONGEST)
        self._wanted = [float(10 ** rng.uniform(low, high)) for _ in range(count)]
        self.effects = self._at([1.0] * count)
        told = [key for one in self.effects for key in one.numbers if key[0] != "+"]
        if len(set(told)) < len(told):
            raise UnfitError("two effects that are one number")
        self.without = {path for one in self.effects for path in one.without}
        self.figures: dict[str, Any] = {}
        self._told_by: distance.Bench | None = None

    def _at(self, shares: list[float]) -> tuple[Hidden, ...]:
        return tuple(
            self._draw(name, self._setting, seed, share)
            for name, seed, share in zip(self._names, self._seeds, shares, strict=True)
        )

    def size(self, bench: distance.Bench, share: float | None) -> None:
        """Give each effect an amplitude of its own visibility, from barely to strong.

        Seen in the records under tension: where flanks are left, the last bit decides what comes
        after, and distances say little. What shows only there is sized by all records.
        """
        if share is not None:
            self.effects = self._at([share] * len(self.effects))
            return
        try:
            nominals = distance.Nominals(bench.tense())
            found = [self._share(k, nominals) for k in range(len(self.effects))]
        except UnfitError:
            nominals = distance.Nominals(bench)
            found = [self._share(k, nominals) for k in range(len(self.effects))]
        self.effects = self._at([share for share, _ in found])
        if len(self.effects) == 1 and self._draw is effects.draw:
            apart, rival = rivals.nearest(self.effects[0], self._setting, nominals)
            self.figures = {"delta_lambda": min(apart, found[0][1]), "rival": rival}
            self._told_by = nominals.bench
        self.figures |= {
            "lambdas": [size for _, size in found],
            "shares": [share for share, _ in found],
        }

    def tell(self, mode: str) -> None:
        """Label a single effect with what its own kind of record tells, see `told.py`."""
        if self._told_by is not None:
            apart, rival = told.apart(self.effects[0], self._setting, self._told_by, mode)
            self.figures |= {"told": apart, "told_rival": rival}

    def _share(self, k: int, nominals: distance.Nominals) -> tuple[float, float]:
        """(share of the strong amplitude, squared distance there), near the wanted distance."""
        share, size = 1.0, 0.0
        for _ in range(6):
            one = self._at([share] * len(self.effects))[k]
            size = nominals.distance(nominals.bench.record((one,)))
            wanted = self._wanted[k]
            if wanted / 2 < size < 2 * wanted or (share == 1.0 and size < wanted):
                break
            if share == LEAST and size > wanted:
                break
            step = float(np.sqrt(wanted / size)) if size > VISIBLE else 3.0
            share = float(np.clip(share * step, LEAST, 1.0))
        if size < VISIBLE:
            raise UnfitError("can not be seen")
        return share, size


def _check(made: Mapping[str, Array], sheet: Mapping[str, float]) -> None:
    """A machine that runs away or lives at its limits is no record anybody would keep."""
    error = made["theta_ref"] - made["theta_m"]
    if np.ptp(error) > 0.3 * np.ptp(made["theta_ref"]):
        raise UnfitError("does not follow")
    for n in (1, 2):
        if np.mean(np.abs(made[f"T_{n}"]) > 0.98 * sheet["motors.T_max"]) > 0.05:
            raise UnfitError("at its torque limit")


def floor(
    sheet: Mapping[str, float],
    truth: Mapping[str, Mapping[str, Array]],
    recorded: Mapping[str, Mapping[str, Array]],
) -> float:
    """Headline error of the noise-free truth held against what was recorded."""
    parts: dict[str, list[tuple[float, float]]] = {}
    for name, read in recorded.items():
        measured = records.headline(sheet, read)
        true = records.headline(sheet, {key: truth[name][key] for key in read})
        for key, values in measured.items():
            off = values - true[key]
            off = off if key == "e" else off - off.mean()
            parts.setdefault(key, []).append(
                (float(np.sum(off**2)), float(values.size * np.var(values)))
            )
    size = {
        k: float(np.sqrt(sum(a for a, _ in v) / sum(b for _, b in v))) for k, v in parts.items()
    }
    kinds = {k[0]: [size[n] for n in size if n[0] == k[0]] for k in size}
    return float(np.mean([np.mean(v) for v in kinds.values()]))

"""Every effect of the library against the generator's own laws: two hands, one physics."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from dualdrive import Machine
from dualdrive.compare import compare
from dualdrive.traces import Trace

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.blind.generator import cases, effects, machines
from tests.blind.shown import families, motion, records

assert cases.GROUPS  # cases enters all effects
CHANNELS = ("theta_ref", *records.LOOP)


@cache
def bench() -> tuple[dict[str, float], records.Plan, effects.Setting]:
    """A machine's data sheet, one move there and back, and what effects are scaled by."""
    sheet = families.draw("medium", np.random.default_rng(3)) | {"dry_table": 50.0}
    for loop in ("speed", "position"):
        sheet.pop(f"controller.{loop}_sample", None)
    jerks, end = motion.course([(0.2, 0.4, 1.5, 10.0), (-0.2, 0.4, 1.5, 10.0)], [0.6, 0.3, 0.3])
    plan = records.Plan("fast", jerks, round(end / 4e-3) * 4e-3, 2e-3, 0.0, 8.0, 0.4, 0.4)
    return sheet, plan, records.setting(sheet, (plan,))


@pytest.mark.parametrize("name", sorted(effects.EFFECTS))
def test_effect_is_the_same_in_both(name: str, tmp_path: Path) -> None:
    """With its numbers set the product explains what the effect does to a record.

    What is left is the fixed step's and the interpolation's of the recorded command. ``python -m
    tests.blind check`` says the same of machines that are drawn wide, in units of their noise.
    """
    sheet, plan, setting = bench()
    hidden = effects.draw(name, setting, seed=1, share=0.2)
    sheet = {path: value for path, value in sheet.items() if path not in hidden.without}
    made = plan.truth(sheet, (hidden,))
    trace = Trace(made["t"], {channel: made[channel] for channel in CHANNELS})
    (tmp_path / "machine.toml").write_text(machines.text(sheet, "table"))
    machine = Machine.load(str(tmp_path / "machine.toml"))
    machine.set("controller.T_ten", plan.T_ten)
    before = compare(machine, trace, start="rest").error["headline"]
    place = "table" if hidden.place == "ring" else hidden.place
    machine.add(hidden.effect, place, **hidden.parameters)
    after = compare(machine, trace, start="rest").error["headline"]
    assert after < max(1e-4, min(2e-3, 0.15 * before)), (hidden, before, after)

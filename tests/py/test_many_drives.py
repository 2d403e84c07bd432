"""Records of more than two drives: checked and compared as any others."""

from __future__ import annotations

from typing import Any

import numpy as np

from dualdrive import _core
from dualdrive.compare import check_records, compare
from dualdrive.traces import CHANNELS, Trace
from test_linear import three_drives

MOTION = _core.cycle_of_moves([0.0, 0.05, -0.05, 0.0], 0.1, 1.0, 20.0)
STEP, SAMPLES = 2e-3, 2000


def seen(core: Any, names: list[str]) -> Trace:
    t = STEP * np.arange(SAMPLES, dtype=np.float64)
    found = _core.simulate(
        core, {"theta_ref": MOTION}, end=float(t[-1]), times=t.tolist(), signals=names
    )
    column = {name: k for k, name in enumerate(found.names)}
    columns = {name: found.values[:, column[name]] for name in names}
    return Trace(t, {"theta_ref": MOTION.value(t), **columns}, name="record")


def test_a_third_drive_is_checked_and_compared() -> None:
    core = three_drives(0.5)
    signals = {name for name, _, _ in core.signals()}
    names = [n for n in CHANNELS if n in signals and n.startswith(("theta_", "I_", "T_"))]
    names = [n for n in names if n not in ("theta_ref", "theta_c1", "theta_c2", "theta_c3")]
    assert {"theta_3", "T_3"} <= set(names)
    trace = seen(core, names)
    told = check_records(core, {"record": trace}, "closed_loop")
    assert not [w for w in told if w.code == "sign"]
    found = compare(core, {"record": trace})
    errors = {c.name: c.error for c in found.channels}
    assert {"x_3", "I_3"} <= set(errors)
    assert max(errors.values()) < 1e-6


def test_the_columns_of_eight_drives_have_names() -> None:
    for stem, unit in (("theta_", "rad"), ("I_", "A"), ("T_", "N*m"), ("theta_c", "rad")):
        assert CHANNELS[f"{stem}8"].unit == unit

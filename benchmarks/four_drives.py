"""Four motors at one table: simulated, compared, fitted, and a hidden law sought.

    python benchmarks/four_drives.py              -v: what the diagnosis tries, as it goes

The machine is built part by part, as no preset has four drives. Its records hide dry friction of
the table, and inertia 4 % above the data sheet's; noise is that of `landscape`.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np

import case  # noqa: F401  isort: skip  (finds the tests' folder)
from core_machines import drive_train, set_all
from dualdrive import _core
from dualdrive.compare import compare
from dualdrive.diagnose import diagnose
from dualdrive.identify import fit
from dualdrive.traces import Trace
from independent_bench import told
from landscape import coloured

DRIVES = range(1, 5)
STEP, SPAN = 1e-3, 8.0  # s
FRICTION, HEAVIER = 4.0, 1.04  # N*m; of the table's inertia
NUMBERS = {
    "motors": {"J": 1e-4, "b": 1e-4, "K_d": 0.3, "R": 1.0, "L": 5e-3},
    "gearboxes": {"ratio": 10.0},
    "pinions": {"J": 1e-3, "b": 1e-3},
    "meshes": {"ratio": 5.0, "stiffness": 2000.0, "gap": 1e-3},
    "table": {"J": 2.0, "b": 0.2},
    "controller": {
        "omega_ci": 1000.0, "tau_t": 0.05, "K_v": 5.0, "k_p": 0.5, "T_N": 0.1, "g_E": 0.5,
        "T_E": 0.2, "T_ten": 0.1,
    },
}  # fmt: skip
#: first letter of a channel, or the table's -> what drives its noise, SI, and its memory
SENSORS = {"theta_m": (1e-6, 0.9), "t": (1e-5, 0.5), "I": (5e-3, 0.9)}
MOTIONS = {
    "reversals": _core.cycle_of_moves([0.0, 0.05, -0.05, 0.0], 0.1, 1.0, 20.0),
    "slow": _core.cycle_of_moves([0.0, 0.02, -0.02, 0.0], 0.02, 0.5, 10.0),
}


def machine() -> Any:
    """Motors, rigid gearboxes and pinions, slaves beside the first."""
    core = drive_train(len(DRIVES))
    core.set_controller(equaliser="slave", current="cascade")
    for part, own in NUMBERS.items():
        set_all(core, part, own)
    return core


def records(core: Any) -> dict[str, Trace]:
    """What its sensors say."""
    random, t = np.random.default_rng(4), STEP * np.arange(round(SPAN / STEP), dtype=np.float64)
    names = ["theta_m", *(f"{kind}_{n}" for n in DRIVES for kind in ("theta", "I"))]
    found = {}
    for name, motion in MOTIONS.items():
        run = _core.simulate(
            core, {"theta_ref": motion}, end=float(t[-1]), times=t.tolist(), signals=names
        )
        columns = {"theta_ref": motion.value(t)}
        for k, channel in enumerate(run.names):
            if channel not in names:
                continue
            sensor = SENSORS.get(channel) or SENSORS[channel[0]]
            columns[channel] = run.values[:, k] + coloured(random, len(t), *sensor)
        found[name] = Trace(t, columns, name=name)
    return found


def main() -> None:
    """Print what every verb says."""
    progress = (lambda what: print(what, file=sys.stderr)) if "-v" in sys.argv else (lambda _: None)
    true = machine()
    true.add_effect("coulomb", "table")
    true.set("coulomb@table.torque", FRICTION)
    true.set("table.J", HEAVIER * true.get("table.J"))
    traces = records(true)
    sheet = machine()
    print(f"compare, data sheet: error {100.0 * compare(sheet, traces).error['headline']:.3g} %")
    told_of_it = machine()
    told_of_it.add_effect("coulomb", "table")
    told_of_it.set("coulomb@table.torque", 1.0)
    fitted = fit(told_of_it, traces, ["table.J", "coulomb@table.torque"])
    print(fitted.table())
    begin = time.process_time()
    found = diagnose(sheet, traces, experiment=False, progress=progress)
    named, errors = told(found)
    sizes = found.candidates[0].parameters if named else {}
    print(
        f"diagnose: {found.verdict} {named}, "
        + ", ".join(f"{path} {p.value:.4g} {p.unit}" for path, p in sizes.items())
        + f"; refitted, with it, cross-validated, floor: {', '.join(errors)}; "
        + f"{time.process_time() - begin:.0f} s of processor time"
    )


if __name__ == "__main__":
    main()

"""docs/theory/single-motor.md, double-pinion.md and controller.md: their equations are the "
"core's."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

from dualdrive import Machine, _core

ROOT = Path(__file__).resolve().parents[2]
THEORY = ROOT / "docs" / "theory"
FRONT = {"gearbox_1": "front", "mesh_1": "front", "mesh_2": "back"}


def plant(train: str) -> Machine:
    """The train without its controller: U_1 is its input."""
    machine = Machine.load(train)
    machine.set("controller.kind", "none")
    return machine


def rates(machine: Machine, z: dict[str, float], U: float) -> dict[str, float]:
    """What the core makes of a state on the flanks above, all friction sliding forward."""
    modes = {c: s for c, s in FRONT.items() if c in machine.core.connections}
    sticks = {name: "forward" for name in _core.possible_modes(machine.core) if "friction" in name}
    inputs = {"U_1": _core.constant(U)}
    system = _core.linearise(machine.core, inputs, modes={**modes, **sticks}, state=z)
    at = np.array([z.get(name, 0.0) for name in system.states])
    return dict(zip(system.states, (np.asarray(system.A) @ at + system.a).tolist(), strict=True))


def written(machine: Machine, z: dict[str, float], U: float) -> dict[str, float]:
    """The equations of both pages, as they stand there; the single motor has no second pinion."""
    get, double = machine.get, "split_shaft" in machine.core.connections
    i, i_m = get("gearbox_1.ratio"), get("mesh_1.ratio")
    w_1, w_c1, w_m = (z[f"omega_{n}"] for n in ("1", "c1", "m"))
    w_c2 = z.get("omega_c2", 0.0)

    def mesh(name: str, x: float, rate: float, damping: str) -> float:
        side = 1.0 if FRONT[name] == "front" else -1.0
        push = get(f"{name}.stiffness") * (x - side * get(f"{name}.gap"))
        return push + get(f"mesh_damping@{damping}.coefficient") * rate

    T_u = mesh("gearbox_1", z["gearbox_1.twist"], w_1 / i - w_c1, "gearboxes")
    T_1 = mesh("mesh_1", z["mesh_1.twist"], w_c1 - i_m * w_m, "meshes")
    T_2 = mesh("mesh_2", z["mesh_2.twist"], w_c2 - i_m * w_m, "meshes") if double else 0.0
    T_s = 0.0
    if double:
        T_s = get("split_shaft.preload") + get("split_shaft.stiffness") * z["split_shaft.twist"]
        T_s += get("mesh_damping@split_shaft.coefficient") * (w_c1 - w_c2)
    T_fc, T_f = get("coulomb@pinions.torque"), get("coulomb@table.torque")
    K_d, C_e, R, L = (get(f"motor_1.{n}") for n in ("K_d", "C_e", "R", "L"))
    found = {
        "I_1": (U - R * z["I_1"] - C_e * w_1) / L,
        "omega_1": (K_d * z["I_1"] - T_u / i - get("motor_1.b") * w_1) / get("motor_1.J"),
        "omega_c1": (T_u - T_s - T_1 - T_fc - get("pinion_1.b") * w_c1) / get("pinion_1.J"),
        "omega_m": (i_m * (T_1 + T_2) - T_f - get("table.b") * w_m) / get("table.J"),
    }
    if double:
        found["omega_c2"] = (T_s - T_2 - T_fc - get("pinion_2.b") * w_c2) / get("pinion_2.J")
    return found


@pytest.mark.parametrize("train", ["heavy-table-single-motor", "heavy-table-double-pinion"])
def test_the_page_s_equations_are_the_core_s(train: str) -> None:
    machine = plant(train)
    random = np.random.default_rng(7)
    names = [name for name, _ in machine.core.states()]
    size = {"omega_1": 10.0, "I_1": 20.0}
    for _ in range(5):
        z = {n: float(random.normal()) * size.get(n, 2e-3) for n in names}
        core, page = rates(machine, z, 50.0), written(machine, z, 50.0)
        for name, value in page.items():
            assert core[name] == pytest.approx(value, rel=1e-9, abs=1e-9), name


def test_the_preload_that_is_left_is_that_of_the_page() -> None:
    machine = Machine.load("heavy-table-double-pinion")
    spring, mesh = machine.get("split_shaft.stiffness"), machine.get("meshes.stiffness")
    gaps = machine.get("mesh_1.gap") + machine.get("mesh_2.gap")
    left = -(machine.get("split_shaft.preload") + spring * gaps) / (1.0 + 2.0 * spring / mesh)
    assert left == pytest.approx(4.5e3, rel=0.02)
    assert "4.5 kN·m in the preset" in (THEORY / "double-pinion.md").read_text()
    play = 2.0 * machine.get("gearboxes.gap") / machine.get("meshes.ratio")
    assert np.degrees(play) * 3600 == pytest.approx(9.0, abs=0.05)


def test_the_controller_s_page_is_what_the_core_says() -> None:
    tool = runpy.run_path(str(ROOT / "tools" / "controller_page.py"))
    assert tool["PAGE"].read_text("utf-8") == tool["page"](), "run: tools/controller_page.py"
    assert [number for number, _, _ in tool["equations"]()] == [f"C{n}" for n in range(9)]
    code = tool["LAWS"].read_text("utf-8")
    for _, _, name in tool["equations"]():
        assert re.search(rf"\b{name}\b", code)

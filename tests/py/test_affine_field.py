"""Matrices stand in for the model in stepping engines where a machine is affine.

Both must say the same, at any state, time and modes. The sides of this comparison share nothing but
the model: one evaluates it in plain numbers, the other reads derivatives off it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from core_machines import Array
from core_random import RandomMachine
from dualdrive import Machine, _core, default_motion, presets

#: those that may stand in any machine: tooth forces need flanks on every mesh of the ring
AFFINE = {kind.name for kind in _core.effect_types() if kind.affine}
AFFINE -= {"sensor_delay", "radial_shift", "table_tilt"}
ROUNDING = 1e-11  # of the sum of what a law adds up; inputs may cancel each other in it
FORMULAS = {  # of a body, affine between the switches of their signs; a in N m, c in N m s/rad
    "-a * sign(speed) - c * speed": "ac",
    "-c * min(speed, 0) + a / 3": "ac",
    "if(speed > 0, -a, a / 2) + c * abs(speed) / 4": "ac",
}
TIMES = (0.0, 0.05, 0.3217, 1.0, 1.9)  # s


class AffineMachine(RandomMachine):
    """A random machine with all that leaves it affine between switches."""

    def add_effect(self) -> None:
        if self.chance(0.2):
            body, formula = self.pick("table", "motor_1", "pinion_1"), self.pick(*FORMULAS)
            numbers = {"a": ("N*m", 30.0), "c": ("N*m*s/rad", 2.0)}
            self.machine.add_expression(
                body, formula, [(n, *numbers[n]) for n in FORMULAS[formula]]
            )
            return
        before = self.machine.copy()
        super().add_effect()
        if self.machine.effects[-1:] and self.machine.effects[-1]["effect"] not in AFFINE:
            self.machine = before

    def control(self) -> None:
        super().control()
        self.machine.set("controller.delta_t", 0.0)
        if self.chance(0.3, "lag of K_d"):
            self.machine.set("controller.tau_d", self.near(5e-3))

    def load(self) -> _core.Waveform:
        t = np.arange(0.0, 2.0, 0.05)
        knots = self.scale.load * self.random.normal(size=t.size)
        way = str(self.random.choice(["hold", "linear", "cubic"]))
        self.notes.append(f"load {way}")
        return _core.sampled(t, knots, _core.Interpolation[way]) + super().load()


@dataclass(frozen=True)
class Case:
    """A machine, its inputs, and which modes its elements may have."""

    machine: _core.Machine
    inputs: dict[str, _core.Waveform]

    @property
    def modes(self) -> dict[str, list[str]]:
        return _core.possible_modes(self.machine, self.inputs)

    def laws(self, moment: Moment, state: Array, *, matrices: bool) -> _core.FrozenLaws:
        return _core.frozen_laws(
            self.machine, self.inputs, modes=moment.modes, t=moment.t, cell=moment.cell,
            state=dict(zip(self.states(), state, strict=True)), matrices=matrices,
        )  # fmt: skip

    def states(self) -> list[str]:
        return list(_core.linearise(self.machine, self.inputs).states)


@dataclass(frozen=True)
class Moment:
    """An instant, the interval free of knots in which it lies, and modes."""

    t: float
    cell: tuple[float, float]
    modes: dict[str, str]


def of_preset(name: str) -> Case:
    machine = Machine.load(name)
    return Case(machine.core, {"theta_ref": default_motion(machine).waveform})


def of_seed(seed: int) -> Case:
    drawn = AffineMachine(seed)
    return Case(drawn.machine, drawn.inputs)


def moments(case: Case, random: np.random.Generator) -> list[Moment]:
    """Draw instants and modes: some instants are knots, seen from both sides."""
    inputs = case.inputs.values()
    knots = np.unique(np.concatenate([at for w in inputs for at in (w.breaks(), w.knots())]))
    edges = np.array([-np.inf, *knots, np.inf])
    found = []
    for t in (*TIMES, *knots[:: max(1, len(knots) // 4)]):
        modes = {name: str(random.choice(known)) for name, known in case.modes.items()}
        first, last = np.searchsorted(edges, t, "left"), np.searchsorted(edges, t, "right")
        for k in range(first - 1, last):
            found.append(Moment(float(t), (float(edges[k]), float(edges[k + 1])), modes))
    return found


def draw_state(case: Case, random: np.random.Generator) -> Array:
    n = len(case.states())
    return np.asarray(random.normal(size=n) * 10 ** random.uniform(-4, 2, n))


def terms(case: Case, moment: Moment, z: Array) -> tuple[Array, Array]:
    """What rates and guards add up, in sizes, from the model: rounding is relative to that."""
    nothing = case.laws(moment, np.zeros_like(z), matrices=False)
    rates, guards = np.abs(nothing.rates), np.abs(nothing.guards)
    for state in np.diag(z):
        one = case.laws(moment, state, matrices=False)
        rates, guards = (
            rates + np.abs(one.rates - nothing.rates),
            guards + np.abs(one.guards - nothing.guards),
        )
    return rates, guards


CASES = [*presets(), *range(80)]


@pytest.mark.parametrize("which", CASES)
def test_rates_and_guards_of_the_matrices_are_those_of_the_model(which: str | int) -> None:
    case = of_preset(which) if isinstance(which, str) else of_seed(which)
    random = np.random.default_rng(1)
    for moment in moments(case, random):
        z = draw_state(case, random)
        model, matrices = (case.laws(moment, z, matrices=m) for m in (False, True))
        rates, guards = terms(case, moment, z)
        assert (np.abs(matrices.rates - model.rates) <= ROUNDING * rates).all(), moment
        assert (np.abs(matrices.guards - model.guards) <= ROUNDING * guards).all(), moment


@pytest.mark.parametrize("which", [*presets(), *range(20)])
def test_slopes_of_guards_are_their_differences_along_the_flow(which: str | int) -> None:
    case = of_preset(which) if isinstance(which, str) else of_seed(which)
    random = np.random.default_rng(2)
    step = 1e-4  # s: guards are cubic in it at most, but for slow harmonics
    for moment in moments(case, random):
        if min(moment.t - moment.cell[0], moment.cell[1] - moment.t) < step:
            continue
        z = draw_state(case, random)
        laws = case.laws(moment, z, matrices=True)
        before, after = (
            case.laws(replace(moment, t=moment.t + d), z + d * laws.rates, matrices=True).guards
            for d in (-step, step)
        )
        _, guards = terms(case, moment, z)
        allowed = 1e-5 * np.abs(laws.guard_slopes) + 1e-10 * (guards + np.abs(after)) / step
        differences = (after - before) / (2 * step)
        assert (np.abs(laws.guard_slopes - differences) <= allowed).all(), moment


def test_the_machines_drawn_have_what_may_go_wrong() -> None:
    notes = {note for seed in range(80) for note in AffineMachine(seed).notes}
    kinds = {f"sampled {loop}" for loop in ("position", "tension", "speed", "current")}
    assert (
        kinds
        | {"load hold", "load linear", "load cubic", "falling", "voltage", "ramp load", *FORMULAS}
        <= notes
    )
    modes = {m for seed in range(80) for known in of_seed(seed).modes.values() for m in known}
    assert {"riding high", "riding low", "high, unwinding", "stuck", "negative"} <= modes


def test_a_law_that_no_matrix_says_is_refused() -> None:
    machine = Machine.load(presets()[0]).core
    machine.add_effect("cogging", "motor_1")
    with pytest.raises(ValueError, match="cogging@motor_1 is not affine"):
        _core.frozen_laws(machine, matrices=True)

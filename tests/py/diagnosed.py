"""A diagnosis as one would come out, from the demo's records, for tests of what shows it."""

from __future__ import annotations

from functools import cache

import numpy as np

from dualdrive.compare import compare
from dualdrive.demo import records, sheet
from dualdrive.diagnose import (
    Candidate,
    Diagnosis,
    EquationAtFault,
    Experiment,
    Interval,
    Ladder,
    Shape,
    Step,
)

#: a label that a page must escape
NASTY = "<script>alert('x')</script> & \"co\""


def ladder() -> Ladder:
    """What `improve` leaves."""
    machine = sheet()
    steps = (
        Step("nominal", 0.41, 0.43, 0.029, "", machine),
        Step("refitted", 0.22, 0.24, 0.029, "", machine),
        Step("+ coulomb@table", 0.031, 0.033, 0.029, "dualdrive add …", machine),
    )
    why = "nothing is left that these records could show"
    return Ladder(steps, [diagnosis()], why, "held_out", 61.0)


@cache
def diagnosis(note: str = NASTY) -> Diagnosis:
    machine, (fitting, _) = sheet(), records()
    improved = machine.copy()
    improved.add("coulomb", "table", torque=2000.0)
    before, after = compare(machine, fitting), compare(improved, fitting)
    at = np.linspace(-0.02, 0.02, 41)
    torque = Interval(2010.0, 1950.0, 2070.0, "N*m")
    return Diagnosis(
        machine="demo-table",
        mode="closed_loop",
        records=("fit",),
        verdict="ambiguous",
        candidates=[
            Candidate(
                (("coulomb", "table"),),
                0.61,
                {"coulomb@table.torque": torque},
                0.031,
                0.033,
                812.0,
                0.97,
            ),
            Candidate(
                (("stribeck", "table"),),
                0.36,
                {"stribeck@table.torque": torque},
                0.031,
                0.034,
                810.0,
                0.96,
            ),
            Candidate((("cogging", "motors"), ("viscous", "table")), 0.02, {}, 0.2, 0.21, 9.0, 0.1),
            Candidate((("wear", "ring"),), 0.0, {}, np.nan, np.nan, 3.0, 0.05, False, note),
        ],
        groups=[("coulomb@table", "stribeck@table")],
        equation=EquationAtFault("table", 0.99, {"table": 0.91, "motor_1": 0.05, "mesh_1": 0.04}),
        where=before.where,
        error={
            "nominal": 0.41,
            "refitted": 0.22,
            "held_out_refitted": 0.24,
            "best": 0.031,
            "held_out_best": 0.033,
            "noise_floor": 0.029,
        },
        shapes=[
            Shape(
                "table",
                "speed",
                "rad/s",
                "N*m",
                at,
                2e3 * np.tanh(at / 2e-3),
                2e3 * np.tanh(at / 2e-3) - 200,
                2e3 * np.tanh(at / 2e-3) + 200,
                0.93,
            ),
        ],
        next_experiment=Experiment(
            "slow two-way ramps, no tension",
            "cycle:0.0066;0.0,v=0.00084,a=0.0042,j=0.021,start=1.0,repeats=2",
            {"controller.T_ten": 0.0},
            ("coulomb@table", "stribeck@table"),
            41.0,
            "at creep what depends on speed falls away",
            {"slow two-way ramps": 19.0, "micro-reversals": 7.5, "quick moves, both ways": 0.3},
            ("dualdrive simulate machine.toml --motion 'cycle:…' --plot expected.png",),
        ),
        warnings=["the clock jitters by 3 % of a sample"],
        cut=["pairs of effects"],
        paragraph="Dry friction is missing at the table; it closes 96 % of the gap.",
        command="dualdrive diagnose machine.toml fit.csv",
        seconds=12.3,
        refitted=machine,
        improved=improved,
        before=before,
        after=after,
        moved={"table.J": Interval(5.02e6, 4.9e6, 5.1e6, "kg*m^2")},
    )

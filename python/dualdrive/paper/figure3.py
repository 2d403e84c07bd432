"""Figure 3: the control structure, drawn from the model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from dualdrive.machine import Machine
from dualdrive.paper.exhibit import Claim, Exhibit, Table, verdict
from dualdrive.paper.settings import GAP_HALF, untuned
from dualdrive.paper.structure import Diagram, structure

__all__ = ["Figure3", "figure3"]


@dataclass(frozen=True)
class Figure3:
    """What the picture is drawn from: the machine's diagram, and what changes change in it."""

    diagram: Diagram
    changes: Mapping[str, tuple[str, ...]]


#: what is changed -> paths and values
_CHANGES: Final[Mapping[str, Mapping[str, float | str]]] = {
    "T_N off": {"controller.T_N": 0.0},
    "equaliser on the slave alone": {"controller.equaliser": "slave"},
    "slave lag 50 ms": {"controller.delta_t": 0.05},
    "no play": {"meshes.kind": "compliant"},
    "tension off": {"controller.tension": "off"},
    "drive without current loop": {"controller.current": "voltage"},
    "feed-forward 1": {"controller.f_v": 1.0},
}


def figure3(machine: Machine | None = None) -> Exhibit:
    """The control structure of a machine; by default that of figure 4 with its tension."""
    m = untuned(6.0, GAP_HALF, 60.0) if machine is None else machine
    diagram = structure(m)
    changes = {what: _difference(m, diagram, paths) for what, paths in _CHANGES.items()}
    data = Figure3(diagram, changes)
    rows = tuple((what, "; ".join(lines) or "nothing") for what, lines in changes.items())
    return Exhibit(
        name="fig3",
        title="Figure 3: control structure with gear clearance",
        about=(
            "From the paper's text: backlash between both pinions and the ring in a block "
            "diagram of two "
            "motors. Here the diagram is read from the model that is "
            "simulated, and is another one when the model is another one."
        ),
        chosen=("the machine of figure 4, with a tension of 60 N·m",),
        claims=(_both_play(diagram), _slave(diagram)),
        tables=(
            Table(
                "What a change of the model changes in the diagram",
                ("change", "blocks and arrows"),
                rows,
            ),
        ),
        notes=(
            "`dualdrive.paper.structure.structure(machine).dot()` gives the diagram of any machine "
            "in the language of Graphviz.",
        ),
        data=data,
    )


def _difference(
    machine: Machine, before: Diagram, changes: Mapping[str, float | str]
) -> tuple[str, ...]:
    """What a change adds to the diagram and what it takes away, in words."""
    other = machine.copy()
    for path, value in changes.items():
        other.set(path, value)
    after = structure(other)
    was, now = _inventory(before), _inventory(after)
    return (*(f"− {line}" for line in was if line not in now),
            *(f"+ {line}" for line in now if line not in was))  # fmt: skip


def _inventory(diagram: Diagram) -> list[str]:
    blocks = [block.text.replace("\n", ", ") for block in diagram.blocks if block.shape != "sum"]
    return [*blocks, *(f"{a.source} → {a.target}" for a in diagram.arrows)]


def _both_play(diagram: Diagram) -> Claim:
    count = sum(block.shape == "gap" for block in diagram.blocks)
    return Claim(
        "a backlash block between each pinion and the ring",
        f"{count} backlash blocks, one in each mesh",
        verdict(count == 2),
    )


def _slave(diagram: Diagram) -> Claim:
    own = any(a.source == "motor 2" and a.target == "speed sum 2" for a in diagram.arrows)
    return Claim(
        "the slave works in open loop",
        "the slave has its own speed loop; the position loop is the master's, and common"
        if own
        else "it does",
        verdict(not own),
    )

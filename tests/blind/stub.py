"""A diagnosis that knows nothing, for trying the runner: always one answer, at times none."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any


def diagnose(machine: Any, traces: Any, **how: Any) -> Any:
    """Coulomb friction at the table, whatever the record; it fails on records of odd length."""
    if len(traces[0].t) % 7 == 1:
        raise ValueError("a stub fails now and then")
    candidate = {
        "effect": "coulomb",
        "place": "table",
        "probability": 0.4,
        "held_out": 0.1,
        "parameters": {"coulomb@table.torque": {"value": 1.0, "low": 0.0, "high": 1e9, "unit": ""}},
    }
    figures = {
        "verdict": "effect",
        "candidates": [candidate],
        "groups": [],
        "parameters": {},
        "equation": {"name": "table", "probability": 0.5},
        "error": {"held_out_best": 0.02, "held_out_refitted": 0.05, "refitted": 0.05},
    }
    return SimpleNamespace(figures=lambda: figures)

"""Results on disk and back: JSON that names known kinds, arrays beside it, nothing executed.

A result is made of dataclasses, machines, arrays, containers and numbers. `save` writes them into a
folder as ``<name>.json`` and ``<name>.npz``; `load` makes only the kinds that are listed here.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from dualdrive.files import FileError, write_atomically
from dualdrive.machine import Machine

__all__ = ["load", "save"]

_KIND: Final = "kind"
#: what stands in JSON for a number it does not have
_ODD: Final = {"nan": float("nan"), "inf": float("inf"), "-inf": float("-inf")}


@cache
def _kinds() -> dict[str, type]:
    """Every dataclass that a kept result may hold, by its name."""
    from dualdrive import compare, diagnose
    from dualdrive.diagnose.decision import MissingTorque

    own = (
        compare.Comparison,
        compare.Condition,
        compare.EquationAtFault,
        compare.NoiseFloor,
        compare.Order,
        compare.Quantity,
        compare.Skew,
        compare.Correlation,
        compare.Stretch,
        diagnose.Candidate,
        diagnose.Diagnosis,
        diagnose.Experiment,
        diagnose.Interval,
        diagnose.Shape,
        MissingTorque,
    )
    return {kind.__name__: kind for kind in own}


def save(value: Any, folder: Path, name: str) -> None:
    """Write a result; its JSON comes last, so that it is there whole or not at all.

    Raises TypeError for a kind that is not listed.
    """
    arrays: dict[str, np.ndarray[Any, Any]] = {}
    text = json.dumps(_plain(value, arrays), allow_nan=False)
    with write_atomically(folder / f"{name}.npz") as temporary, temporary.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)
    with write_atomically(folder / f"{name}.json") as temporary:
        temporary.write_text(text, "utf-8")


def load(folder: Path, name: str) -> Any:
    """Read a result. Raises FileError where it is not there or not what `save` wrote."""
    try:
        told = json.loads((folder / f"{name}.json").read_text("utf-8"))
        with np.load(folder / f"{name}.npz", allow_pickle=False) as arrays:
            return _made(told, arrays)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FileError(f"{folder / name}: no result of the workbench: {error}") from None


def _plain(value: Any, arrays: dict[str, np.ndarray[Any, Any]]) -> Any:
    if isinstance(value, np.ndarray):
        name = f"a{len(arrays)}"
        arrays[name] = value
        return {_KIND: "array", "name": name}
    if isinstance(value, Machine):
        return {_KIND: "machine", "toml": value.toml()}
    if is_dataclass(value) and not isinstance(value, type):
        kind = type(value).__name__
        if _kinds().get(kind) is not type(value):
            raise TypeError(f"{kind}: not a kind of result that is kept")
        own = {f.name: _plain(getattr(value, f.name), arrays) for f in fields(value)}
        return {_KIND: kind, "fields": own}
    if isinstance(value, Mapping):
        pairs = [[_plain(k, arrays), _plain(v, arrays)] for k, v in value.items()]
        return {_KIND: "mapping", "pairs": pairs}
    if isinstance(value, tuple):
        return {_KIND: "tuple", "items": [_plain(v, arrays) for v in value]}
    if isinstance(value, list):
        return [_plain(v, arrays) for v in value]
    return _number(value)


def _number(value: Any) -> Any:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return {_KIND: "odd", "text": str(value)}
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise TypeError(f"{type(value).__name__}: not a kind of result that is kept")


def _made(told: Any, arrays: Mapping[str, Any]) -> Any:
    if isinstance(told, list):
        return [_made(v, arrays) for v in told]
    if not isinstance(told, dict):
        return told
    kind = told[_KIND]
    if kind == "array":
        return arrays[told["name"]]
    if kind == "machine":
        return Machine.from_toml(told["toml"], "machine")
    if kind == "mapping":
        return {_made(k, arrays): _made(v, arrays) for k, v in told["pairs"]}
    if kind == "tuple":
        return tuple(_made(v, arrays) for v in told["items"])
    if kind == "odd":
        return _ODD[told["text"]]
    return _kinds()[kind](**{k: _made(v, arrays) for k, v in told["fields"].items()})

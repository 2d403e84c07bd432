"""The demo's records: what the generator makes, with a hidden effect far above their noise."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
maker = importlib.import_module("make_demo_trace")

Channels = dict[str, np.ndarray[tuple[int, ...], np.dtype[np.float64]]]


def recorded(folder: Path, record: str) -> Channels:
    with (folder / f"{record}.csv").open(encoding="utf-8") as file:
        names = [head.split()[0] for head in file.readline().split(",")]
        rows = np.loadtxt(file, delimiter=",")
    return dict(zip(names, rows.T, strict=True))


def excess(record: str, torque: float) -> dict[str, float]:
    """Return rms of record minus machine with that friction, over the sensor's noise."""
    noise = maker.truth()["noise"]
    value = maker.nominal()
    for path, factor in maker.truth()["factors"].items():
        value[path] *= factor
    machine = maker.build(value, torque)
    clean = maker.signals(machine, maker.run(machine, record))
    seen = recorded(maker.FOLDER, record)
    return {
        name: float(np.std(seen[name] - clean[name]) / noise[name]["rms"])
        for name in noise
        if name in clean
    }


def test_records_are_what_the_generator_makes(tmp_path: Path) -> None:
    maker.main(tmp_path)
    for record in maker.RECORDS:
        shipped, made = recorded(maker.FOLDER, record), recorded(tmp_path, record)
        noise = maker.truth()["noise"]
        for name, signal in made.items():
            step = noise[name]["step"] if name in noise else 1e-8
            np.testing.assert_allclose(shipped[name], signal, atol=1.5 * step, err_msg=name)


def test_records_are_small_enough_to_ship() -> None:
    assert sum((maker.FOLDER / f"{name}.csv").stat().st_size for name in maker.RECORDS) < 300_000


@pytest.mark.parametrize("record", list(maker.RECORDS))
def test_hidden_effect_stands_far_above_the_noise(record: str) -> None:
    with_effect = excess(record, maker.truth()["effect"]["torque"])
    without = excess(record, 0.0)
    for name, ratio in with_effect.items():
        assert ratio == pytest.approx(1.0, abs=0.2), name
        assert without[name] > 5 * ratio, name

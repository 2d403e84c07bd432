"""The lines of a plot for every kind of colour vision, light and dark."""

from __future__ import annotations

import re
from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray

from dualdrive.web import modules

Array = NDArray[np.float64]

#: of linear RGB, for whom one kind of cone is missing: G. M. Machado, M. M. Oliveira,
#: L. A. F. Fernandes, IEEE Trans. Visualization and Computer Graphics 15 (2009) 1291-1298, table 1
VISIONS = {
    "all cones": np.eye(3),
    "protanopia": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "deuteranopia": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
    "tritanopia": np.array(
        [
            [1.255528, -0.076749, -0.178779],
            [-0.078411, 0.930809, 0.147602],
            [0.004733, 0.691367, 0.303900],
        ]
    ),
}
LINES = ("measured", "model", "second", "third")  # measured and the models that are drawn over it


def linear(colour: str) -> Array:
    """Of ``#rrggbb``; the transfer function of IEC 61966-2-1."""
    s = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    return np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)


def lightness_and_hue(rgb: Array) -> Array:
    """CIELAB under D65."""
    to_xyz = np.array(
        [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    )
    x, y, z = np.cbrt(np.maximum(to_xyz @ rgb / np.array([0.9505, 1.0, 1.089]), 0.008856))
    return np.array([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])


def themes() -> dict[str, dict[str, str]]:
    text = modules.read("style.css").decode()
    blocks = [b for b in re.split(r"color-scheme:", text)[1:] if "--measured" in b]
    read = [dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", b.partition("}")[0])) for b in blocks]
    return {"light": read[0], "dark": read[1], "dark, chosen": read[2]}


@pytest.mark.parametrize("vision", VISIONS)
@pytest.mark.parametrize("theme", themes())
def test_lines_are_told_apart_by_their_colours(theme: str, vision: str) -> None:
    """By six times what is just seen (2.3, CIE 1976), hue and lightness together."""
    tones = themes()[theme]
    seen = {n: lightness_and_hue(np.clip(VISIONS[vision] @ linear(tones[n]), 0, 1)) for n in LINES}
    apart = {p: float(np.linalg.norm(seen[p[0]] - seen[p[1]])) for p in combinations(LINES, 2)}
    assert min(apart.values()) > 15.0, apart


@pytest.mark.parametrize("theme", themes())
def test_lines_stand_out_from_the_paper(theme: str) -> None:
    """A contrast of 3, as WCAG 2 asks of graphics."""
    tones = themes()[theme]
    light = {n: float(np.array([0.2126, 0.7152, 0.0722]) @ linear(c)) for n, c in tones.items()}
    for name in LINES:
        dark, bright = sorted((light[name], light["paper"]))
        assert (bright + 0.05) / (dark + 0.05) > 3.0, name

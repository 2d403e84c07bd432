"""Attempts by words: units, numbers, motions and formulas, made from their own grammars."""

from __future__ import annotations

import random
from collections.abc import Iterator
from functools import partial
from typing import Final

from dualdrive import Machine
from dualdrive.motion import parse_motion
from dualdrive.simulation import simulate
from dualdrive.units import conversion, human, is_unit, parse, parse_values

from .attempt import Attempt

_NAMES: Final = ("kg", "m", "s", "A", "K", "rad", "N", "V", "ohm", "rpm", "deg", "arcsec", "mm", "Hz", "%",
                 "turn", "min", "1", "degC", "dB", "GN", "quectom", "x", "°", "″", "µm", "Nm", "9", "inf", "")  # fmt: skip
_JOINTS: Final = (
    "*",
    "/",
    "^",
    "**",
    " ",
    "·",
    "^-",
    "^9^",
    "^(",
    ")",
    "(",
    "²",
    "⁹",
    "^.5",
    "^9",
    "//",
    "-1",
    "_",
)
_NUMBERS: Final = (
    "1",
    "-0",
    "1e308",
    "1e-320",
    "1e999",
    "nan",
    "9" * 400,
    "1_0",
    "٣",
    "0x1",
    "+-1",
    "1.2.3",
    "",
)
_TARGETS: Final = ("", "rad", "kg*m^2", "N*m", "1/s", "K", "Hz", "rad/s")


def _unit(chance: random.Random) -> str:
    pieces = (chance.choice(_NAMES) + chance.choice(_JOINTS) for _ in range(chance.randint(1, 12)))
    return "".join(pieces) + chance.choice(_NAMES)


def units(chance: random.Random) -> Iterator[Attempt]:
    """Ten texts each, as unit, quantity and range."""
    for k in range(60):
        texts = [_unit(chance) for _ in range(10)]
        numbers = [chance.choice(_NUMBERS) for _ in texts]
        target = chance.choice(_TARGETS)
        yield Attempt(
            f"units {k}: {texts[0]!r}, ...", call=partial(_use_units, texts, numbers, target)
        )


def _use_units(texts: list[str], numbers: list[str], target: str) -> None:
    for text, number in zip(texts, numbers, strict=True):
        is_unit(text)
        for use in (
            lambda: conversion(text, target),  # noqa: B023 -- used at once
            lambda: human(parse(f"{number} {text}", target), target),  # noqa: B023
            lambda: parse_values(f"{number}:{text}:{number}", target),  # noqa: B023
        ):
            _refused_in_words(use)


def motions(chance: random.Random) -> Iterator[Attempt]:
    """Ten motions each, and a moment of those that can be."""
    names = (
        "v",
        "a",
        "j",
        "f",
        "start",
        "end",
        "repeats",
        "lines",
        "seed",
        "levels",
        "dwell",
        "at",
        "speeds",
        "periods",
        "x",
        "",
    )
    values = (
        *_NUMBERS,
        "1",
        "0.1",
        "1mrad",
        "0.5;1",
        "1;;2",
        "1e9",
        "-1",
        "inf",
        "1000000000000",
        "2.5",
    )
    kinds = ("move", "cycle", "shuttle", "step", "sine", "multisine", "sampled", "", "x")
    for k in range(60):
        texts = []
        for _ in range(10):
            words = [
                f"{chance.choice(names)}={chance.choice(values)}"
                for _ in range(chance.randint(0, 4))
            ]
            if chance.random() < 0.5:
                words += ["v=1", "a=1"]
            texts.append(f"{chance.choice(kinds)}:{','.join([chance.choice(values), *words])}")
        yield Attempt(f"motions {k}: {texts[0]!r}, ...", call=partial(_use_motions, texts))


def _use_motions(texts: list[str]) -> None:
    machine = Machine.load("bench")
    for text in texts:
        _refused_in_words(
            lambda: simulate(machine, parse_motion(text), end=0.01, max_steps=20_000)  # noqa: B023
        )


def formulas(chance: random.Random) -> Iterator[Attempt]:
    """A law each: written into a machine, run for a moment."""
    for k in range(150):
        formula = _formula(chance, chance.randint(0, 5)) if k % 5 else chance.choice(_ODD)
        yield Attempt(f"formula {k}: {formula[:60]!r}", call=partial(_use_formula, formula))


_ODD: Final = (
    "exp(1000*t)*c", "exp(exp(exp(t)))*c", "c/(t-0.005)", "c*" * 2000 + "1", "(" * 5000, "c" + "+c" * 5000,
    "1e308*c*1e308", "sqrt(-1)*c", "log(0)*c", "c^9^9^9", "speed^100*c", "0/0*c", "tanh(speed*1e300)*c",
    "if(speed>0,", "c if speed else c", "__import__('os')", "c\0", "c;c", "", " ", "sign(sin(1e6*t))*c",
    "sin(1e9*t)*c", "floor(1e6*t)*c", "abs(speed)^-1*c", "c*1_0", "-" * 3000 + "c", "pow(c,1e9)", "t",
)  # fmt: skip


def _formula(chance: random.Random, depth: int) -> str:
    if depth == 0:
        return chance.choice(
            ["c", "speed", "angle", "t", "1", "0", "1e308", "-1", "theta_m", "x", "nan", ""]
        )
    inner = [_formula(chance, depth - 1) for _ in range(2)]
    form = chance.choice(
        ["({0}+{1})", "({0}*{1})", "({0}/{1})", "({0}-{1})", "{0}^{1}", "exp({0})", "sqrt({0})", "sin({0})",
         "sign({0})", "abs({0})", "tanh({0})", "if({0}>{1},{0},{1})", "min({0},{1})", "log({0})", "max({0})", "{0}{1}"]
    )  # fmt: skip
    return form.format(*inner)


def _use_formula(formula: str) -> None:
    machine = Machine.load("bench")
    machine.add("expression@table", formula=formula, parameters={"c": 1.0})
    # what merely takes many steps, such as sin(1e9*t), is honest work that max_steps bounds
    simulate(machine, end=0.02, output_step=5e-3, max_steps=1_000_000)


def _refused_in_words(use: object) -> None:
    try:
        use()  # type: ignore[operator]
    except ValueError as error:
        if not type(error).__module__.startswith("dualdrive"):
            raise
        if len(str(error)) > 1200:
            raise AssertionError("a message of kilobytes") from None

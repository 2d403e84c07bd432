"""The targets of the fuzzer, each with its good inputs and a few hundred of its own changes.

`python -m tests.adversary.fuzz` goes on from here, led by coverage.
"""

from __future__ import annotations

import random
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.adversary.fuzz_targets import TARGETS, attempt


@pytest.mark.parametrize("name", TARGETS)
def test_good_inputs_are_read(name: str) -> None:
    for seed in TARGETS[name].seeds():
        attempt(TARGETS[name], seed)


@pytest.mark.parametrize("name", TARGETS)
def test_changed_inputs_are_read_or_refused_in_words(name: str) -> None:
    target = TARGETS[name]
    chance = random.Random(name)
    seeds = list(target.seeds())
    for _ in range(40):
        data = chance.choice(seeds)
        for _ in range(chance.randint(1, 3)):
            data = target.change(data, chance)
        attempt(target, data)

"""The finding in one sentence: what an engineer would say, for every verdict."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from diagnosed import diagnosis
from dualdrive import _core
from dualdrive.diagnose import Candidate, Interval, headline
from dualdrive.diagnose.one_sentence import spoken
from dualdrive.diagnose.paragraph import paragraph
from dualdrive.diagnose.phrases import none_missing

FALLS = "the error falls from 22 % to 3.1 %, which is the noise of the sensors."


@pytest.mark.parametrize(
    ("verdict", "said"),
    [
        (
            "effect",
            "Coulomb friction of 2.01 kN·m at the table is missing from the model: "
            f"with it {FALLS}",
        ),
        (
            "ambiguous",
            "An effect is missing from the model, Coulomb friction or Stribeck friction at the "
            f"table, which the records can't tell: with either {FALLS}",
        ),
        (
            "parameters",
            "No missing effect can be named, but numbers of the data sheet are off: refitted, the "
            "error falls from 41 % to 22 %, where the sensors alone leave 2.9 %.",
        ),
        (
            "unknown",
            "Something is missing that no effect of the library explains: 22 % of error is left "
            "with every number refitted, where the sensors alone leave 2.9 %.",
        ),
        (
            "unfinished",
            "The search was stopped before every effect had its turn: "
            "Coulomb friction at the table leads so far.",
        ),
    ],
)
def test_every_verdict_is_one_sentence(verdict: str, said: str) -> None:
    assert headline(replace(diagnosis(), verdict=verdict)) == said  # type: ignore[arg-type]


def test_a_model_that_meets_the_record_is_said_to() -> None:
    d = replace(diagnosis(), verdict="adequate", error={"nominal": 0.03, "noise_floor": 0.029})
    said = "The model meets what was recorded: its error is 3 %, which is the noise of the sensors."
    assert headline(d) == said
    d = replace(d, error={"nominal": 0.03})
    assert headline(d) == "The model meets what was recorded: its error is 3 %."


def test_none_is_missing_only_where_noise_alone_is_left() -> None:
    """ "No effect is missing" stood beside three times what the sensors leave."""
    own, floor = diagnosis(), 0.03
    for left, said in ((1.3 * floor, "No effect is missing"), (1.4 * floor, "No missing effect")):
        error = {"nominal": left, "refitted": left, "noise_floor": floor}
        assert headline(replace(own, verdict="parameters", error=error)).startswith(said)
        assert none_missing(error).startswith(said)
        adequate = replace(own, verdict="adequate", error=error)
        meets = "meets" in headline(adequate)
        assert meets == ("meets" in paragraph(adequate)) == (left == 1.3 * floor)


def test_two_effects_and_rivals_at_two_places_are_told_with_their_places() -> None:
    pair = diagnosis().candidates[2]
    said = headline(replace(diagnosis(), verdict="effect", candidates=[pair]))
    assert said.startswith("Cogging at the motors and viscous friction at the table are missing")
    assert "with them the error falls" in said
    other = Candidate((("mesh_damping", "mesh_2"),), 0.4, {}, 0.1, 0.1, 1.0, 0.5)
    first = diagnosis().candidates[0]
    told = replace(diagnosis(), candidates=[first, other], groups=[(first.label, other.label)])
    assert "Coulomb friction at the table or mesh damping in mesh 2, which" in headline(told)


def test_a_search_that_was_stopped_early_says_what_gains_most() -> None:
    first, second, *_ = (replace(c, resolved=False) for c in diagnosis().candidates)
    d = replace(diagnosis(), verdict="unfinished", candidates=[replace(second, gain=9.0), first])
    assert headline(d).endswith("had its turn: Coulomb friction at the table gains most so far.")
    d = replace(d, candidates=[replace(first, gain=float("nan"))])
    assert headline(d).endswith("had its turn: nothing can be said yet.")


def test_records_that_cannot_be_judged_say_why() -> None:
    d = replace(diagnosis(), verdict="unknown", error={}, candidates=[])
    assert headline(d) == "The records can't be judged: the clock jitters by 3 % of a sample."


def test_a_number_without_size_or_certainty_is_left_out() -> None:
    counted = {"transmission_error@table.teeth": Interval(328.0, 328.0, 328.0, "")}
    c = Candidate((("transmission_error", "table"),), 0.9, counted, 0.03, 0.03, 9.0, 0.9)
    said = headline(replace(diagnosis(), verdict="effect", candidates=[c]))
    assert said.startswith("Transmission error at the table is missing from the model")


def test_no_effect_of_the_library_is_called_by_its_key() -> None:
    """An underscore is no word, and the name of a person alone is no effect."""
    for effect in _core.effect_types():
        for place in ("table", "motors", "meshes", "gearboxes", "controller", "motor_2"):
            words = spoken(Candidate(((effect.name, place),), 0.5, {}, 0.1, 0.1, 1.0, 0.5))
            assert re.fullmatch(r"[A-Za-z]\w+[\w -]* (at|in) (the )?[a-z]+( \d)?", words), words
            assert "_" not in words
            assert words.split(" at ")[0] not in ("coulomb", "stribeck", "lugre", "viscous")

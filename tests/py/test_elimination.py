"""Effects taken out of a variant again: what is left is what would have been put in alone."""

from __future__ import annotations

import numpy as np
import pytest

from dualdrive.diagnose.screening import Library
from dualdrive.innovations import Point, Variant
from test_likelihood import grey


def blank(variant: Variant) -> Point:
    """Innovations that tell of no order."""
    own = grey(0.4)
    residuals = tuple(np.zeros_like(r.measured) for r in own.records)
    return Point(variant, own.start(variant), residuals, 0.0, 0.0)


def beside(library: Library, base: Variant, effect: tuple[str, str]) -> Variant:
    return next(v for v in library.variants(base, blank(base)) if v.effects[-1] == effect)


CHAIN = (("torque_ripple", "motors"), ("coulomb", "table"), ("eccentricity", "table"))


@pytest.mark.parametrize("out", CHAIN, ids="@".join)
def test_what_is_left_is_what_would_have_been_put_in_alone(out: tuple[str, str]) -> None:
    own = grey(0.4)
    library = Library(own.core, own)
    whole = expected = Variant(own.core)
    for effect in CHAIN:
        whole = beside(library, whole, effect)
        if effect != out:
            expected = beside(library, expected, effect)
    found = library.without(whole, out)
    assert found is not None
    assert found.key == expected.key
    assert [p.path for p in found.extra] == [p.path for p in expected.extra]
    assert found.fixed == expected.fixed
    assert found.looks == expected.looks
    assert {e["label"] for e in found.grown.effects} == {e["label"] for e in expected.grown.effects}

"""Where a law begins beside one that is known, which laws are rivals, and of which orders."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dualdrive.diagnose.screening import Library
from dualdrive.diagnose.selection.begins import begins_beside, in_its_place
from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.diagnose.selection.refits import confused
from dualdrive.innovations import Point, Variant, coordinates, first_noise, inflation, values
from test_elimination import blank
from test_likelihood import grey
from test_slopes_nearby import variant_of

Array = NDArray[np.float64]


def variants() -> tuple[Library, dict[str, list[Variant]]]:
    own = grey(0.4)
    library = Library(own.core, own)
    found: dict[str, list[Variant]] = {}
    nothing = Variant(own.core)
    for v in library.variants(nothing, blank(nothing)):
        found.setdefault(v.label, []).append(v)
    return library, found


def test_a_worn_range_has_its_angles_by_the_gear_ratio_at_the_other_wheel() -> None:
    library, found = variants()
    [ring], [pinions] = found["wear@table"], found["wear@pinions"]
    shared = len(blank(ring).theta) - len(ring.extra)
    worn = {"wear@table.depth": 2e-3, "wear@table.centre": 0.05, "wear@table.width": 0.3}
    numbers = np.linspace(0.1, 0.2, shared)
    known = Point(ring, np.r_[numbers, coordinates(ring.extra, worn)], (), 0.0, 0.0)
    own, beside, other = begins_beside(library.core, known, pinions, blank(pinions).theta)
    ratio = library.core.get("mesh_1.ratio")
    told = values(pinions.extra, other[shared:])
    assert told["wear@pinions.depth"] == pytest.approx(2e-3)
    assert told["wear@pinions.centre"] == pytest.approx(0.05 * ratio)
    assert told["wear@pinions.width"] == pytest.approx(0.3 * ratio)
    np.testing.assert_array_equal(other[:shared], numbers)
    np.testing.assert_array_equal(own, blank(pinions).theta)
    np.testing.assert_array_equal(beside[:shared], numbers)


def test_laws_of_waves_have_no_such_numbers() -> None:
    """An eccentric ring and an eccentric pinion turn at different rates."""
    library, found = variants()
    [ring], [pinions] = found["eccentricity@table"], found["eccentricity@pinions"]
    assert len(begins_beside(library.core, blank(ring), pinions, blank(pinions).theta)) == 2


def test_a_law_that_is_taken_for_itself_is_a_rival_at_the_other_wheel() -> None:
    _, found = variants()
    [ring], [pinions] = found["wear@table"], found["wear@pinions"]
    assert confused(ring, pinions)
    assert not confused(ring, found["eccentricity@pinions"][0]), "another law at another wheel"
    assert not confused(found["coulomb@table"][0], found["coulomb@motors"][0])


def test_orders_below_a_law_s_own_are_another_law_s() -> None:
    """A pitch error of order one is eccentricity, a tooth error of three a pitch error."""
    _, found = variants()
    for law, lowest in (("pitch_error@table", 2.0), ("transmission_error@pinions", 5.0)):
        name = "order" if law.startswith("pitch") else "teeth"
        orders = [x for v in found[law] for path, x in v.fixed.items() if path.endswith(name)]
        assert orders
        assert min(orders) >= lowest


@pytest.mark.parametrize("law", ["eccentricity@table", "encoder_eccentricity@table"])
def test_what_a_law_is_taken_for_begins_where_it_does_the_same(law: str) -> None:
    """From size nought it is as far away as no law, and a fit under that noise gets lost."""
    own, variant, true = variant_of(law)
    [other] = {"eccentricity@table", "encoder_eccentricity@table"} - {law}
    library, nothing = Library(own.core, own), Variant(own.core)
    blank = Point(nothing, true, tuple(np.zeros_like(r.measured) for r in own.records), 0.0, 0.0)
    rival = next(v for v in library.variants(nothing, blank) if v.label == other)
    noise = first_noise(own.core, own.records, 1e-3)

    def at(variant: Variant, theta: Array) -> Fitted:
        [found] = own.likelihoods(variant, [(theta, noise)])
        assert found is not None
        return Fitted(found[0], noise, inflation(found[0]), 0.0, found[1])

    known, without = at(variant, true), at(nothing, true[: own.shared])
    begun = in_its_place(library, own, known, rival)
    assert begun is not None
    np.testing.assert_array_equal(begun[: own.shared], true[: own.shared])
    least, most = known.point.minus_two_log, without.point.minus_two_log
    assert at(rival, begun).point.minus_two_log - least < 1e-3 * (most - least)

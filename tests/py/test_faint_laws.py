"""Laws that numbers alone nearly hide: what these leave is noise, as a whole, and a score tells."""

from __future__ import annotations

import pytest

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.diagnose.screening import scores
from dualdrive.diagnose.selection.base import refitted_base
from dualdrive.diagnose.selection.estimation import on_all_samples
from dualdrive.diagnose.selection.fitted import EFFORTS, Selection
from dualdrive.diagnose.selection.forward import Forward, Means
from dualdrive.diagnose.selection.parts import is_joint
from dualdrive.diagnose.selection.search import _Search, select
from dualdrive.innovations import inflation, slopes
from test_innovations import bench

SAMPLES = 4000


def found(**saturation: float) -> Selection:
    true = bench({"torque_constant_saturation@motors": saturation} if saturation else {})
    own = grey_box(Machine.load("bench"), true, SAMPLES, 3)
    return select(own.core, own, EFFORTS["quick"])


@pytest.mark.long
def test_a_law_is_found_where_numbers_alone_leave_noise() -> None:
    selection = found(loss=0.2)
    assert selection.quiet
    assert selection.best.variant.label == "torque_constant_saturation@motors"
    assert selection.base.criterion - selection.best.criterion > 25.0


@pytest.mark.long
def test_none_is_found_where_none_is() -> None:
    selection = found()
    assert selection.quiet
    assert [f.variant.label for f in selection.finals] == ["nothing"]


BRISTLES = {"torque": 0.3, "static_ratio": 1.4, "speed": 0.02, "stiffness": 2e3, "damping": 2.0}
LIMITS = {"current_limit@motors", "voltage_limit@motors"}
#: what bristles do is described a little by a command that is late
WORTH = LIMITS | {"lugre@table", "lugre@motors", "transport_delay@controller"}


@pytest.mark.parametrize(
    ("law", "worth"),
    [({}, LIMITS), ({"lugre@table": BRISTLES}, WORTH)],
    ids=["nothing", "bristles"],
)
def test_parts_that_are_hopeless_on_stretches_are_not_tried_on_all_samples(
    law: dict[str, dict[str, float]], worth: set[str]
) -> None:
    own = grey_box(Machine.load("bench"), bench(law), 17_000, 1)
    means = Means(own.core, own, EFFORTS["quick"], lambda _: None)
    base = refitted_base(means.estimator, own)
    assert base.grey.samples < own.samples
    search, everywhere = _Search(means, base), on_all_samples(own, base.there)
    search.on = Forward(means, own, [everywhere], base.grey)
    parts = [s for s in search._listed(everywhere) if not is_joint(s.variant)]
    assert {s.variant.label for s in search._worth_all_samples(parts)} == worth


def test_a_faint_law_is_told_on_stretches_where_the_machine_moves() -> None:
    """The record moves for 2.4 of its 17 s; all else is noise, of which some is always largest."""
    law = "torque_constant_saturation@motors"
    own = grey_box(Machine.load("bench"), bench({law: {"loss": 0.2}}), 17_000, 3)
    means = Means(own.core, own, EFFORTS["quick"], lambda _: None)
    base = refitted_base(means.estimator, own)
    assert base.everywhere is not None
    known = means.library.variants(base.everywhere.variant, base.everywhere.point)
    [saturated] = [v for v in known if v.label == law]
    gains = []
    for grey, there in ((own, base.everywhere), (base.grey, base.there)):
        columns = slopes(grey, there.point, range(len(there.point.theta)), there.gains)
        [scored] = scores(
            grey, there.point, columns, [saturated], there.gains,
            inflation(there.point), lambda done, of: None, faint=True,
        )  # fmt: skip
        gains.append(scored.gain)
    assert base.grey.samples < own.samples
    assert gains[1] > 0.9 * gains[0] > 20.0

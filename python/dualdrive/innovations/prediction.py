"""One record replayed by a machine, the state corrected at every sample."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.innovations.records import Predictable
from dualdrive.replay.record import with_settings

Array = NDArray[np.float64]

#: first samples of a stretch that the likelihood is conditioned on: the filter finds its state
#: (Harvey, Forecasting, Structural Time Series Models and the Kalman Filter, 3.4)
GIVEN = 50
LOST = 300.0  # whitened: what a replay that broke down is counted with


def predicted(
    core: Any,
    offsets: Mapping[str, float],
    record: Predictable,
    gains: Any,
    *,
    moved: Mapping[str, float] | None = None,
    **options: Any,
) -> Any:
    """What `_core.predict` finds of one record.

    Args:
        core: the machine, the record's own settings not yet in it.
        offsets: channel -> what its sensor adds.
        record: what was measured.
        gains: of `GreyBox.gains`.
        moved: state -> what is added to it at the first sample.
        options: of `_core.predict`.

    """
    there = with_settings(core, record.record.settings)
    initial = record.initial(there, offsets)
    for state, x in (moved or {}).items():
        initial[0][state] = initial[0].get(state, 0.0) + x
    return _core.predict(
        there,
        record.sampled,
        gains,
        initial=initial,
        offsets=[offsets.get(c, 0.0) for c in record.channels],
        **options,
    )


def sensitivities(
    core: Any,
    offsets: Mapping[str, float],
    record: Predictable,
    gains: Any,
    neighbours: Sequence[tuple[Any, Mapping[str, float]]],
    *,
    most_apart: float = 1.0,
) -> list[Array | None]:
    """How whitened innovations change, to first order, where others take a machine's place.

    Args:
        core: the machine, the record's own settings not yet in it.
        offsets: channel -> what its sensor adds.
        record: what was measured.
        gains: of `GreyBox.gains`.
        neighbours: (machine, offsets) of each.
        most_apart: share of the changes of modes that may come more than a sample apart.

    Returns:
        Of each, shape (n, channels); None where the first order can't tell.

    """

    def begun(
        own: Any, adds: Mapping[str, float]
    ) -> tuple[Any, list[dict[str, float]], list[float]]:
        there = with_settings(own, record.record.settings)
        return there, record.initial(there, adds), [adds.get(c, 0.0) for c in record.channels]

    there, initial, adds = begun(core, offsets)
    found: list[Array | None] = _core.sensitivities(
        there, record.sampled, gains, [begun(*x) for x in neighbours],
        initial=initial, offsets=adds, given=GIVEN, most_apart=most_apart,
    )  # fmt: skip
    return found


class Replayed(NamedTuple):
    """What a likelihood takes of a replay: whitened innovations, shape (n, channels)."""

    residuals: Array
    log_det: float
    lost: bool


def replayed(job: tuple[Any, Mapping[str, float], Predictable, Any, bool]) -> Replayed:
    """Replay (machine, offsets, record, gains, whether to learn them); a failure is `lost`."""
    core, offsets, record, gains, learn = job
    found = None
    if core is not None:
        with suppress(ValueError, RuntimeError):
            found = predicted(core, offsets, record, gains, given=GIVEN, learn=learn)
    if found is None:
        return Replayed(np.full(record.measured.shape, LOST), 0.0, True)
    residuals = np.clip(found["residuals"], -LOST, LOST)
    return Replayed(residuals, float(found["log_det"]), not found["finite"])

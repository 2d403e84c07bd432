"""Whether two drives answer alike: the speed loops of both, each measured on its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualdrive import _core
from dualdrive.assembly import core_of
from dualdrive.display import Displayed
from dualdrive.linear.contacts import Modes
from dualdrive.linear.errors import LinearError
from dualdrive.linear.frequency import frequency_response
from dualdrive.linear.response import FrequencyResponse
from dualdrive.machine import Machine

__all__ = ["DriveComparison", "compare_drives", "differ"]

Array = NDArray[np.float64]

_FLOOR_DB = -40.0  # where both answer less, a difference is of no consequence


@dataclass(frozen=True, eq=False)
class DriveComparison(Displayed, picture="drives"):
    """Two drives' responses and where they part.

    master, slave:   response of each, on the same frequencies
    difference_db:   slave minus master, shape (n,)
    difference_deg:  the same of the phase, -180 to 180, shape (n,)
    tolerance_db, tolerance_deg: what counts as alike
    counts:          frequencies that are judged: those where either answers, bool, shape (n,)
    """

    master: FrequencyResponse
    slave: FrequencyResponse
    difference_db: Array
    difference_deg: Array
    tolerance_db: float
    tolerance_deg: float
    counts: NDArray[np.bool_]

    @property
    def pair(self) -> tuple[FrequencyResponse, FrequencyResponse]:
        """Both responses, the master's first."""
        return self.master, self.slave

    @property
    def excess(self) -> Array:
        """Difference over tolerance, the larger of magnitude and phase; above 1 they differ."""
        parts = (
            np.abs(self.difference_db) / self.tolerance_db,
            np.abs(self.difference_deg) / self.tolerance_deg,
        )
        return np.where(self.counts, np.maximum(*parts), 0.0)

    @property
    def differ(self) -> bool:
        """Whether they part by more than the tolerance anywhere."""
        return bool((self.excess > 1).any())

    @property
    def frequency_hz(self) -> float | None:
        """Where they differ most; None where they don't differ."""
        return float(self.master.frequency_hz[self.excess.argmax()]) if self.differ else None

    @property
    def from_hz(self) -> float | None:
        """The lowest frequency at which they differ; None where they don't."""
        return float(self.master.frequency_hz[(self.excess > 1).argmax()]) if self.differ else None

    @property
    def text(self) -> str:
        """One line in words."""
        f = self.master.frequency_hz[self.counts]
        if not self.differ:
            return (
                f"the drives answer alike within {self.tolerance_db:g} dB and "
                f"{self.tolerance_deg:g} deg from {f[0]:.3g} Hz to {f[-1]:.3g} Hz"
            )
        k = int(self.excess.argmax())
        return (
            f"the drives differ from {self.from_hz:.3g} Hz on, most at {self.frequency_hz:.3g} Hz: "
            f"slave {self.difference_db[k]:+.2f} dB and {self.difference_deg[k]:+.1f} deg against "
            f"the master (allowed {self.tolerance_db:g} dB, {self.tolerance_deg:g} deg)"
        )

    def figures(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "differ": self.differ,
            "frequency_hz": self.frequency_hz,
            "from_hz": self.from_hz,
            "tolerance_db": self.tolerance_db,
            "tolerance_deg": self.tolerance_deg,
            "largest_db": float(np.abs(self.difference_db[self.counts]).max()),
            "largest_deg": float(np.abs(self.difference_deg[self.counts]).max()),
            "text": self.text,
        }


def compare_drives(
    machine: Machine | _core.Machine,
    frequencies_hz: ArrayLike | None = None,
    *,
    modes: Modes = None,
    other: str = "held",
    tolerance_db: float = 1.0,
    tolerance_deg: float = 5.0,
    state: Mapping[str, float] | None = None,
) -> DriveComparison:
    """Speed set-point to motor speed of each drive, position loop and equaliser open.

    other:  the other drive meanwhile: held by its speed loop, or open, without torque
    modes, frequencies_hz, state: as of `frequency_response`

    Raises LinearError for a machine that has not two drives with speed loops.
    """
    core = core_of(machine)
    if other not in ("held", "open"):
        raise LinearError(f"other = {other!r}: choose held or open")
    if len(core.motors) != 2 or core.controller_options["kind"] == "none":
        raise LinearError(
            f"{core.name or 'machine'}: comparing drives needs two motors under one controller; "
            f"it has {len(core.motors)} and controller {core.controller_options['kind']}"
        )
    found = []
    for own, idle in (("1", "2"), ("2", "1")):
        cut = ["position", "equaliser", *([f"speed_{idle}"] if other == "open" else [])]
        found.append(
            frequency_response(
                core, f"Omega_{own}*", f"omega_c{own}", frequencies_hz, modes=modes, cut=cut,
                state=state,
            )
        )  # fmt: skip
    return differ(*found, tolerance_db=tolerance_db, tolerance_deg=tolerance_deg)


def differ(
    master: FrequencyResponse,
    slave: FrequencyResponse,
    *,
    tolerance_db: float = 1.0,
    tolerance_deg: float = 5.0,
) -> DriveComparison:
    """Hold two responses, computed or measured, against each other where both are known.

    Raises LinearError where they share no frequency or a tolerance is not positive.
    """
    if not (tolerance_db > 0 and tolerance_deg > 0):
        raise LinearError(f"tolerances {tolerance_db:g} dB, {tolerance_deg:g} deg: need > 0")
    low = max(master.frequency_hz[0], slave.frequency_hz[0])
    high = min(master.frequency_hz[-1], slave.frequency_hz[-1])
    f = np.union1d(master.frequency_hz, slave.frequency_hz)
    f = f[(f >= low) & (f <= high)]
    if not f.size:
        raise LinearError(
            f"master known from {master.frequency_hz[0]:g} Hz to {master.frequency_hz[-1]:g} Hz, "
            f"slave from {slave.frequency_hz[0]:g} Hz to {slave.frequency_hz[-1]:g} Hz: no overlap"
        )
    one, two = (_on(response, f) for response in (master, slave))
    ratio = two.response / one.response
    counts = np.maximum(one.magnitude_db, two.magnitude_db) > _FLOOR_DB
    if not counts.any():
        raise LinearError(f"neither drive answers above {_FLOOR_DB:g} dB: nothing to compare")
    return DriveComparison(
        master=one,
        slave=two,
        difference_db=20 * np.log10(np.abs(ratio)),
        difference_deg=np.degrees(np.angle(ratio)),
        tolerance_db=tolerance_db,
        tolerance_deg=tolerance_deg,
        counts=counts,
    )


def _on(response: FrequencyResponse, f: Array) -> FrequencyResponse:
    """The response on other frequencies within its range."""
    if np.array_equal(f, response.frequency_hz):
        return response
    return replace(
        response, frequency_hz=f, response=response.at(f), coherence=None, distortion=None
    )

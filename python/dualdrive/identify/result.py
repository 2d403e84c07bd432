"""What a torque balance found, for people (:meth:`BalanceFit.table`) and for programs."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.identify.model import BalanceModel, CoreModel
from dualdrive.identify.trail import Offset
from dualdrive.plain import plain

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """One fitted number with its interval; ``share`` is its part of the RMS measured torque.

    ``verdict`` is ``identified``, ``prior`` (the data adds next to nothing to the tolerance given)
    or ``not identified``; ``reason`` says why, in words, for the last two.
    """

    path: str
    value: float
    low: float
    high: float
    unit: str
    nominal: float
    share: float
    verdict: str
    reason: str

    def line(self, width: int = 28, of: str = "torque") -> str:
        """For a table; a second line says why where the number is not identified.

        of: what it is a share of, force on an axis that slides
        """
        interval = f"[{self.low:.6g} .. {self.high:.6g}]"
        text = (
            f"{self.path:<{width}} {self.value:>12.6g} {interval:<28} {self.unit:<14} "
            f"nominal {self.nominal:<10.6g} {self.share:>6.1%} of {of}"
        )
        return text if self.verdict == "identified" else f"{text}\n    {self.reason}"


@dataclass(frozen=True)
class Error:
    """What is left of one equation, over the fitted samples.

    ``relative`` is RMS residual over RMS of the mean-free measured torque, the product's measure of
    error; ``force`` is RMS residual over RMS measured torque, mean included, as published for
    the EMPS benchmark. Both ``nan`` for an equation without a measured torque.
    """

    relative: float
    force: float
    rms: float


@dataclass(frozen=True)
class Samples:
    """Rows of one equation: decimated, near standstill, fitted."""

    total: int
    standstill: int
    fitted: int


@dataclass(frozen=True)
class Residual:
    """One equation of one record on the decimated grid; ``fitted`` flags the samples that count."""

    t: Array
    residual: Array
    measured: Array
    fitted: NDArray[np.bool_]


@dataclass(frozen=True)
class BalanceFit:
    """A machine fitted through its torque balance.

    ``parameters`` by path and ``offsets`` by (record, equation), as :class:`Estimate`; ``errors``
    and ``nominal_errors`` by equation; ``residuals`` by (record, equation); ``effective`` number of
    samples after coloured residuals are accounted for; ``condition`` of the information matrix'
    root with columns scaled alike; ``model`` holds the fitted values; ``warnings`` say what is
    wrong with the records themselves, ``notes`` what they can't tell.
    """

    parameters: dict[str, Estimate]
    offsets: dict[Offset, Estimate]
    errors: dict[str, Error]
    nominal_errors: dict[str, Error]
    samples: dict[str, Samples]
    residuals: dict[Offset, Residual]
    effective: float
    condition: float
    processing: str
    treatment: str
    confidence: float
    model: BalanceModel
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def error(self) -> float:
        """Relative error, averaged over the equations with a measured torque."""
        return _average(self.errors, "relative")

    @property
    def force_error(self) -> float:
        """Force error (see :class:`Error`), averaged over the equations."""
        return _average(self.errors, "force")

    @property
    def unidentified(self) -> list[Estimate]:
        """Parameters that these records do not determine."""
        return [e for e in self.parameters.values() if e.verdict != "identified"]

    def sample_lines(self) -> list[str]:
        """One line per equation: samples that count, and what became of those at standstill."""
        done = {"mask": "masked", "bound": "bounded by friction limits", "keep": "kept"}
        return [
            f"{name}: {count.fitted} of {count.total} samples count, {count.standstill} near "
            f"standstill {done[self.treatment]}"
            for name, count in self.samples.items()
        ]

    def _repr_html_(self) -> str:
        import dualdrive  # its lazy name: how a notebook shows things knows of results

        return dualdrive.notebook.fit(self)

    def table(self) -> str:
        """Everything above as lines of text."""
        lines = [f"warning: {warning}" for warning in self.warnings]
        lines.append(f"torque balance: {self.processing}")
        lines += self.sample_lines()
        for name, error in self.errors.items():
            before = self.nominal_errors[name]
            lines.append(
                f"{name}: error {error.relative:.2%} of mean-free RMS (nominal "
                f"{before.relative:.2%}), {error.force:.2%} of RMS force (nominal "
                f"{before.force:.2%})"
            )
        lines.append(f"{self.confidence:.0%} intervals from {self.effective:.0f} effective samples")
        estimates = [*self.parameters.values(), *self.offsets.values()]
        width = max([28, *(len(estimate.path) for estimate in estimates)])
        slides = isinstance(self.model, CoreModel) and all(
            self.model.torque_unit(name) == "N" for name in self.errors
        )
        of = "force" if slides else "torque"
        lines += [estimate.line(width, of) for estimate in estimates]
        lines.append(f"condition number {self.condition:.3g}")
        lines += self.notes
        return "\n".join(lines)

    def figures(self) -> dict[str, Any]:
        """The same as plain JSON values; ``None`` where a number is not finite."""
        own = {
            "parameters": {path: vars(e) for path, e in self.parameters.items()},
            "offsets": {f"{e.path}": vars(e) for e in self.offsets.values()},
            "error": {
                "nominal": _average(self.nominal_errors, "relative"),
                "refitted": self.error,
            },
            "force_error": {
                "nominal": _average(self.nominal_errors, "force"),
                "refitted": self.force_error,
            },
            "errors": {name: vars(e) for name, e in self.errors.items()},
            "samples": {name: vars(s) for name, s in self.samples.items()},
            "standstill": self.treatment,
            "effective_samples": self.effective,
            "condition": self.condition,
            "processing": self.processing,
            "confidence": self.confidence,
            "warnings": list(self.warnings),
            "notes": list(self.notes),
        }
        return dict(plain(own))

    def to_json(self) -> str:
        """:meth:`figures` as JSON text."""
        return json.dumps(self.figures(), indent=2)


def _average(errors: dict[str, Error], which: str) -> float:
    found = [getattr(e, which) for e in errors.values() if math.isfinite(getattr(e, which))]
    return float(np.mean(found)) if found else math.nan

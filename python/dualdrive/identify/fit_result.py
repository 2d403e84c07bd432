"""What a closed-loop fit found, for people (`Fit.table`) and for programs (`Fit.figures`)."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.identify.evaluation import Evaluation
from dualdrive.plain import plain

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Fitted:
    """One fitted number in SI with its interval.

    verdict: ``identified``; ``prior`` where the data narrows the tolerance by less than a fifth;
        ``not identified`` where it moves along a direction the data does not see
    """

    path: str
    value: float
    low: float
    high: float
    unit: str
    nominal: float
    tolerance: float
    verdict: str
    bound: str

    def cells(self) -> tuple[str, ...]:
        """For a table: path, value, interval, unit, nominal, prior, remarks."""
        prior = f"±{self.tolerance:.0%}" if math.isfinite(self.tolerance) else "none"
        remarks = [self.verdict] if self.verdict != "identified" else []
        remarks += [self.bound] if self.bound else []
        interval = f"{self.low:.5g} .. {self.high:.5g}"
        return (
            self.path,
            f"{self.value:.6g}",
            interval,
            self.unit,
            f"{self.nominal:.6g}",
            prior,
            "; ".join(remarks),
        )


@dataclass(frozen=True)
class Direction:
    """A combination of unknowns that the records barely determine: unknown -> share, -1 .. 1."""

    singular: float
    shares: Mapping[str, float]

    def text(self) -> str:
        """The combination in one line, largest shares first."""
        ranked = sorted(self.shares.items(), key=lambda item: -abs(item[1]))
        return ", ".join(f"{name} {share:+.2f}" for name, share in ranked)


@dataclass(frozen=True, eq=False)
class Fit:
    """A machine fitted through its closed loop.

    machine:     with the fitted values
    parameters:  path -> :class:`Fitted`
    fitted:      errors, sensor constants, initial states and replays at the fitted values
    nominal:     the same at the values the fit began with; None where those do not simulate
    directions:  what the records barely determine, weakest first
    covariance:  of `unknowns` in their own coordinates (logarithm or scaled)
    effective:   effective number of samples behind the intervals
    failures:    simulations that failed on the way, in words
    """

    machine: Any
    parameters: Mapping[str, Fitted]
    fitted: Evaluation
    nominal: Evaluation | None
    directions: Sequence[Direction]
    effective: float
    condition: float
    confidence: float
    covariance: Array
    unknowns: Sequence[str]
    status: str
    message: str
    failures: Sequence[str]
    simulations: int

    @property
    def error(self) -> dict[str, float]:
        """Headline error, ``nominal`` and ``refitted``."""
        before = self.nominal.error if self.nominal else math.nan
        return {"nominal": before, "refitted": self.fitted.error}

    @property
    def ok(self) -> bool:
        """Whether the fit converged."""
        return self.status == "success"

    def _repr_html_(self) -> str:
        import dualdrive  # its lazy name: how a notebook shows things knows of results

        return dualdrive.notebook.fit(self)

    def table(self) -> str:
        """Everything above as lines of text."""
        head = (
            "parameter",
            "value",
            f"{self.confidence:.0%} interval",
            "unit",
            "nominal",
            "prior",
            "",
        )
        lines = _columns([head, *(p.cells() for p in self.parameters.values())])
        lines.append("")
        rows = [("channel", "nominal", "fitted")]
        before = self.nominal.errors if self.nominal else {}
        for name, error in self.fitted.errors.items():
            rows.append((name, f"{before.get(name, math.nan):.2%}", f"{error:.2%}"))
        rows.append(("headline", f"{self.error['nominal']:.2%}", f"{self.error['refitted']:.2%}"))
        lines += _columns(rows)
        for (record, channel), value in self.fitted.offsets.items():
            if not channel.startswith("theta_"):
                lines.append(
                    f"{record}: {channel} reads {value:+.4g} {self._unit(channel)} too much"
                )
        for weak in self.directions:
            lines.append(f"barely determined ({weak.singular:.1e}): {weak.text()}")
        lines.append(
            f"intervals from {self.effective:.0f} effective samples: widened for residuals that "
            "are alike over time"
        )
        if self.failures:
            lines.append(
                f"{len(self.failures)} simulations failed on the way, e.g. {self.failures[-1]}"
            )
        end = f"{self.status}: {self.simulations} simulations"
        lines.append(f"{end}: {self.message}" if self.message else end)
        return "\n".join(lines)

    def _unit(self, channel: str) -> str:
        unit = next(
            c.unit for r in self.fitted.replays for c in r.record.channels if c.name == channel
        )
        return (
            str(self.machine.unit_of(channel, unit)) if hasattr(self.machine, "unit_of") else unit
        )

    def figures(self) -> dict[str, Any]:
        """The same as plain JSON values; ``None`` where a number is not finite."""
        own = {
            "status": self.status,
            "message": self.message,
            "error": self.error,
            "errors": dict(self.fitted.errors),
            "nominal_errors": dict(self.nominal.errors) if self.nominal else {},
            "parameters": {path: dict(vars(p)) for path, p in self.parameters.items()},
            "offsets": {f"{r}/{c}": v for (r, c), v in self.fitted.offsets.items()},
            "initial": {f"{r}/{s}": v for (r, s), v in self.fitted.initial.items()},
            "directions": [
                {"singular": d.singular, "shares": dict(d.shares)} for d in self.directions
            ],
            "effective_samples": self.effective,
            "condition": self.condition,
            "confidence": self.confidence,
            "simulations": self.simulations,
            "failures": list(self.failures),
        }
        return dict(plain(own))

    def to_json(self) -> str:
        """:meth:`figures` as JSON text."""
        return json.dumps(self.figures(), indent=2)


def _columns(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return [
        "  ".join(f"{cell:<{w}}" for cell, w in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]

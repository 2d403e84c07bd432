"""Add a candidate of a diagnosis to the machine and refit everything, told of as it goes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from dualdrive.diagnose import Diagnosis
from dualdrive.identify import BalanceFit, FitError, Progress, fit
from dualdrive.traces import Trace

__all__ = ["added"]

_MOST = 1000  # simulations of a refit, as `fit` takes them by itself


def added(
    diagnosis: Diagnosis,
    label: str,
    traces: Mapping[str, Trace],
    *,
    progress: Callable[..., None] | None = None,
) -> Any:
    """The refitted machine of a diagnosis with one of its candidates, fitted to the traces.

    Where the fit does not converge the candidate keeps the numbers that the diagnosis has found,
    and the machine's history says so.

    Args:
        diagnosis: what was found.
        label: of the candidate, such as ``coulomb@table``.
        traces: name -> trace, what is fitted.
        progress: told in words, with ``best`` (misfit over that at the beginning).

    Raises:
        ValueError: no such candidate.
        FitError: the fit fails, and the diagnosis has no numbers for the candidate.

    """
    candidate = next((c for c in diagnosis.candidates if c.label == label), None)
    if candidate is None:
        known = ", ".join(c.label for c in diagnosis.candidates)
        raise ValueError(f"{label}: no candidate of this diagnosis; there are {known}")
    machine = diagnosis.refitted.copy()
    for effect, place in candidate.effects:
        machine.add(effect, place)
    for path, number in candidate.parameters.items():
        machine.set(path, number.value)
    first: list[float] = []

    def tell(now: Progress) -> None:
        first.append(now.best)
        if progress is not None:
            words = f"refitting with {label}: simulation {now.simulations} (at most {_MOST})"
            progress(words, best=now.best / first[0] if first[0] > 0 else 1.0)

    try:
        found: Any = fit(machine, traces, mode=diagnosis.mode, max_simulations=_MOST, progress=tell)
    except (FitError, ValueError) as failure:
        if not candidate.resolved:
            raise
        machine.note(f"{failure}; its numbers are those that the diagnosis found")
        return machine
    held: Any = found.model if isinstance(found, BalanceFit) else found
    return held.machine

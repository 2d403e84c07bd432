"""Which missing effect would explain what a fitted machine leaves: a score, without refitting.

Every candidate is put into the machine at zero strength, where it changes nothing, and one run with
sensitivities tells how the channels would move if it had any. What the nominal parameters, sensor
constants and initial states could imitate is projected out, within their priors; what is left of
the candidate's signature is regressed on what is left of the residual. The score is a shortlist:
once an effect changes which flanks carry, its derivative at zero is no longer the whole story, and
a refit decides.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.distributed import mapper_for
from dualdrive.identify.candidates import Probe, candidates_of, put_in
from dualdrive.identify.closed_loop import Problem, channels_to_fit
from dualdrive.identify.evaluation import state_unknowns
from dualdrive.identify.unknowns import default_free, unknowns
from dualdrive.mapper import Mapper, mapped
from dualdrive.replay import RTOL, Record, core_of, named, records
from dualdrive.traces import Trace

if TYPE_CHECKING:
    from distributed import Client

Array = NDArray[np.float64]

_TWIN = 1.0 - 1e-6  # squared cosine above which two signatures are one
_EARNED = 0.1  # of the residual: what a second unknown must explain beyond the first


@dataclass(frozen=True)
class Candidate:
    """An effect at a place and how much of the weighted residual it could explain, 0 .. 1.

    expected: parameter path -> strength it would have, SI, as far as the score can tell
    same_as:  label of an earlier candidate with the same signature, which this machine and record
        can't tell from it (friction at a motor and at its pinion, rigidly joined); "" if none
    """

    effect: str
    place: str
    explained: float
    expected: Mapping[str, float]
    unit: str
    same_as: str = ""

    @property
    def label(self) -> str:
        """``coulomb@table``."""
        return f"{self.effect}@{self.place}"


def screen(
    machine: Any,
    traces: Trace | Sequence[Trace] | Mapping[str, Trace],
    candidates: Iterable[tuple[str, str]] | None = None,
    *,
    motion: Any = None,
    interpolation: str = "auto",
    start: str = "auto",
    rtol: float = RTOL,
    scheduler: str | Client | None = None,
) -> list[Candidate]:
    """Score candidate effects on traces, best first. The machine should be refitted before.

    Args:
        machine: a machine with a controller, fitted to the traces as far as it goes.
        traces: one trace, several, or name -> trace.
        candidates: pairs of effect and place; every usual one unless given.
        motion: as for :func:`dualdrive.identify.fit`, as are
        interpolation: how recorded inputs are read,
        start: how the machine stood before the record, and
        rtol: local tolerance of the simulation, and
        scheduler: whose workers take a record each, and a delay each.

    Raises:
        ValueError: unknown effect or place, or a trace that can't be played.
        FitError: the machine does not simulate.
        SchedulerError: nobody answers at the scheduler, or its workers can't do the work.

    """
    core = core_of(machine)
    played = records(
        machine, named(traces), motion=motion, interpolation=interpolation, start=start
    )
    wanted = list(candidates_of(core) if candidates is None else candidates)
    probed = core.copy()
    probes = [probe for pair in wanted for probe in put_in(probed, *pair, played)]
    wanted = [pair for pair in wanted if pair in {(p.effect, p.place) for p in probes}]
    with mapper_for(scheduler) as mapper:
        seen = _observed(core, probed, played, probes, mapper, rtol)
    rest = _Projection(seen.others, seen.sigma)
    residual = rest.remove(seen.left)
    scored: list[tuple[Candidate, Array]] = []
    for effect, place in wanted:
        own = [p for p in probes if (p.effect, p.place) == (effect, place)]
        columns = np.stack([rest.remove(seen.signatures[p.key]) for p in own], axis=1)
        explained, strengths = _regress(columns, residual)
        expected = {p.path: p.expected(float(s)) for p, s in zip(own, strengths, strict=True)}
        found = Candidate(effect, place, explained, expected, own[0].unknown.unit)
        scored.append((found, columns))
    return _name_twins(sorted(scored, key=_worth, reverse=True))


def _worth(item: tuple[Candidate, Array]) -> float:
    """Over a small arc friction that varies with the angle explains what plain friction does."""
    candidate, columns = item
    return float(candidate.explained - _EARNED * (columns.shape[1] - 1))


@dataclass(frozen=True, eq=False)
class _Observed:
    """Weighted residual (n,), what every probe does to it, and what other unknowns do (n, m).

    sigma: how far those may move, shape (m,)
    """

    left: Array
    signatures: Mapping[str, Array]
    others: Array
    sigma: Array


def _observed(
    core: Any,
    probed: Any,
    played: Sequence[Record],
    probes: Sequence[Probe],
    mapper: Mapper,
    rtol: float,
) -> _Observed:
    nominal = unknowns(core, default_free(core), None, {})
    smooth = [p for p in probes if not p.apart]
    problem = Problem(
        probed,
        played,
        [*nominal, *(p.unknown for p in smooth)],
        state_unknowns(core, played),
        channels=channels_to_fit(played, None),
        rtol=rtol,
        mapper=mapper,
    )
    at = problem.start
    problem.reweigh(at)
    replays = problem.replays(at)
    assert replays is not None  # reweigh has simulated them
    left = _stack(problem, problem.unweighted(replays, at))
    slopes = _stack(problem, problem.slopes(at))
    split = range(len(nominal), len(nominal) + len(smooth))
    signatures = {p.key: slopes[:, len(nominal) + k] for k, p in enumerate(smooth)}
    apart = [p for p in probes if p.apart]
    jobs = [(mapper.keep(problem), p, at, left) for p in apart]
    for p, signature in zip(apart, mapped(mapper, _made_apart, jobs), strict=True):
        signatures[p.key] = signature
    others, sigma = np.delete(slopes, split, axis=1), np.delete(problem.prior.sigma, split)
    return _Observed(left, signatures, others, sigma)


def _stack(problem: Problem, own: Mapping[tuple[int, str], Array]) -> Array:
    return np.concatenate([problem.weights[row] * own[row] for row in problem.rows])


def _made_apart(problem: Problem, probe: Probe, at: Array, left: Array) -> Array:
    """Signature of what is probed at a size: the difference it makes there."""
    core = problem.core.copy()
    if _core.effect_type(probe.effect).structural:
        core.add_effect(probe.effect, probe.place)
    core.set(probe.path, probe.size)
    late = Problem(
        core,
        problem.records,
        problem.parameters,
        problem.states,
        channels=sorted({name for _, name in problem.rows}),
        rtol=problem.rtol,
    )
    late.weights = problem.weights
    replays = late.replays(at)
    if replays is None:
        return np.zeros(len(left))
    moved: Array = _stack(problem, late.unweighted(replays, at)) - left
    return moved


class _Projection:
    """Takes out what other unknowns could imitate, within their priors (ridge regression)."""

    def __init__(self, columns: Array, sigma: Array) -> None:
        size = np.linalg.norm(columns, axis=0)
        self._rows = columns[:, size > 0]
        believed = np.where(np.isfinite(sigma), 1.0 / sigma, 0.0)[size > 0]
        normal = self._rows.T @ self._rows + np.diag(believed**2)
        self._inverse = np.linalg.pinv(normal, rcond=1e-12, hermitian=True)

    def remove(self, values: Array) -> Array:
        result: Array = values - self._rows @ (self._inverse @ (self._rows.T @ values))
        return result


def _name_twins(scored: Sequence[tuple[Candidate, Array]]) -> list[Candidate]:
    """Candidates in order, each told which earlier one spans the same signature."""
    found: list[Candidate] = []
    spans: list[tuple[str, Array]] = []
    for candidate, columns in scored:
        own, size = np.linalg.qr(columns)[0], columns.shape[1]
        same = ""
        if np.any(columns):
            for label, other in spans:
                if other.shape[1] == size and np.linalg.norm(own.T @ other) ** 2 > size * _TWIN:
                    same = label
                    break
            else:
                spans.append((candidate.label, own))
        found.append(replace(candidate, same_as=same))
    return found


def _regress(columns: Array, residual: Array) -> tuple[float, Array]:
    """Share of the residual's square that the columns explain, and their strengths."""
    if not np.any(columns):
        return 0.0, np.zeros(columns.shape[1])
    strengths: Array = np.linalg.lstsq(columns, -residual, rcond=1e-10)[0].astype(np.float64)
    after = residual + columns @ strengths
    total = float(residual @ residual)
    return max(0.0, 1.0 - float(after @ after) / total) if total > 0 else 0.0, strengths

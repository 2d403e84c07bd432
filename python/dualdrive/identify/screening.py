"""Which missing effect would explain what a fitted machine leaves: a score, without refitting.

Every candidate is put into the machine at zero strength, where it changes nothing, and one run with
sensitivities tells how the channels would move if it had any. What the nominal parameters, sensor
constants and initial states could imitate is projected out, within their priors; what is left of
the candidate's signature is regressed on what is left of the residual. The score is a shortlist:
once an effect changes which flanks carry, its derivative at zero is no longer the whole story, and
a refit decides.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.distributed import mapper_for
from dualdrive.identify.closed_loop import Problem, channels_to_fit
from dualdrive.identify.evaluation import state_unknowns
from dualdrive.identify.parts import sizes_of_part
from dualdrive.identify.unknowns import Unknown, default_free, unknowns
from dualdrive.mapper import Mapper, mapped
from dualdrive.replay import RTOL, Record, core_of, named, records
from dualdrive.traces import Trace

if TYPE_CHECKING:
    from distributed import Client

Array = NDArray[np.float64]

#: laws that take the place of a simpler one already scored: no signature of their own at zero
_WHOLE_LAWS = ("stribeck", "lugre")
_TWIN = 1.0 - 1e-6  # squared cosine above which two signatures are one
_EARNED = 0.1  # of the residual: what a second unknown must explain beyond the first
_DELAY_PROBE = 2e-3  # s: a delay is part of the structure, so it is probed at a size, not at zero
_SOFTER = 0.1  # of its nearly rigid stiffness: where a joint that gives is probed


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


def candidates_of(core: _core.Machine) -> list[tuple[str, str]]:
    """Every effect at every usual place this machine has and does not carry it at yet."""
    there = {(e["effect"], e["place"]) for e in core.effects}
    whole = _stands(core)
    found = []
    for kind in _core.effect_types():
        if kind.name in _WHOLE_LAWS:
            continue
        for place in kind.places.split(","):
            if (kind.name, place) in there:
                continue
            trial = core.copy()
            try:
                label = trial.add_effect(kind.name, place)
                trial.signals()  # compiles the machine, which knows the rest of the rules
            except ValueError:
                continue  # no such part here, or none that the effect can act on
            if kind.structural and _is_on(core, trial, label):
                continue  # a limit or lag that the machine has, whatever it is called
            if whole and not _stands(trial):
                continue  # a joint without inertia on one side
            found.append((kind.name, place))
    return found


def _stands(core: _core.Machine) -> bool:
    """Whether the machine's laws can be evaluated without any inputs."""
    try:
        _core.linearise(core)
    except ValueError:
        return False
    return True


def _is_on(core: _core.Machine, trial: _core.Machine, label: str) -> bool:
    """Whether the part that a structural effect names works in this machine already."""
    members = trial.members(
        f"{label}.{_core.effect_type(label.partition('@')[0]).parameters[0].path}"
    )
    joint = members[0].rpartition(".")[0]
    if joint in core.connections:
        return core.kind(joint) != "rigid"
    return any(core.get(path) != core.parameter(path).standard for path in members)


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
    probes = [probe for pair in wanted for probe in _put_in(probed, *pair, played)]
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
    probes: Sequence[_Probe],
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


@dataclass(frozen=True)
class _Probe:
    """One strength of a candidate: a second one where a phase is unknown, a quarter turn later.

    size:  where it is probed in a machine of its own, for what is off at zero altogether (a delay)
           or changes the machine (a joint that gives); 0 where the slope at zero tells
    """

    effect: str
    place: str
    path: str
    unknown: Unknown
    size: float = 0.0

    @property
    def key(self) -> str:
        return self.path

    @property
    def apart(self) -> bool:
        """Whether it takes a machine of its own."""
        return self.size > 0.0

    def expected(self, strength: float) -> float:
        """The number it would have, SI, from the strength that the residual asks for."""
        if not self.apart:
            return strength * self.unknown.scale
        if self.path.endswith(".stiffness"):  # what bends is its inverse
            return self.size / strength if strength > 0 else math.inf
        if self.path.endswith((".T_max", ".U_max")):
            return self.size  # a limit is met or not; nothing grows with it
        return strength * self.size


def _put_in(core: _core.Machine, effect: str, place: str, played: Sequence[Record]) -> list[_Probe]:
    kind = _core.effect_type(effect)
    if kind.structural:
        return _part_probe(core, kind, place, played)
    names = [p.path for p in kind.parameters]
    size = _DELAY_PROBE if "delay" in kind.acts_on else 0.0
    probes = []
    for phase in (0.0, 0.5 * math.pi) if "phase" in names else (0.0,):
        label = core.add_effect(effect, place)
        if "phase" in names:
            core.set(f"{label}.phase", phase)
        strength = kind.parameters[0]
        path = f"{label}.{names[0]}"
        free = Unknown(
            path,
            strength.unit,
            0.0,
            -math.inf,
            math.inf,
            strength.typical,
            False,
            0.0,
            0.0,
            math.inf,
        )
        probes.append(_Probe(effect, place, path, free, size))
    return probes


def _part_probe(
    core: _core.Machine, kind: _core.EffectType, place: str, played: Sequence[Record]
) -> list[_Probe]:
    """How a part of the machine is probed; not at all where no record says what a limit limits."""
    trial = core.copy()
    label = trial.add_effect(kind.name, place)
    (effect,) = (e for e in trial.effects if e["label"] == label)
    name, declared = kind.parameters[0].path, kind.parameters[0]
    path = f"{label}.{name}"
    if name == "stiffness":
        size = _SOFTER * trial.get(path)
    elif math.isinf(declared.standard):
        size = sizes_of_part(trial, effect, played).get(path, 0.0)
    else:
        size = declared.typical if declared.unit != "s" else _DELAY_PROBE
        size = sizes_of_part(trial, effect, played).get(path, size)
    if not size > 0.0:
        return []
    free = Unknown(path, declared.unit, 0.0, -math.inf, math.inf, size, False, 0.0, 0.0, math.inf)
    return [_Probe(kind.name, place, path, free, size)]


def _stack(problem: Problem, own: Mapping[tuple[int, str], Array]) -> Array:
    return np.concatenate([problem.weights[row] * own[row] for row in problem.rows])


def _made_apart(problem: Problem, probe: _Probe, at: Array, left: Array) -> Array:
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

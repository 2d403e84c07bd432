"""Diagnosis by torque balance: recorded motion and torque alone, whatever made them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from dualdrive.diagnose.axis import candidate_on, numbers_on, shape_on
from dualdrive.diagnose.balance_findings import (
    candidate_of,
    equation_at,
    errors_of,
    errors_of_the_refitted,
    groups_of,
    machine_of,
    plan_next,
    scores_of,
)
from dualdrive.diagnose.decision import beside_the_data_sheet, objection
from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.diagnose.findings import TOLD, command_for, moved_numbers, screened
from dualdrive.diagnose.heldout import intervals
from dualdrive.diagnose.judge import Judgement, judge
from dualdrive.diagnose.laws import clips
from dualdrive.diagnose.paragraph import paragraph
from dualdrive.diagnose.printed import Printed
from dualdrive.diagnose.result import Diagnosis
from dualdrive.diagnose.search import search
from dualdrive.diagnose.shape import of_the_balance, shapes
from dualdrive.diagnose.survey import Survey
from dualdrive.diagnose.work import Clock, Work
from dualdrive.replay import core_of


def diagnose_torque_balance(
    machine: Any,
    c: TorqueBalance,
    printed: Printed,
    warnings: Sequence[str],
    work: Work,
    clipped: bool,
    experiment: bool,
) -> Diagnosis:
    """Diagnose records whose torque balance is evaluated; see :func:`dualdrive.diagnose.diagnose`.

    Args:
        machine: as it came.
        c: its equations of motion on the records.
        printed: the errors that are printed.
        warnings: what was said of the records.
        work: clock, threads and listener.
        clipped: whether a channel stands at an extreme, which a limit alone may explain.
        experiment: whether to plan the next one where the answer is ambiguous.

    """
    result = search(c, work)
    finished = not (work.clock.cut or work.clock.stop())
    verdict = judge(result)
    if clipped and verdict.ranked and verdict.verdict in ("effect", "ambiguous"):
        [(effect, _), *_] = verdict.ranked[0][0].hypothesis.effects
        if not clips(effect):
            verdict = replace(verdict, verdict="unknown", group=(), why="clipped")
    if not finished:
        verdict = replace(verdict, verdict="unfinished", group=())
    return _told(machine, c, result, verdict, printed, warnings, work.clock, experiment, work.told)


def _told(
    machine: Any,
    c: TorqueBalance,
    found: Survey,
    verdict: Judgement,
    printed: Printed,
    warnings: Sequence[str],
    clock: Clock,
    experiment: bool,
    tell: Callable[[str], None],
) -> Diagnosis:
    tell("errors of the torque balance")
    # who stopped a search waits: of what it found the leader's error is told, and no comparison
    stopped = verdict.verdict == "unfinished"
    leaders = verdict.ranked[: 1 if stopped else TOLD]
    candidates = [candidate_of(machine, c, found, r, p, printed) for r, p in leaders]
    candidates = [candidate_on(machine, one) for one in candidates]
    candidates += screened(scores_of(found), candidates)
    groups = groups_of(found, verdict)
    named_ = verdict.verdict in ("effect", "ambiguous")
    # where nothing is missing what is left is noise, and the final refit under it is the best
    stands = found.base if verdict.verdict in ("adequate", "parameters") else found.plain
    refitted = machine_of(machine, c, stands)
    best = verdict.ranked[0][0] if verdict.ranked else found.base
    improved = machine_of(machine, c, best) if named_ else None
    before = None if stopped else printed.compared(refitted)
    after = printed.compared(improved) if improved is not None else None
    if before is None:
        error = errors_of_the_refitted(c, found, printed.error(refitted))
    else:
        error = errors_of(c, found, best if named_ else found.plain, before, after)
    error["nominal"] = printed.error(machine)
    verdict = replace(verdict, verdict=beside_the_data_sheet(verdict.verdict, error))
    if why := objection(verdict.verdict, error):
        verdict = replace(verdict, verdict="unknown", group=(), why="contradicted")
        warnings = [*warnings, f"no verdict but unknown can stand: {why}"]
        groups, named_, improved, after = [], False, None, None
    every = intervals(found.evidence, best if named_ else stands, found.inflation)
    known = numbers_on(machine, {p.path: every[p.path] for p in c.nominal})
    tell("the shape of what is missing")
    equation = equation_at(verdict, candidates, refitted, printed.traces, clock)
    curves = []
    if clock.allows("which variable the missing torque depends on"):
        courses = of_the_balance(
            core_of(refitted), printed.traces, printed.settings, printed.processing
        )
        curves = [shape_on(machine, s) for s in shapes(courses)]
    plan = None
    if experiment and verdict.verdict == "ambiguous" and clock.allows("the next experiment"):
        tell("planning the next experiment")
        plan = plan_next(machine, c, found, verdict, clock, tell)
    told = Diagnosis(
        machine=core_of(machine).name,
        mode="balance",
        records=tuple(printed.traces),
        verdict=verdict.verdict,
        candidates=candidates,
        groups=groups,
        equation=equation,
        where=before.where if before is not None else (),
        error=error,
        shapes=curves,
        next_experiment=plan,
        warnings=list(warnings),
        cut=list(clock.cut),
        command=command_for(candidates[0].effects, candidates[0].parameters) if named_ else "",
        seconds=clock.used,
        refitted=refitted,
        improved=improved,
        before=before,
        after=after,
        moved=moved_numbers(c.nominal, known),
        numbers=known,
        over_floor=verdict.excess[1],
    )
    return replace(told, paragraph=paragraph(told, verdict.why))

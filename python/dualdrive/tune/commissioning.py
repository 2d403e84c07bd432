"""tune(machine) -> Tuning: steps (1) to (8) of section 3.3 of the paper, one after the other."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from dualdrive.linear import DriveComparison
from dualdrive.linear.operating_point import operating_point
from dualdrive.machine import Machine
from dualdrive.motion import Motion
from dualdrive.tune.assess import assess, usual_motion
from dualdrive.tune.coupling import couple
from dualdrive.tune.drives import compare_parameters, compare_responses
from dualdrive.tune.errors import TuneError
from dualdrive.tune.job import Draft, Job
from dualdrive.tune.limits import MotionLimits
from dualdrive.tune.loops import inner_loops, position_gain, set_back
from dualdrive.tune.moves import adjust_motion, alike
from dualdrive.tune.parameters import DriveTable, set_drive_parameters
from dualdrive.tune.result import Assessment, Step, Tuning
from dualdrive.tune.standstill import restless, trials

__all__ = ["PROCEDURE", "Ask", "tune"]

#: shown a finished step, says whether to keep it
Ask = Callable[[Step], bool]

PROCEDURE: Final[tuple[tuple[str, Callable[[Job], Draft]], ...]] = (
    ("Parameters of both drives compared", compare_parameters),
    ("Current and speed loop", inner_loops),
    ("Frequency responses of both drives", compare_responses),
    ("Position gain to the edge of vibration", position_gain),
    ("Play and friction; position gain set back", set_back),
    ("Feed-forward and limits alike in both axes", alike),
    ("Tension and torque equaliser", couple),
    ("Acceleration, jerk, feed-forward", adjust_motion),
)


def tune(
    machine: Machine,
    motion: Motion | None = None,
    *,
    table: DriveTable | None = None,
    measured: DriveComparison | None = None,
    tolerance_db: float = 1.0,
    tolerance_deg: float = 5.0,
    until: int = len(PROCEDURE),
    ask: Ask | None = None,
    begin: Callable[[int, str], None] | None = None,
) -> Tuning:
    """Tune a copy of the machine, step by step; the machine itself stays as it is.

    motion:    test move that every step is judged by; default: the machine's usual one
    table:     drive parameters as read from a control: compared in step 1, then set
    measured:  responses of both drives as measured (`dualdrive.linear.differ`), for step 3
    tolerance: by how much the drives' responses may part, dB and degrees
    until:     last step to do; 0 for none, so that the table is set and the machine assessed
    ask:       called with each step's outcome; False leaves the machine as it was before the step
    begin:     called with number and title before each step

    A step that finds what makes the following ones senseless ends the procedure with its reason.
    Raises TuneError for a machine without two drives under a master/slave controller.
    """
    _refuse_others(machine)
    job = _job(machine, motion, table, measured, tolerance_db, tolerance_deg)
    first = now = assess(job.machine, job.motion)
    steps: list[Step] = []
    reason = ""
    for number, (title, carry_out) in enumerate(PROCEDURE, 1):
        if reason or number > until:
            steps.append(Step(number, title, (), now, now, status="not run"))
            continue
        if begin is not None:
            begin(number, title)
        draft = carry_out(job)
        step = _step(number, title, job, draft, now)
        if draft.reason:
            reason = f"step {number}: {draft.reason}"
        elif ask is None or ask(step):
            job.machine, now = draft.machine, step.after
            job.limits = draft.limits or job.limits
        else:
            step = _declined(step, now)
        steps.append(step)
    return _ended(job, steps, first, now, reason, whole=until >= len(PROCEDURE))


def _job(
    machine: Machine,
    motion: Motion | None,
    table: DriveTable | None,
    measured: DriveComparison | None,
    tolerance_db: float,
    tolerance_deg: float,
) -> Job:
    motion = usual_motion(machine) if motion is None else motion
    limits, start = MotionLimits.of(motion), machine.copy()
    unused: tuple[str, ...] = ()
    if table is not None and not any(entry.differs for entry in table.entries.values()):
        applied = set_drive_parameters(start, table)
        start, limits, unused = applied.machine, applied.limits or limits, applied.unused
    return Job(
        start, start.copy(), motion, limits, tolerance_db, tolerance_deg, table, unused, measured,
        operating_point(start, motion),
    )  # fmt: skip


def _step(number: int, title: str, job: Job, draft: Draft, before: Assessment) -> Step:
    changes = {
        old.path: (old.value, new.value)
        for old, new in zip(job.machine.parameters(), draft.machine.parameters(), strict=True)
        if old.value != new.value
    }
    refused = bool(draft.reason)
    after = assess(draft.machine, job.motion) if changes and not refused else before
    return Step(
        number,
        title,
        tuple(draft.done),
        before,
        after,
        {} if refused else changes,
        draft.panels,
        "refused" if refused else "done",
        draft.reason,
        draft.details,
    )


def _declined(step: Step, now: Assessment) -> Step:
    return Step(
        step.number, step.title, step.done, now, now, {}, step.panels, "declined", "",
        step.details,
    )  # fmt: skip


def _ended(
    job: Job, steps: list[Step], first: Assessment, now: Assessment, reason: str, *, whole: bool
) -> Tuning:
    status = "refused" if reason else "tuned"
    if not (reason or whole):
        status = "in part"
    elif not reason and not now.stable:
        status, reason = "not done", f"the loop is unstable as it stands: {now.growing}"
    elif not reason and (left := restless(job.machine, trials(job.machine, job.motion))):
        status, reason = "not done", left.text
    return Tuning(
        job.machine, tuple(steps), first, now, job.motion, job.limits,
        status, reason,  # type: ignore[arg-type]
    )  # fmt: skip


def _refuse_others(machine: Machine) -> None:
    core = machine.core
    if len(core.motors) != 2 or core.controller_options["kind"] != "master_slave":
        raise TuneError(
            f"{machine.name}: motors = {', '.join(core.motors) or 'none'}, controller = "
            f"{core.controller_options['kind']}: the procedure is for a master and a slave drive; "
            "take a machine with drive_train = dual_servo"
        )
    for n in (1, 2):
        for part in (f"gearbox_{n}", f"mesh_{n}"):
            if part not in core.connections:
                raise TuneError(f"{machine.name}: has no {part}; the procedure needs it")
            if core.kind(part) == "gap" and not core.get(f"{part}.gap") > 0.0:
                raise TuneError(
                    f"{machine.name}: {part}.gap = 0: must be above 0, or {part}.kind = compliant"
                )

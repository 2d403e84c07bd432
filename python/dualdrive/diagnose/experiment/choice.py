"""The experiment that best separates the leading explanations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from typing import Any

from dualdrive.diagnose.experiment.catalogue import LEFT_OUT, menu
from dualdrive.diagnose.experiment.distance import Noise
from dualdrive.diagnose.experiment.limits import Limits, axis_of, same
from dualdrive.diagnose.experiment.plan import TELLS_APART, Plan, Rival, Trial, uncontrolled
from dualdrive.diagnose.result import Experiment
from dualdrive.replay import core_of

#: below this even the best experiment of the menu says nothing of a pair
_HOPELESS = 1.0
#: of the leading rivals; pairs of them are tried in turn until a pair can be told apart
_LEADING = 3
#: share of what simulations are left that a pair of rivals may take, unless it is the last
_FIRST = 0.7
#: of machines that the exact engine takes: about half a minute on one core
_SIMULATIONS = 3000.0


def next_experiment(
    rivals: Sequence[tuple[str, Any]],
    *,
    noise: Mapping[str, float],
    channels: Sequence[str],
    seconds: float = 40.0,
    spacing: float = 5e-3,
    known: Mapping[str, Mapping[str, float]] | None = None,
    limits: Limits | None = None,
    simulations: float = _SIMULATIONS,
    files: tuple[str, str, str] = ("machine.toml", "old.csv", "next.csv"),
    progress: Callable[[str], None] | None = None,
    cut: Callable[[str], None] | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> Experiment | None:
    """Plan what to measure next, so that the leading rivals part.

    Every motion of the menu is scaled to the machine, simulated with each of two rivals, and the
    record of the one fitted with the other, both ways; the smaller distance counts, but that of a
    rival with more numbers, which parsimony refuses where it imitates the other. The largest of
    the menu wins; of those beyond any doubt the simplest, and other settings of the drives are
    tried only where no motion is. Where a pair is the same under all, the next pair is tried.

    Args:
        rivals: label and fully fitted machine of each, its own effect in it, best first.
        noise: channel -> RMS noise, SI.
        channels: which to record, among those of `noise`; equations in a torque balance.
        seconds: longest an experiment may last.
        spacing: time between samples whose noise is independent, s: the sampling time times one
            plus twice the noise's correlation time in samples.
        known: label -> parameter path -> standard deviation that the fit left, SI; without it an
            effect's strength is taken as known to 20 %.
        limits: what the axis may be asked for; 80 % of torque and speed, one turn unless given.
        simulations: about how many are worth it, those of a machine that the exact engine does not
            take counted as several; what is not done then is left out.
        files: names for the commands: machine, record so far, record to come.
        progress: told in words what is being tried.
        cut: told in words what was left out.
        stop: asked between simulations; what is known by then is told.

    Returns:
        The experiment, or None with fewer than two rivals, or where no motion separates any two.

    Raises:
        ValueError: noise that lacks every channel, or a machine without any speed limit.

    """
    leading = [
        Rival(label, core_of(machine), dict((known or {}).get(label, {})))
        for label, machine in rivals[:_LEADING]
    ]
    if len(leading) < 2 or not same([rival.core for rival in leading]):
        return None
    rms = {name: noise[name] for name in channels if noise.get(name, 0.0) > 0.0} or {
        name: value for name, value in noise.items() if value > 0.0
    }
    if not rms:
        raise ValueError(f"noise: nothing above 0 for {', '.join(channels)}; give its RMS")
    linear = any(getattr(machine, "axis", "") == "linear" for _, machine in rivals)
    own = limits or Limits()
    planned = menu(axis_of(leading[0].core, own, linear=linear), seconds)
    pairs, left = list(combinations(leading, 2)), simulations
    for pair in pairs:
        share = (_FIRST if pair is not pairs[-1] else 1.0) * left
        plan = Plan(Noise(rms, spacing), own, linear, share, progress or (lambda _: None), stop)
        trials = plan.trials(pair, planned)
        left -= plan.done
        if plan.left_out and cut is not None:
            cut(f"next experiment: not tried: {', '.join(plan.left_out)}")
        if trials and trials[0].distance >= _HOPELESS:
            return _told(pair, trials, files)
    return None


def _told(
    pair: Sequence[Rival], trials: Sequence[Trial], files: tuple[str, str, str]
) -> Experiment:
    best = trials[0]
    labels = (pair[0].label, pair[1].label)
    return Experiment(
        best.item.name,
        best.motion.text,
        dict(best.item.settings),
        labels,
        best.distance,
        _reason(best, labels),
        {trial.item.name: trial.distance for trial in trials[1:]},
        _commands(best, files, closed_loop=not uncontrolled(pair[0].core)),
    )


def _reason(best: Trial, labels: tuple[str, str]) -> str:
    why = best.item.why
    if best.distance < TELLS_APART:
        why += (
            f"; {TELLS_APART:g} would tell {labels[0]} from {labels[1]}: repeat it, or let it last"
        )
    if any(label.startswith("thermal") for label in labels):
        why += f"; {LEFT_OUT['cold and warm']}"
    return why


def _commands(best: Trial, files: tuple[str, str, str], *, closed_loop: bool) -> tuple[str, ...]:
    machine, old, new = files
    settings = best.item.settings.items()
    sets = "".join(f" --set {path}={value:g}" for path, value in settings)
    ours = "".join(f" --set-for {new}:{path}={value:g}" for path, value in settings)
    diagnose = f"dualdrive diagnose {machine} {old} {new}{ours}"
    if not closed_loop:  # nothing to simulate: the axis' own controller makes the motion
        return (diagnose,)
    motion = f"--motion '{best.motion.text}'{sets}"
    return (f"dualdrive simulate {machine} {motion} --plot expected.png", diagnose)

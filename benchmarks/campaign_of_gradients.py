"""Whether derivatives through laws that are not affine hold on random machines.

    python benchmarks/campaign_of_gradients.py              random machines of the tests, 0 to 199
    python benchmarks/campaign_of_gradients.py --last 1000
    python benchmarks/campaign_of_gradients.py --forward    sensitivities by the exponential engine

A random cost of the recorded states by twelve random parameters, backward (`gradient`, rtol 1e-10)
or by the exponential engine's sensitivities at the same tolerance, against
forward slopes of the explicit engine at 1e-11, over what the latter add up to in size. A
parameter counts where forward slopes at 1e-8 agree with those to a tenth of what is asked for:
elsewhere the machine amplifies what rounds differently, and there is no answer.
"""

from __future__ import annotations

import argparse

import numpy as np

import report
from case import Array

from core_random import RandomMachine  # isort: skip  (case.py finds the tests' folder)
from dualdrive import _core

END, RTOL, COARSE, FINE, MOST_STEPS = 1.0, 1e-10, 1e-8, 1e-11, 400_000
SIGNALS, ROWS, PARAMETERS = ("theta_m", "omega_m", "omega_c1"), 61, 12
ALLOWED = 1e-6
AFFINE = {kind.name: kind.affine for kind in _core.effect_types()}


def draw(m: RandomMachine, seed: int) -> list[str]:
    """Some parameters that have a derivative, those of laws that are not affine first."""
    random = np.random.default_rng(seed)
    own, others = [], []
    bent = [e["label"] for e in m.machine.effects if not AFFINE.get(e["effect"], False)]
    for p in m.machine.parameters():
        if np.isfinite(p.value):
            (own if p.path.rpartition(".")[0] in bent else others).append(p.path)
    few = own[: PARAMETERS // 2]
    return [*few, *random.permutation(others)[: PARAMETERS - len(few)].tolist()]


def run(m: RandomMachine, **options: object) -> _core.Trajectory:
    times = np.linspace(END / ROWS, END, ROWS).tolist()
    return _core.simulate(m.machine, m.inputs, end=END, initial=m.initial, times=times,
                          signals=list(SIGNALS), energy=False, max_steps=MOST_STEPS,
                          **options)  # type: ignore[arg-type]  # fmt: skip


def possible(m: RandomMachine, names: list[str]) -> list[str]:
    """Those that forward slopes can be had by."""
    found = []
    for name in names:
        try:
            _core.simulate(m.machine, m.inputs, end=1e-6, sensitivities=[name], signals=["theta_m"])
        except ValueError:
            continue
        found.append(name)
    return found


def forward(
    m: RandomMachine, names: list[str], rtol: float, engine: str = "explicit"
) -> Array | None:
    raw = run(m, engine=engine, rtol=rtol, sensitivities=names)
    return np.asarray(raw.sensitivities) if raw.status == "success" else None


def errors(m: RandomMachine, seed: int, ahead: bool) -> tuple[list[str], Array] | str:
    """Parameters that count and what each is off by; or why there is nothing to compare."""
    names = possible(m, draw(m, seed))
    if not names:
        return "no parameter"
    back = None
    try:
        if not ahead:
            back = run(m, rtol=RTOL, gradient=names)
        told = forward(m, names, RTOL, "exponential") if ahead else None
    except ValueError as refusal:
        return str(refusal).partition(";")[0]
    fine, coarse = (forward(m, names, rtol) for rtol in (FINE, COARSE))
    ended = told is None if back is None else back.status != "success"
    if ended or fine is None or coarse is None:
        return "a run ended early"
    values = np.asarray(run(m, engine="explicit", rtol=COARSE).values)
    weights = np.random.default_rng(seed).normal(size=values.shape)
    seeds = weights / np.maximum(np.abs(values).max(axis=0), 1e-12)

    def cost(slopes: Array) -> Array:
        return np.asarray(np.einsum("ts,tsp->p", seeds, slopes))

    size = np.einsum("ts,tsp->p", np.abs(seeds), np.abs(fine))
    apart = np.abs(cost(coarse - fine))
    found = cost(told) if told is not None else np.asarray(back and back.pull_back(seeds))
    counts = (apart < 0.1 * ALLOWED * size) & (size > 0)
    off = np.abs(found - cost(fine)) / np.maximum(size, 1e-300)
    return [n for n, c in zip(names, counts, strict=True) if c], off[counts]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--last", type=int, default=200, help="so many machines")
    parser.add_argument("--forward", action="store_true", help="the exponential engine, forward")
    asked = parser.parse_args()
    machines = compared = 0
    reasons: dict[str, int] = {}
    worst: list[float] = []
    differ: list[list[str]] = []
    for seed in range(asked.last):
        m = RandomMachine(seed)
        if all(AFFINE.get(e["effect"], False) for e in m.machine.effects):
            continue
        machines += 1
        found = errors(m, seed, asked.forward)
        if isinstance(found, str):
            reasons[found] = reasons.get(found, 0) + 1
            continue
        names, off = found
        compared += len(names)
        worst += off.tolist()
        differ += [[str(seed), name, f"{e:.1e}", "; ".join(m.notes[1:])]
                   for name, e in zip(names, off, strict=True) if e > ALLOWED]  # fmt: skip
    middle = float(np.median(worst)) if worst else 0.0
    print(f"{machines} machines, {compared} derivatives that have an answer; off by more than "
          f"{ALLOWED:g}: {len(differ)}; the worst by {max(worst, default=0.0):.1e}, the middle one "
          f"by {middle:.1e}.")  # fmt: skip
    for reason, count in sorted(reasons.items(), key=lambda each: -each[1]):
        print(f"{count} x {reason}")
    if differ:
        print("\n" + report.table(["machine", "parameter", "off by", "what it is"], differ))


if __name__ == "__main__":
    main()

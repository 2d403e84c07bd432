"""Compare a machine with its trace, score what could be missing, add it, refit."""

from dualdrive import demo
from dualdrive.identify import evaluate, fit, screen

machine = demo.sheet()
record, held_out = demo.records()

nominal = fit(machine, record, rtol=1e-6)
print(f"data sheet refitted: {nominal.error['refitted']:.1%}")

best = screen(nominal.machine, record, rtol=1e-6)[0]
print(f"most likely missing: {best.label}, explains {best.explained:.0%} of what is left")

grown = nominal.machine.copy()
grown.add(best.effect, best.place, **{p.split(".")[-1]: v for p, v in best.expected.items()})
found = fit(grown, record, rtol=1e-6)
unseen = evaluate(found.machine, held_out).error
print(f"with it: {found.error['refitted']:.1%}, held out {unseen:.1%}")

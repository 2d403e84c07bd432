"""Confront a machine with its trace, learn what is missing, and test it on another trace."""

from dualdrive import demo
from dualdrive.diagnose import diagnose
from dualdrive.identify import evaluate

machine = demo.sheet()
record, held_out = demo.records()

found = diagnose(machine, record)
print(f"data sheet refitted: {found.error['refitted']:.1%}")

best = found.candidates[0]
print(f"{found.verdict}: {best.label}, explains {best.explained:.0%} of what is left")
for path, number in best.parameters.items():
    print(f"  {path} = {number.value:.4g} [{number.low:.4g} .. {number.high:.4g}] {number.unit}")

unseen = evaluate(found.improved, held_out).error
print(f"with it: {found.error['best']:.1%}, held out {unseen:.1%}")

"""The whole story on a shipped trace: a machine, what its model misses, and an error that falls.

`fit.csv` and `held_out.csv` are two records of one heavy table, made by a plain program of its own
(`tools/make_demo_trace.py`), not by this package's core. `machine.toml` is that table as its data
sheet has it: some numbers are off and one effect is missing.
"""

from dualdrive.demo.story import records, sheet, shipped, tell

__all__ = ["records", "sheet", "shipped", "tell"]

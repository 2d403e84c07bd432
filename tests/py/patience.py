"""How long a test waits for another process before it calls it hung: no figure of speed.

What is measured in seconds is a benchmark (`benchmarks/`); a computer four times slower, busy with
four other programs, turns no test red.
"""

PATIENCE = 600.0  # s

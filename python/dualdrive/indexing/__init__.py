"""Positioning tests after ISO 230-2 (GB/T 17421.2), of simulated machines and of measured ones.

from dualdrive import Machine, indexing

result = indexing.measure(Machine.load("heavy-table-550t"))
result.A, result.R, result.B, result.rows
"""

from dualdrive.indexing.cycle import STILL, Cycle, cycle_for, measure
from dualdrive.indexing.dwells import evaluate_trace
from dualdrive.indexing.experiment import PAIR, Cell, Crossed, crossed
from dualdrive.indexing.iso230 import FIGURES, Iso230, TargetRow, evaluate
from dualdrive.indexing.lost_motion_test import LostMotion, Pull, lost_motion, read_lost_motion
from dualdrive.indexing.outcome import Spread, Verdict, rows, verdicts
from dualdrive.indexing.position_file import is_position_table, read_positions
from dualdrive.indexing.printed import DEMANDED, LOADS, PRINTED, TOLERANCE, TRAINS, loaded
from dualdrive.indexing.report_file import Departure, Report, is_report, read_report
from dualdrive.indexing.rules import REPEATS, IndexingError, least_targets

__all__ = [
    "DEMANDED",
    "FIGURES",
    "LOADS",
    "PAIR",
    "PRINTED",
    "REPEATS",
    "STILL",
    "TOLERANCE",
    "TRAINS",
    "Cell",
    "Crossed",
    "Cycle",
    "Departure",
    "IndexingError",
    "Iso230",
    "LostMotion",
    "Pull",
    "Report",
    "Spread",
    "TargetRow",
    "Verdict",
    "crossed",
    "cycle_for",
    "evaluate",
    "evaluate_trace",
    "is_position_table",
    "is_report",
    "least_targets",
    "loaded",
    "lost_motion",
    "measure",
    "read_lost_motion",
    "read_positions",
    "read_report",
    "rows",
    "verdicts",
]

"""Steps (1) to (8) of the paper's section 3.3 as a procedure, and drive parameters in and out.

from dualdrive import Machine
from dualdrive.tune import drive_parameters, table_text, tune

tuned = tune(Machine.load("heavy-table-550t"))
print(table_text(drive_parameters(tuned.machine, tuned.limits)))
"""

from dualdrive.tune.cause import Cause, causes
from dualdrive.tune.commissioning import PROCEDURE, Ask, tune
from dualdrive.tune.edge import Edge, find_edge, measured_edge
from dualdrive.tune.errors import TuneError
from dualdrive.tune.files import read_drive_parameters, table_csv, table_json, table_text
from dualdrive.tune.known import KNOWN, DriveParameter
from dualdrive.tune.limits import MotionLimits
from dualdrive.tune.parameters import (
    Applied,
    DriveTable,
    Entry,
    drive_parameters,
    set_drive_parameters,
)
from dualdrive.tune.result import Assessment, Step, Tuning
from dualdrive.tune.smooth import ripple

__all__ = [
    "KNOWN",
    "PROCEDURE",
    "Applied",
    "Ask",
    "Assessment",
    "Cause",
    "DriveParameter",
    "DriveTable",
    "Edge",
    "Entry",
    "MotionLimits",
    "Step",
    "TuneError",
    "Tuning",
    "causes",
    "drive_parameters",
    "find_edge",
    "measured_edge",
    "read_drive_parameters",
    "ripple",
    "set_drive_parameters",
    "table_csv",
    "table_json",
    "table_text",
    "tune",
]

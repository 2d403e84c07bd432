"""Commanded motions: an input signal, when it is over, and the words that made it.

Every motion can be written as one line, which the command line, files and pictures use:
``move:0.02,v=0.03,a=0.01,j=0.05,start=2``, or comes from a file. Angles are the table's, in rad (m
on a linear axis).
"""

from .builders import Motion, MotionError, cycle, move, multisine, sampled, shuttle, sine, step
from .recorded import motion_csv, read_command, read_motion
from .suitable import default_motion
from .words import parse_motion

__all__ = [
    "Motion",
    "MotionError",
    "cycle",
    "default_motion",
    "motion_csv",
    "move",
    "multisine",
    "parse_motion",
    "read_command",
    "read_motion",
    "sampled",
    "shuttle",
    "sine",
    "step",
]

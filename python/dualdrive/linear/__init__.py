"""The machine as a linear system: contact modes, frequency responses, measured Bode plots."""

from dualdrive.linear.drives import DriveComparison, compare_drives, differ
from dualdrive.linear.eq23 import INPUTS, STATES, Mode, modes
from dualdrive.linear.errors import LinearError
from dualdrive.linear.export import state_space
from dualdrive.linear.frequency import frequency_response, open_loop, poles
from dualdrive.linear.measured import read_response, write_response
from dualdrive.linear.response import FrequencyResponse, Margins
from dualdrive.linear.swept import multisine, spaced, stepped_sine, worth_measuring

__all__ = [
    "INPUTS",
    "STATES",
    "DriveComparison",
    "FrequencyResponse",
    "LinearError",
    "Margins",
    "Mode",
    "compare_drives",
    "differ",
    "frequency_response",
    "modes",
    "multisine",
    "open_loop",
    "poles",
    "read_response",
    "spaced",
    "state_space",
    "stepped_sine",
    "worth_measuring",
    "write_response",
]

"""Machine files: TOML read in layers, checked, turned into a core machine, and written again.

A file may rest on another one (`base`); layers are applied from the base outward. Within a layer a
group (``[meshes]``) comes before its members (``[mesh_1]``).
"""

from .choices import is_choice, spoken_choice
from .construction import build
from .effects import add_effect
from .frames import unit_on_axis
from .history import history_of
from .layers import DEFAULT, SCHEMA, Layer, MachineError, parse_layer, preset_names, read_layers
from .numbers import set_value
from .trains import GROUPS, Structure, group_of
from .user_laws import LAW_KEYS

__all__ = [
    "DEFAULT",
    "GROUPS",
    "LAW_KEYS",
    "SCHEMA",
    "Layer",
    "MachineError",
    "Structure",
    "add_effect",
    "build",
    "group_of",
    "history_of",
    "is_choice",
    "parse_layer",
    "preset_names",
    "read_layers",
    "set_value",
    "spoken_choice",
    "unit_on_axis",
]

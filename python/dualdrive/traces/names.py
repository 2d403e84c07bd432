"""The canonical channels of a measured trace: the names people put in a header.

Any other column is kept as an extra channel.
"""

from __future__ import annotations

from typing import Final, NamedTuple

__all__ = ["CHANNELS", "DRIVES", "MEASURED_ANGLES", "TIME", "ChannelName", "is_canonical"]

TIME: Final = "t"
#: numbers of the drives whose columns have names; the largest antennas turn on eight
DRIVES: Final = range(1, 9)


class ChannelName(NamedTuple):
    """What a canonical name stands for."""

    unit: str  # SI, written as the core writes it
    long_name: str


def _each(stem: str, unit: str, what: str) -> dict[str, ChannelName]:
    return {f"{stem}{n}": ChannelName(unit, what.format(n=n)) for n in DRIVES}


CHANNELS: Final[dict[str, ChannelName]] = {
    "theta_ref": ChannelName("rad", "commanded table angle"),
    "omega_ref": ChannelName("rad/s", "commanded table speed"),
    "theta_m": ChannelName("rad", "table angle"),
    "omega_m": ChannelName("rad/s", "table speed"),
    **_each("theta_", "rad", "angle of motor {n}"),
    **_each("omega_", "rad/s", "speed of motor {n}"),
    **_each("theta_c", "rad", "angle of pinion {n}"),
    **_each("omega_c", "rad/s", "speed of pinion {n}"),
    **_each("I_", "A", "current of motor {n}"),
    **_each("U_", "V", "voltage of motor {n}"),
    **_each("T_", "N*m", "torque of motor {n}"),
    "T_load": ChannelName("N*m", "load torque, positive against positive motion"),
}

# A commanded angle may jump; one that was measured may not.
MEASURED_ANGLES: Final = frozenset(
    name for name, what in CHANNELS.items() if what.unit == "rad" and name != "theta_ref"
)


def is_canonical(name: str) -> bool:
    """Tell whether `name` is a canonical channel (time is not a channel)."""
    return name in CHANNELS

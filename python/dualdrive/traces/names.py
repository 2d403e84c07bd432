"""The canonical channels of a measured trace: the names people put in a header.

Any other column is kept as an extra channel.
"""

from __future__ import annotations

from typing import Final, NamedTuple

__all__ = ["CHANNELS", "MEASURED_ANGLES", "TIME", "ChannelName", "is_canonical"]

TIME: Final = "t"


class ChannelName(NamedTuple):
    """What a canonical name stands for."""

    unit: str  # SI, written as the core writes it
    long_name: str


def _pair(stem: str, unit: str, what: str) -> dict[str, ChannelName]:
    return {f"{stem}_{n}": ChannelName(unit, what.format(n=n)) for n in (1, 2)}


CHANNELS: Final[dict[str, ChannelName]] = {
    "theta_ref": ChannelName("rad", "commanded table angle"),
    "omega_ref": ChannelName("rad/s", "commanded table speed"),
    "theta_m": ChannelName("rad", "table angle"),
    "omega_m": ChannelName("rad/s", "table speed"),
    **_pair("theta", "rad", "angle of motor {n}"),
    **_pair("omega", "rad/s", "speed of motor {n}"),
    "theta_c1": ChannelName("rad", "angle of pinion 1"),
    "theta_c2": ChannelName("rad", "angle of pinion 2"),
    "omega_c1": ChannelName("rad/s", "speed of pinion 1"),
    "omega_c2": ChannelName("rad/s", "speed of pinion 2"),
    **_pair("I", "A", "current of motor {n}"),
    **_pair("U", "V", "voltage of motor {n}"),
    **_pair("T", "N*m", "torque of motor {n}"),
    "T_load": ChannelName("N*m", "load torque, positive against positive motion"),
}

# A commanded angle may jump; one that was measured may not.
MEASURED_ANGLES: Final = frozenset(
    name for name, what in CHANNELS.items() if what.unit == "rad" and name != "theta_ref"
)


def is_canonical(name: str) -> bool:
    """Tell whether `name` is a canonical channel (time is not a channel)."""
    return name in CHANNELS

"""Channels as they are written down: what the sensor reads, and what the recorder makes of it.

``sensor_delay@theta_1`` is a late recorder, ``quantisation@I_2`` one that counts; the loop knows
nothing of either. ``sensor_delay@table`` is a late sensor: the loop feels it, and the record of
theta_m shows what the sensor read. The laws are those of the core; here they meet arrays.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core

__all__ = [
    "AsRecorded",
    "delays",
    "own_paths",
    "read_at",
    "reading_times",
    "reads",
    "sources",
    "written",
]

Array = NDArray[np.float64]

_PASSES = 4  # at what a sensor adds, of whose slope, 1e-3 say, each leaves as much of the error


class Source(NamedTuple):
    """Where effects change a channel, in this order (``table``, ``theta_m``), and its delay, s."""

    places: tuple[str, ...]
    delay: float


def delays(core: _core.Machine) -> dict[str, float]:
    """Channels that a recorder's effects sit at, and how late each of them is, s."""
    channels = _core.recorded_channels(core)
    return {name: _core.recorder_delay(core, name)[0] for name in channels}


def sources(core: _core.Machine) -> dict[str, Source]:
    """Channels that are not the machine's own signals: by their recorder, or by their sensor.

    The record of theta_m is what the table's sensor reads, that of theta_n what the motor's does.
    """
    late = delays(core)
    found = {channel: Source((channel,), delay) for channel, delay in late.items()}
    for effect in core.effects:
        for sensor in effect["members"]:
            channel = f"theta_{sensor.rpartition('_')[2]}" if sensor in core.motors else "theta_m"
            if "sensor" not in _acts_on(effect) or not (sensor in core.motors or sensor == "table"):
                continue
            delay = _core.recorder_delay(core, sensor)[0] + late.get(channel, 0.0)
            found[channel] = Source((sensor, channel), delay)
    return found


def _acts_on(effect: Mapping[str, Any]) -> str:
    try:
        return str(_core.effect_type(effect["effect"]).acts_on)
    except ValueError:
        return ""  # a user's formula


def own_paths(core: _core.Machine, paths: Sequence[str]) -> list[str]:
    """Those of the parameter paths that belong to a recorder, in their order."""
    heard = set(_core.recorded_channels(core))
    labels = tuple(f"{e['label']}." for e in core.effects if heard & set(e["members"]))
    return [path for path in paths if path.startswith(labels)] if labels else []


def reading_times(t: Array, late: Mapping[str, float], begin: float) -> Array:
    """Times at which any channel is looked at: `t`, and earlier by a delay but not before begin."""
    earlier = [np.maximum(t - delay, begin) for delay in {*late.values()} if delay > 0]
    return np.unique(np.concatenate([t, *earlier]))


def written(
    core: _core.Machine,
    places: Sequence[str],
    t: Array,
    signal: Array,
    slopes: Array,
    paths: Sequence[str],
) -> tuple[Array, Array]:
    """What is written down of a channel at times t, and its derivatives: shapes (n,), (n, k).

    Args:
        core: the core's machine.
        places: where effects change it, in this order.
        t: times of the record, s, shape (n,), increasing.
        signal: the channel at those times less all delays, shape (n,).
        slopes: its derivatives by the paths, as far as they move the machine, shape (n, k).
        paths: parameter paths, those of recorders among them, and ``initial.<state>``.

    """
    known = [k for k, path in enumerate(paths) if not path.startswith("initial.")]
    names = [paths[k] for k in known]
    late = {place: _core.recorder_delay(core, place, names)[1] for place in places}
    rate = _rate(t, signal) if any(by.any() for by in late.values()) else np.zeros(len(t))
    slopes = slopes.copy()
    for place in places:
        signal, by_signal, direct = _core.record(core, place, t, signal, names)
        slopes[:, known] -= np.outer(rate, late[place])
        slopes *= by_signal[:, None]
        slopes[:, known] += direct
        rate = by_signal * rate
    return signal, slopes


def reads(core: _core.Machine, place: str) -> bool:
    """Whether an effect at a place changes what is read there, a user's formula perhaps."""
    at = [_acts_on(e) for e in core.effects if place in e["members"]]
    return any(not acts or "sensor reading" in acts for acts in at)


def read_at(core: _core.Machine, places: Sequence[str], readings: Array) -> Array:
    """The angles at which a channel at rest is written down so: `written`, taken back.

    The readings themselves, where what a sensor reads follows from the forces of the teeth.

    Args:
        core: the core's machine.
        places: where effects change the channel, in this order.
        readings: rad, shape (n,).

    """
    angles, t, none = readings, np.zeros(len(readings)), np.zeros((len(readings), 0))
    for _ in range(_PASSES):
        try:
            seen, _ = written(core, places, t, angles, none, [])
        except ValueError:
            return readings
        angles = angles - (seen - readings)
    return angles


def _rate(t: Array, values: Array) -> Array:
    from scipy.interpolate import CubicSpline

    result: Array = CubicSpline(t, values)(t, 1)
    return result


class AsRecorded:
    """A trajectory of the core whose channels are as the recorder wrote them.

    All else of the trajectory, its events and its work among it, is passed on as it is.
    """

    def __init__(
        self,
        core: _core.Machine,
        trajectory: _core.Trajectory,
        t: Array,
        late: Mapping[str, float],
        paths: Sequence[str],
    ) -> None:
        """Take the rows at times t (s) of a trajectory that was also asked for earlier ones.

        late:   recorded channel -> delay, s
        paths:  parameters that the run was asked to derive by, recorders' own among them
        """
        own = set(own_paths(core, paths))
        begin = trajectory.t[0] if trajectory.t.size else 0.0
        self._trajectory = trajectory
        self.t = t[t <= trajectory.t[-1]] if trajectory.t.size else t[:0]
        self.parameters = list(paths)
        rows = np.searchsorted(trajectory.t, self.t)
        self.values = trajectory.values[rows]
        self.modes = trajectory.modes[rows]
        self.work = trajectory.work[rows] if trajectory.work.size else trajectory.work
        moving = [path not in own for path in paths]
        whole = np.zeros((len(trajectory.t), len(trajectory.names), len(paths)))
        if trajectory.parameters:
            whole[:, :, moving] = trajectory.sensitivities
        self.sensitivities = whole[rows] if paths else whole[:0]
        for column, channel in enumerate(trajectory.names):
            if channel not in late or not len(rows):
                continue
            seen = np.searchsorted(trajectory.t, np.maximum(self.t - late[channel], begin))
            signal, slopes = trajectory.values[seen, column], whole[seen, column]
            values, by = written(core, (channel,), self.t, signal, slopes, paths)
            self.values[:, column] = values
            if paths:
                self.sensitivities[:, column] = by

    def __getattr__(self, name: str) -> Any:
        return getattr(self._trajectory, name)

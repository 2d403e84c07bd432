"""Channels as a recorder writes them: effects that sit at a channel's name, outside the loop.

``sensor_delay@theta_1`` is a late recorder, ``quantisation@I_2`` one that counts. The laws are
those of the core; here they meet arrays.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core

__all__ = ["AsRecorded", "Recorded", "delays", "own_paths", "reading_times", "written"]

Array = NDArray[np.float64]


class Recorded(NamedTuple):
    """A channel as written down, shape (n,), and its derivatives.

    inside:  by what moves the signal, shape (n, parameters of the run)
    own:     by the recorder's own numbers, shape (n, paths asked for)
    """

    values: Array
    inside: Array
    own: Array


def delays(core: _core.Machine) -> dict[str, float]:
    """Channels that a recorder's effects sit at, and how late each of them is, s."""
    channels = _core.recorded_channels(core)
    return {name: _core.recorder_delay(core, name)[0] for name in channels}


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
    channel: str,
    t: Array,
    signal: Array,
    inside: Array,
    own: Sequence[str],
) -> Recorded:
    """What the recorder of a channel writes down at times t.

    Args:
        core: the core's machine.
        channel: such as theta_1.
        t: times of the record, s, shape (n,), increasing.
        signal: the channel at those times less the recorder's delay, shape (n,).
        inside: its derivatives by what moves it, shape (n, m).
        own: parameter paths of recorders to derive by.

    """
    values, by_signal, slopes = _core.record(core, channel, t, signal, list(own))
    late = _core.recorder_delay(core, channel, list(own))[1]
    if late.any():
        slopes = slopes - np.outer(by_signal * _rate(t, signal), late)
    return Recorded(values, by_signal[:, None] * inside, slopes)


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
        own = own_paths(core, paths)
        begin = trajectory.t[0] if trajectory.t.size else 0.0
        self._trajectory = trajectory
        self.t = t[t <= trajectory.t[-1]] if trajectory.t.size else t[:0]
        self.parameters = list(paths)
        rows = np.searchsorted(trajectory.t, self.t)
        self.values = trajectory.values[rows]
        self.modes = trajectory.modes[rows]
        self.work = trajectory.work[rows] if trajectory.work.size else trajectory.work
        shape = (len(rows) if paths else 0, len(trajectory.names), len(paths))
        self.sensitivities = np.zeros(shape)
        mine = np.array([path in own for path in paths], dtype=bool)
        if trajectory.parameters:
            self.sensitivities[:, :, ~mine] = trajectory.sensitivities[rows]
        for column, channel in enumerate(trajectory.names):
            if channel not in late or not len(rows):
                continue
            seen = np.searchsorted(trajectory.t, np.maximum(self.t - late[channel], begin))
            inside = (
                trajectory.sensitivities[seen, column]
                if trajectory.parameters
                else np.zeros((len(seen), 0))
            )
            signal = trajectory.values[seen, column]
            found = written(core, channel, self.t, signal, inside, own)
            self.values[:, column] = found.values
            if paths:
                self.sensitivities[:, column, ~mine] = found.inside
                self.sensitivities[:, column, mine] = found.own

    def __getattr__(self, name: str) -> Any:
        return getattr(self._trajectory, name)

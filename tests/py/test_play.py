"""The play of a mesh: from traces whose play is known, and from a real rig."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from balance_stand_in import Recorded
from dualdrive.identify import estimate_play
from dualdrive.identify.play_result import Interval
from dualdrive.plots import play
from measured import rig

PLAY, SKEW, COMPLIANCE, ZERO = 0.9, 0.03, 0.004, 0.2


def driven(
    seed: int = 0,
    *,
    play: float = PLAY,
    zero: float = ZERO,
    flanks: tuple[int, ...] = (1, -1),
    runout: float = 0.03,
    quantum: float = np.radians(1.0),
) -> Recorded:
    """Sixteen moves of 4 s to and fro at 1 to 8 rad/s, 100 Hz, crossing the play at each turn.

    The drive leads by half the play on the side it pushes, lags its own record by the skew, bends
    with the torque, wobbles with the ring, and is read in steps.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(0, 64, 0.01)
    move = (t // 4).astype(int)
    sense = np.resize([1.0, -1.0], 16)
    speed = (np.exp(rng.uniform(0, np.log(8), 16)) * sense)[move]
    side = np.resize(flanks, 16)[move]
    level = rng.uniform(1.5, 5.0, 16)[move]
    phase, length = rng.uniform(0, 2 * np.pi), rng.uniform(2, 4)
    soft = np.ones(20) / 20
    ring_speed = np.convolve(speed, soft, "same")
    ring = np.cumsum(ring_speed) * 0.01
    torque = np.convolve(side * level, soft, "same")
    seat = np.clip(torque / 0.5, -1, 1)
    drive = (
        ring + zero + seat * play / 2 + COMPLIANCE * torque + runout * np.sin(length * ring + phase)
    )
    late = np.interp(t - SKEW, t, drive)
    read = np.round((late + rng.normal(0, 0.01, len(t))) / quantum) * quantum
    return Recorded(t, {"theta_m": ring, "theta_c1": read, "T_1": torque})


def test_a_known_play_is_found() -> None:
    found = estimate_play(driven(), 1)
    assert found.status == "estimated"
    assert found.full.value == pytest.approx(PLAY, abs=0.02)
    assert found.full.low < PLAY < found.full.high
    assert found.full.high - found.full.low < 0.1
    assert found.skew.value == pytest.approx(SKEW, abs=0.002)
    assert found.half_gap.value == pytest.approx(PLAY / 2, abs=0.01)
    assert found.zero["record 1"] == pytest.approx(ZERO, abs=0.01)
    loaded = PLAY + 2 * COMPLIANCE * found.torque
    assert found.loaded is not None
    assert found.loaded.low < loaded < found.loaded.high


def test_the_angle_that_is_late_is_named() -> None:
    found = estimate_play(driven(), 1)
    assert "ms, the drive's angle is late" in found.table()
    early = replace(found, skew=Interval(-0.002, -0.003, -0.001))
    assert "time skew       2 [1 .. 3] ms, the ring's angle is late" in early.table()


def test_a_skew_that_nothing_tells_has_no_interval() -> None:
    """One contact, and contacts of a ring at rest: the interval had had no width."""
    pushed = driven(flanks=(1,))
    resting = driven(runout=0.0)
    torque = resting.channels["T_1"]
    drive = PLAY / 2 * np.clip(torque / 0.5, -1, 1) + COMPLIANCE * torque
    still = {"theta_m": np.zeros(len(torque)), "theta_c1": drive, "T_1": torque}
    for trace, flanks in ((pushed, 1), (Recorded(resting.t, still), 2)):
        found = estimate_play(trace, 1)
        assert len({episode.flank for episode in found.episodes}) == flanks
        assert "time skew       can't be told: it takes several contacts" in found.table()
        assert found.figures()["skew"] == {"value": None, "low": None, "high": None}
    assert found.full.value == pytest.approx(PLAY, abs=1e-6)


def test_one_contact_bounds_the_play_that_a_ring_at_rest_has_shown() -> None:
    """The drive crosses its play while the ring rests, then pushes it one way."""
    t = np.arange(0, 20, 0.01)
    torque = np.interp(t, [5, 6, 8, 9], [-0.2, 0.2, 0.2, 4.0])
    drive = 0.5 * PLAY * np.clip(torque / 0.2, -1, 1) + 0.002 * np.round(np.sin(9 * t))
    turned = np.interp(t, [10, 20], [0.0, 5.0])
    found = estimate_play(
        Recorded(t, {"theta_m": turned, "theta_c1": turned + drive, "T_1": torque}), 1
    )
    assert len(found.episodes) == 1
    assert found.full.low == pytest.approx(PLAY, abs=0.03)


def test_a_late_sensor_left_out_would_pose_as_another_play() -> None:
    """The mean of drive minus ring on either flank, skew ignored, misses by more than 0.1 rad."""
    trace = driven()
    drive, ring, torque = (trace.channels[n] for n in ("theta_c1", "theta_m", "T_1"))
    naive = (drive - ring)[torque > 1].mean() - (drive - ring)[torque < -1].mean()
    assert abs(naive - PLAY) > 0.1


def test_intervals_cover_the_play() -> None:
    inside = []
    for seed in range(100):
        found = estimate_play(driven(seed), 1, draws=500)
        assert found.loaded is not None
        loaded = PLAY + 2 * COMPLIANCE * found.torque
        inside.append(
            [
                found.full.low <= PLAY <= found.full.high,
                found.loaded.low <= loaded <= found.loaded.high,
                found.skew.low <= SKEW <= found.skew.high,
            ]
        )
    covered = np.mean(inside, axis=0)
    assert covered.min() >= 0.90, covered


def test_records_with_counters_set_back_share_the_play_but_not_the_zero() -> None:
    first, second = driven(1), driven(2, zero=-3.0)
    apart = estimate_play({"a": first, "b": second}, 1)
    assert apart.full.value == pytest.approx(PLAY, abs=0.015)
    assert apart.zero["a"] - apart.zero["b"] == pytest.approx(ZERO + 3.0, abs=0.02)
    # the same two in one file: the jump is found without a name for it
    t = np.concatenate([first.t, first.t[-1] + 0.01 + second.t])
    joined = {n: np.concatenate([x, second.channels[n]]) for n, x in first.channels.items()}
    found = estimate_play(Recorded(t, joined), 1)
    assert found.full.value == pytest.approx(apart.full.value, abs=0.005)
    assert list(found.zero) == ["record 1", "record 1, after reset 1"]


def test_a_locked_ring_whose_reading_flickers_is_no_reset() -> None:
    trace = driven(runout=0.0)
    t, torque = trace.t, trace.channels["T_1"]
    ring = np.where(np.arange(len(t)) % 3001 == 3000, 1e-6, 0.0)
    drive = PLAY / 2 * np.clip(torque / 0.5, -1, 1) + COMPLIANCE * torque
    found = estimate_play(Recorded(t, {"theta_m": ring, "theta_c1": drive, "T_1": torque}), 1)
    assert found.full.value == pytest.approx(PLAY, abs=1e-6)
    assert list(found.zero) == ["record 1"]


def test_ratios_refer_the_motor_to_the_pinion_and_the_ring_to_the_pinion() -> None:
    plain = driven()
    pinion = plain.channels["theta_c1"]
    geared = Recorded(
        plain.t,
        {
            "theta_m": plain.channels["theta_m"] / 5,
            "theta_1": 10 * pinion,
            "T_1": plain.channels["T_1"],
        },
    )
    found = estimate_play(geared, 1, mesh_ratio=5, gear_ratio=10)
    assert found.full.value == pytest.approx(estimate_play(plain, 1).full.value, rel=1e-6)


def test_one_flank_alone_gives_a_bound_and_says_why() -> None:
    """A drive that only ever pushes forwards: nothing but how far it was seen to travel."""
    pushed = driven(flanks=(1,))
    found = estimate_play(pushed, 1)
    assert found.status == "bounded"
    assert found.full.high == float("inf")
    assert 0.0 <= found.full.low < PLAY
    assert "only a lower bound: settled load on the front flank alone" in found.note
    assert "at least" in found.table()
    figures = json.loads(found.to_json())
    assert figures["full"]["high"] is None
    assert figures["full"]["value"] is None


def test_a_drive_that_never_pushes_is_refused() -> None:
    trace = driven()
    with pytest.raises(ValueError, match=r"no 0.3 s of torque beyond 100 N\*m in one direction"):
        estimate_play(trace, 1, load=100.0)
    with pytest.raises(ValueError, match="neither theta_c2 nor theta_2"):
        estimate_play(trace, 2)
    channels = {n: x for n, x in trace.channels.items() if n != "T_1"}
    with pytest.raises(ValueError, match="no channel T_1"):
        estimate_play(Recorded(trace.t, channels), 1)


def test_the_play_can_be_drawn(tmp_path: Path) -> None:
    figure = play(estimate_play(driven(), 1), estimate_play(driven(flanks=(1,)), 1))
    path = tmp_path / "play.png"
    figure.savefig(path)
    assert path.stat().st_size > 10_000
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles[3].startswith("at least ")
    with pytest.raises(ValueError, match="nothing to draw"):
        play()


@pytest.mark.parametrize("drive", [1, 2])
def test_rig_play_is_tens_of_degrees_with_tension_and_without(drive: int) -> None:
    """While the ring rests the drives cross the gap: 54 to 62 degrees, read off the raw trace."""
    parts = rig("log10")
    assert len(parts) == 8
    found = estimate_play(parts, drive)
    assert found.status == "estimated"
    assert 52 < np.degrees(found.full.low) < np.degrees(found.full.high) < 62
    assert len(found.episodes) >= 50
    assert 0.02 < found.skew.low < found.skew.high < 0.04
    off, on = (
        estimate_play({n: t for n, t in parts.items() if f"tension {k}" in n}, drive).loaded
        for k in (0, 1)
    )
    assert off is not None
    assert on is not None
    assert off.value == pytest.approx(on.value, abs=np.radians(1.5))


@pytest.mark.parametrize("drive", [1, 2])
def test_rig_with_one_drive_per_direction_gives_a_bound_only(drive: int) -> None:
    """Each drive of log12 pushes one way alone; what is seen agrees with the other record."""
    found = estimate_play(rig("log12"), drive)
    other = estimate_play(rig("log10"), drive)
    assert found.status == "bounded"
    assert np.radians(20) < found.full.low < other.full.high

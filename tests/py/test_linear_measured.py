"""Responses measured on the simulated machine, and read from files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dualdrive import FileError, Machine, linear

# ---------------------------------------------------------- the nonlinear machine, small and large


@pytest.mark.parametrize(
    ("source", "output", "amplitude", "cut"),
    [
        ("theta_ref", "theta_m", 1e-6, []),
        ("T_load", "e", 1e-4, []),
        ("Omega_1", "omega_c2", 1e-4, ["position"]),
        ("torque@motor_1", "omega_1", 1e-5, []),
    ],
)
def test_small_sines_are_answered_as_the_linear_machine_does(
    source: str, output: str, amplitude: float, cut: list[str]
) -> None:
    bench = Machine.load("bench")
    f = [1.0, 5.0, 20.0]
    swept = linear.stepped_sine(bench, source, output, f, amplitude)
    right = linear.frequency_response(bench, source, output, f, cut=cut)
    np.testing.assert_allclose(swept.response, right.response, rtol=1e-8)
    assert swept.unit == right.unit
    assert swept.distortion is not None
    assert swept.distortion.max() < 1e-8


def test_dry_friction_drops_out_while_the_table_turns() -> None:
    table = Machine.load("heavy-table-250t")
    turning = linear.stepped_sine(table, "theta_ref", "theta_m", [1.0], 1e-5, speed=0.005)
    assert turning.note == "stepped sine of 2.063 arcsec; speed 5 mrad/s"
    right = linear.frequency_response(table, "theta_ref", "theta_m", [1.0])
    np.testing.assert_allclose(turning.response, right.response, rtol=1e-8)


def test_flanks_that_open_distort() -> None:
    """Without tension the play is in the answer; with it a small motion has none of it."""
    bench = Machine.load("bench")
    kept = linear.stepped_sine(bench, "theta_ref", "theta_m", [10.0], 1e-3)
    bench.set("controller.T_ten", 0.0)
    loose = linear.stepped_sine(bench, "theta_ref", "theta_m", [10.0], 1e-3, settle=2.0)
    assert kept.distortion is not None
    assert loose.distortion is not None
    assert kept.distortion[0] < 1e-9
    assert loose.distortion[0] > 0.01


def test_a_multisine_gives_the_same_and_a_coherence() -> None:
    bench = Machine.load("bench")
    small = linear.multisine(bench, "theta_ref", "theta_m", 1.0, 5, 1e-6, realisations=2)
    right = linear.frequency_response(bench, "theta_ref", "theta_m", small.frequency_hz)
    np.testing.assert_allclose(small.frequency_hz, [1, 3, 5, 7, 9])
    np.testing.assert_allclose(small.response, right.response, rtol=1e-8)
    large = linear.multisine(bench, "theta_ref", "theta_m", 1.0, 5, 2e-2, realisations=2)
    assert small.coherence is not None
    assert large.coherence is not None
    np.testing.assert_allclose(small.coherence, 1, rtol=1e-12)
    assert 1 - large.coherence.min() > 1e-5  # limits and flanks, at 20 mrad


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda m: linear.stepped_sine(m, "U_1", "e", [1], 1e-3), "'U_1' can't be simulated; give"),
        (lambda m: linear.stepped_sine(m, "T_load", "e", [1], 0), "amplitude must be positive"),
        (lambda m: linear.stepped_sine(m, "T_load", "e", [1], 1, settle=-1), "settle = -1"),
        (lambda m: linear.multisine(m, "T_load", "e", 1, 5, 1, realisations=1), "2 realisations"),
    ],
)
def test_a_measurement_that_makes_no_sense_is_refused(call: Any, message: str) -> None:
    with pytest.raises(linear.LinearError, match=message):
        call(Machine.load("bench"))


# ---------------------------------------------------------------------------------------- files


@pytest.mark.parametrize(
    "text",
    [
        "frequency [Hz],magnitude [dB],phase [deg]\n1,-6.0205999132796239,-90\n10,-20,-180\n",
        "f;Betrag;Amplitude_abs;Phase (rad)\n"
        "1;7;0,5;-1,5707963267948966\n10;8;0,1;-3,141592653589793\n",
        "omega [rad/s]\tgain_dB\tphase_deg\n62.83185307179586\t-20\t180\n"
        "6.283185307179586\t-6.0205999132796239\t270\n",
        "freq,mag,phase\n0,-1,0\n1,-6.0205999132796239,-90\n10,-20,-180\n",
    ],
)
def test_tables_of_every_kind_are_read(text: str, tmp_path: Path) -> None:
    path = tmp_path / "bode.csv"
    path.write_text(text, "utf-8")
    read = linear.read_response(path, input="T", output="w")
    np.testing.assert_allclose(read.frequency_hz, [1, 10])
    np.testing.assert_allclose(read.response, [-0.5j, -0.1], atol=1e-15)
    assert (read.origin, read.output) == ("measured", "w")


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    response = linear.multisine(
        Machine.load("bench"), "theta_ref", "e", 2.0, 2, 1e-5, realisations=2
    )
    path = tmp_path / "bode.csv"
    linear.write_response(response, path)
    back = linear.read_response(path)
    np.testing.assert_allclose(back.response, response.response, rtol=1e-10)
    assert back.coherence is not None
    with pytest.raises(FileError, match="exists already"):
        linear.write_response(response, path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("freq,mag,phase\n1,0.5,-90\n", r"magnitude in dB or absolute\? Say so"),
        ("freq,mag [dB],phase\n1,0.5,-3\n", r"phase in deg or rad\? Say so"),
        ("freq,mag [dB],phase [deg]\n1,2,3\n1,2,3\n", "each there only once"),
        ("freq,mag [dB],phase [deg]\n1,2,3\n2,,3\n3,1,3\n", "line 3: mag is no number"),
        ("freq,mag [V],phase [deg]\n1,2,3\n", "magnitude in 'V': choose one of dB, abs"),
        ("freq,mag [dB]\n1,2\n2,3\n", "no column of phase; there are freq, mag"),
        ("freq,mag [dB],gain [dB],phase [deg]\n1,2,3,4\n", "mag and gain may each be the magn"),
        ("freq,mag [abs],phase [deg]\n1,-2,3\n2,1,1\n", "can't be negative; is it in dB"),
    ],
)
def test_a_table_that_may_mean_two_things_is_refused(
    text: str, message: str, tmp_path: Path
) -> None:
    path = tmp_path / "bode.csv"
    path.write_text(text, "utf-8")
    with pytest.raises(linear.LinearError, match=message):
        linear.read_response(path)


def test_columns_and_units_can_be_said(tmp_path: Path) -> None:
    path = tmp_path / "bode.csv"
    path.write_text("a,b,c\n1,0.5,-90\n", "utf-8")
    names = {"frequency": "a", "magnitude": "b", "phase": "c"}
    read = linear.read_response(path, columns=names, units={"magnitude": "abs", "phase": "deg"})
    np.testing.assert_allclose(read.response, [-0.5j], atol=1e-16)
    with pytest.raises(linear.LinearError, match=r"no column 'x'; there are a, b, c"):
        linear.read_response(path, columns={**names, "frequency": "x"})


def test_measured_drives_are_held_against_each_other(tmp_path: Path) -> None:
    f = np.geomspace(1, 100, 30)
    one = linear.FrequencyResponse(f, np.asarray(1 / (1 + 1j * f / 20), complex), "a", "b")
    two = linear.FrequencyResponse(f[3:], np.asarray(1 / (1 + 1j * f[3:] / 30), complex), "a", "b")
    found = linear.differ(one, two, tolerance_db=1, tolerance_deg=8)
    # the phases part by atan(f/20) - atan(f/30): 8 deg at 11.2 Hz; 1 dB at about 16 Hz
    assert found.from_hz is not None
    assert found.from_hz == pytest.approx(11.2, rel=0.2)
    with pytest.raises(linear.LinearError, match="no overlap"):
        linear.differ(one, linear.FrequencyResponse(f + 200, np.ones(30, complex), "a", "b"))

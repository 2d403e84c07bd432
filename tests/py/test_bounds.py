"""What would not fit into memory is refused in words, before it is asked for."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from dualdrive import Machine, memory
from dualdrive.machine_file.layers import MachineError
from dualdrive.motion import MotionError, parse_motion
from dualdrive.simulation import simulate, usual_step
from dualdrive.traces import TraceError, read

GB = 2**30
TOO_MUCH = r"takes about \S+ [TGM]B of memory, and \S+ [GM]B are free; "


def test_a_run_of_too_many_samples_names_the_step_that_would_do() -> None:
    machine = Machine.load()
    words = rf"^heavy-table-100t: 3\.6e\+09 samples of .*{TOO_MUCH}--output-step \S+s .* would do"
    with pytest.raises(MachineError, match=words) as caught:
        simulate(machine, end=3.6e6, output_step=1e-3)
    step = float(str(caught.value).split("output_step = ")[1].split(")")[0])
    room = memory.room()
    width = 1 + len(machine.core.signals())
    assert 8 * width * 3.6e6 / step < 1.1 * room  # memory comes and goes meanwhile
    assert 8 * width * 3.6e6 / step > room / 6  # the next of 1, 2, 5, 10


def test_a_long_run_is_sampled_a_million_times_unless_more_is_asked_for() -> None:
    """Hours at a sample a millisecond took gigabytes that nobody had asked for."""
    machine = Machine.load("bench")
    run = simulate(machine, end=1200.0, signals=["e"], energy=False)
    assert run.t[1] == pytest.approx(2e-3)
    assert len(run.t) == 600_001
    assert [usual_step(t) for t in (0.0, 60.0, 1000.0, 1001.0, 18000.0, 1e7)] == pytest.approx(
        [1e-3, 1e-3, 1e-3, 2e-3, 2e-2, 10.0]
    )


@pytest.mark.parametrize(
    "words", ["multisine:1mrad,f=1,lines=1000000000000", "cycle:0;1mrad,v=1,a=1,repeats=1000000000"]
)
def test_a_motion_of_too_many_parts(words: str) -> None:
    with pytest.raises(MotionError, match=rf"^motion '.*': \w+: (lines|repeats) = \d+: {TOO_MUCH}"):
        parse_motion(words)


def test_a_curve_of_too_many_knots() -> None:
    machine = Machine.load()
    with pytest.raises(MachineError, match=rf"knots = \(1000000000,\): {TOO_MUCH}give fewer"):
        machine.add("spline@table", coordinate=["angle"], low=[0], high=[1], knots=[10**9])


def limited(code: str, size: int) -> subprocess.CompletedProcess[str]:
    """Run Python with so many bytes of memory that it may map."""
    head = f"import resource; resource.setrlimit(resource.RLIMIT_AS, ({size}, {size}))\n"
    return subprocess.run([sys.executable, "-c", head + code], capture_output=True, text=True)


def test_the_limit_of_a_process_counts() -> None:
    done = limited("from dualdrive import memory; print(memory.free())", 2 * GB)
    assert 0 < float(done.stdout) < 2 * GB


def test_running_out_of_memory_is_told_in_one_line() -> None:
    code = """
import click
from dualdrive_cli._shared import verb
@verb
def hungry():
    return bytearray(2**40)
hungry()
"""
    done = limited(code, 2 * GB)
    assert done.returncode == 1
    assert done.stderr.startswith("dualdrive: out of memory; ask for ")
    assert done.stderr.count("\n") == 1


def table(path: Path, rows: int, odd: dict[int, str] | None = None) -> Path:
    """A table of t, theta_m and note, a number but for the rows in `odd`, counted from 0."""
    lines = ["t [s],theta_m [deg],note"]
    lines += [f"{k}e-3,{k % 360}.5,{(odd or {}).get(k, k % 3)}" for k in range(rows)]
    path.write_text("\n".join(lines) + "\n\n\n")
    return path


def test_a_long_table_takes_little_more_than_its_numbers(tmp_path: Path) -> None:
    rows = 1_500_000
    path = table(tmp_path / "x.csv", rows)
    code = f"""
from dualdrive.traces import read
import pandas, resource
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
trace = read({str(path)!r})
print(len(trace), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""
    length, kilobytes = map(int, limited(code, 8 * GB).stdout.split())
    assert length == rows
    numbers = 4 * rows * 8  # three columns and the numbers of the rows
    assert kilobytes * 1024 < 7 * numbers  # 9.4 where the text is held besides


def test_blocks_of_a_long_table_join_without_a_seam(tmp_path: Path) -> None:
    rows = 120_000  # more than two blocks
    trace = read(table(tmp_path / "x.csv", rows))
    np.testing.assert_array_equal(trace["note"], np.arange(rows) % 3)
    np.testing.assert_allclose(trace.t, np.arange(rows) * 1e-3)
    assert trace.rows[-1] == rows + 1
    trace = read(table(tmp_path / "y.csv", rows, {110_000: "bad", 60_000: ""}))
    assert trace.log["non_numeric"][0].rows == (110_002,)
    assert trace.log["missing"][0].rows == (60_002, 110_002)
    with pytest.raises(TraceError, match=r"a row has 4 cells, .* \(row 90002\)"):
        read(table(tmp_path / "z.csv", rows, {90_000: "1,2"}))


def test_a_quotation_mark_that_is_not_closed_ends_no_block(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text('t,theta_m,note\n0,0,"a\n1,1,b"\n2,2,c\n3,3,c\n\n\n')
    with pytest.raises(TraceError, match="a quotation mark is not closed"):
        read(path)

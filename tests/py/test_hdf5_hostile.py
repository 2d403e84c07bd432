"""HDF5 and MAT files that are damaged, huge, or lead out of themselves."""

from __future__ import annotations

import random
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import numpy.typing as npt
import pytest
from scipy.io import savemat

from dualdrive.files import FileError
from dualdrive.run import load_run
from dualdrive.sweeps import load_sweep
from dualdrive.traces import FileLayout, Trace, TraceError, TraceMap, read

T: npt.NDArray[np.float64] = np.arange(20, dtype=np.float64) * 0.01
SECRET = np.arange(100.0, 120.0)


def recording(path: Path, change: Callable[[h5py.File], None]) -> Path:
    """A good file of t, theta_m and T_1, changed by `change`."""
    with h5py.File(path, "w") as file:
        file["t"], file["theta_m"], file["T_1"] = T, 3 * T, T**2
        change(file)
    return path


def external_link(file: h5py.File) -> None:
    with h5py.File(Path(file.filename).parent / "other.h5", "w") as other:
        other["x"] = SECRET
    file["theta_ref"] = h5py.ExternalLink("other.h5", "x")


def external_storage(file: h5py.File) -> None:
    raw = Path(file.filename).parent / "raw.bin"
    raw.write_bytes(SECRET.tobytes())
    place = [(str(raw), 0, raw.stat().st_size)]
    file.create_dataset("theta_ref", (20,), "f8", external=place)


def virtual(file: h5py.File) -> None:
    with h5py.File(Path(file.filename).parent / "other.h5", "w") as other:
        other["x"] = SECRET
    layout = h5py.VirtualLayout((20,), "f8")
    layout[:] = h5py.VirtualSource("other.h5", "x", (20,))
    file.create_virtual_dataset("theta_ref", layout)


def linked_group(file: h5py.File) -> None:
    external_link(file)
    file["inside/deep"] = h5py.SoftLink("/theta_ref")


@pytest.mark.parametrize("change", [external_link, external_storage, virtual, linked_group])
def test_data_of_another_file_are_not_followed(
    tmp_path: Path, change: Callable[[h5py.File], None]
) -> None:
    path = recording(tmp_path / "x.h5", change)
    with pytest.raises(TraceError, match=r"^x\.h5: \S*theta_ref lies in another file \(.*\)"):
        read(path)


def test_a_soft_link_within_the_file_is_a_channel(tmp_path: Path) -> None:
    def change(file: h5py.File) -> None:
        file["raw/position"] = 2 * T
        file["theta_ref"] = h5py.SoftLink("/raw/position")

    np.testing.assert_allclose(read(recording(tmp_path / "x.h5", change))["theta_ref"], 2 * T)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("theta_ref", T * 1j, "theta_ref is complex, no column of 20 numbers"),
        ("theta_ref", T[:7], "theta_ref is of shape 7, no column of 20 numbers"),
        ("theta_ref", np.zeros((3, 4, 5)), "theta_ref is of shape 3x4x5"),
        ("theta_ref", 5.0, "theta_ref is a single number"),
        ("theta_ref", h5py.SoftLink("/nowhere"), "theta_ref is a link into nothing"),
        ("theta_ref", "text", "theta_ref is not numeric"),
        ("I_2", np.array([(1, 2.0)] * 20, dtype="i4,f8"), "I_2 is not numeric"),
    ],
)
def test_a_channel_never_vanishes_in_silence(
    tmp_path: Path, name: str, value: object, words: str
) -> None:
    path = recording(tmp_path / "x.h5", lambda file: file.__setitem__(name, value))
    with pytest.raises(TraceError, match=words):
        read(path)
    mapping = TraceMap(file=FileLayout(ignore=(name,)))
    assert name not in read(path, mapping)


def test_hard_links_in_a_circle_end(tmp_path: Path) -> None:
    def change(file: h5py.File) -> None:
        group = file.create_group("a")
        group["a"] = group

    assert len(read(recording(tmp_path / "x.h5", change))) == 20


def bomb(file: h5py.File) -> None:
    for name in ("t", "theta_m", "T_1"):
        del file[name]
        file.create_dataset(name, (2**38,), "f8", chunks=(2**20,), compression="gzip")


def one_chunk(file: h5py.File) -> None:
    chunks = (2**28,)  # of 2 GB, unpacked whole for 20 numbers
    for k in range(64):
        file.create_dataset(f"x{k}", (20,), "f8", maxshape=(None,), chunks=chunks)


@pytest.mark.parametrize("change", [bomb, one_chunk])
def test_what_does_not_fit_is_refused_before_it_is_read(
    tmp_path: Path, change: Callable[[h5py.File], None]
) -> None:
    path = recording(tmp_path / "x.h5", change)
    assert path.stat().st_size < 1e6
    words = r"^x\.h5: reading its \d+ numbers takes about \S+ [GT]B of memory, and .* are free"
    with pytest.raises(TraceError, match=words):
        read(path)


def test_what_is_not_used_is_not_read(tmp_path: Path) -> None:
    def change(file: h5py.File) -> None:
        file.create_dataset("image", (2**38,), "f8", chunks=(2**20,), compression="gzip")

    assert "image" in str(read(recording(tmp_path / "x.h5", change)).log)


def test_a_packed_matlab_variable_states_its_size(tmp_path: Path) -> None:
    path = tmp_path / "x.mat"
    savemat(path, {"t": T}, do_compression=True)
    packed = zlib.compress(struct.pack("<II", 14, 2**32 - 8) + bytes(64))
    several = struct.pack("<II", 15, len(packed)) + packed
    path.write_bytes(path.read_bytes() + 64 * several)
    with pytest.raises(TraceError, match=r"^x\.mat: reading its \d+ numbers takes about 1\.1 TB"):
        read(path)


@pytest.mark.long
def test_damage_is_told_with_the_name_of_the_file(tmp_path: Path) -> None:
    good = recording(tmp_path / "good.h5", lambda file: None)
    own = tmp_path / "own.h5"
    Trace(T, {"theta_m": T, "T_1": T}).to_hdf5(own)
    chance = random.Random(1)
    told: list[str] = []
    for source in (good, own):
        data = source.read_bytes()
        for _ in range(150):
            broken = bytearray(data)
            broken[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
            path = tmp_path / "broken.h5"
            path.write_bytes(broken)
            for reader in (read, load_run, load_sweep):
                try:
                    reader(path)
                except (TraceError, FileError) as error:
                    told.append(str(error))
    assert all("broken.h5: " in text for text in told)
    assert len(told) > 300  # two readers refuse every file, the first one some

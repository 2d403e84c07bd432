"""What is fuzzed: each reader with good inputs to begin with, and changes that know its form."""

from __future__ import annotations

import io
import random
import string
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from tempfile import mkdtemp
from typing import Any, Final, cast

import h5py
import numpy as np
from scipy.io import savemat

from dualdrive import Machine
from dualdrive.motion import parse_motion
from dualdrive.simulation import simulate
from dualdrive.traces import guess_mapping, read
from dualdrive.units import conversion, is_unit, parse

from .inputs import MAPPING
from .rows_files import CELLS, _mutated, _sound
from .rows_words import _formula, _unit

Change = Callable[[bytes, random.Random], bytes]

TABLE: Final = "t [s],theta_m [deg],T_1 [N*m],note\n" + "".join(
    f"{k / 100},{k % 7 * 5.5},{-k},run\n" for k in range(40)
)
_DTYPES: Final = ("f8", "f4", "i4", "u1", "c16", "S5", "?", "i8")
_NAMES: Final = ("t", "theta_m", "T_1", "I_1", "x", "omega_m", "", "/", "é", "a" * 300)


@dataclass(frozen=True)
class Target:
    """A reader.

    seeds:  good inputs
    use:    reads one; refusals in words of the project are no failure
    change: damages an input with its form in mind
    """

    seeds: Callable[[], Sequence[bytes]]
    use: Callable[[bytes], object]
    change: Change


def attempt(target: Target, data: bytes) -> None:
    """Use an input; raises whatever is no refusal in words."""
    try:
        target.use(data)
    except ValueError as error:
        if not type(error).__module__.startswith("dualdrive"):
            raise
        if len(str(error)) > 1200:
            raise AssertionError("a message of kilobytes") from None


@cache
def _folder() -> Path:
    return Path(mkdtemp(prefix="fuzz-", dir="/dev/shm" if Path("/dev/shm").is_dir() else None))


def _file(name: str, data: bytes) -> Path:
    path = _folder() / name
    path.write_bytes(data)
    return path


def _text(data: bytes) -> str:
    return data.decode("utf-8", "replace")


# --- uses -------------------------------------------------------------------------------------


def _formulas(data: bytes) -> None:
    machine = Machine.load("bench")
    machine.add("expression@table", formula=_text(data), parameters={"c": 1.0})
    simulate(machine, end=0.002, output_step=1e-3, max_steps=2000)


def _units(data: bytes) -> None:
    text = _text(data)
    is_unit(text)
    for use in (
        partial(conversion, text, "rad"),
        partial(parse, f"1 {text}", "N*m"),
        partial(parse_motion, text),
    ):
        try:
            use()
        except ValueError as error:
            if not type(error).__module__.startswith("dualdrive"):
                raise


def _machines(data: bytes) -> None:
    machine = Machine.from_toml(_text(data))
    simulate(machine, end=0.002, output_step=1e-3, max_steps=2000)


def _mappings(data: bytes) -> None:
    record = _file("record.csv", TABLE.encode())
    _sound(lambda: read(record, _file("record.map.toml", data)))


def _tables(data: bytes) -> None:
    path = _file("table.csv", data)
    try:
        guess_mapping(path)
    except ValueError as error:
        if not type(error).__module__.startswith("dualdrive"):
            raise
    _sound(lambda: read(path))


def _binary(name: str, data: bytes) -> None:
    path = _file(name, data)
    _sound(lambda: read(path))


# --- changes that know the form -----------------------------------------------------------------


def _new_formula(_: bytes, chance: random.Random) -> bytes:
    return _formula(chance, chance.randint(0, 6)).encode()


def _new_unit(_: bytes, chance: random.Random) -> bytes:
    return _unit(chance).encode()


def _new_toml(data: bytes, chance: random.Random) -> bytes:
    text = _text(data)
    return _mutated(text if "=" in text else MAPPING, chance).encode("utf-8", "replace")


def _new_table(data: bytes, chance: random.Random) -> bytes:
    rows = [row.split(",") for row in _text(data).splitlines()] or [[""]]
    for _ in range(chance.randint(1, 4)):
        row = chance.choice(rows[:3] if chance.random() < 0.4 else rows)
        row[chance.randrange(len(row))] = chance.choice(CELLS)[:2000] if row else ""
    return "\n".join(map(",".join, rows)).encode("utf-8", "replace")


def _array(chance: random.Random, length: int) -> Any:
    shape = chance.choice(
        [(), (length,), (length,), (length,), (length, 1), (1, length), (0,), (2, 3, 4)]
    )
    kind = chance.choice(_DTYPES)
    if kind.startswith("S"):
        return np.full(shape, b"word", kind)
    values = np.cumsum(np.ones(shape)) if shape else np.float64(1.0)
    made = np.reshape(values, shape).astype(kind)
    if chance.random() < 0.2 and made.size and kind in ("f8", "f4"):
        huge = 3e38 if kind == "f4" else 1e308
        made.flat[chance.randrange(made.size)] = chance.choice([np.nan, np.inf, huge, -huge])
    return made


def _new_hdf5(data: bytes, chance: random.Random) -> bytes:
    """Half the time a few bytes of a good file, half the time a good file of any content."""
    if chance.random() < 0.5:
        return _flipped(data, chance)
    held, length = io.BytesIO(), chance.choice([1, 2, 20])
    with h5py.File(held, "w") as file:
        group = file.create_group("run") if chance.random() < 0.3 else file
        for name in {chance.choice(_NAMES[:6]) for _ in range(chance.randint(0, 5))}:
            made = _array(chance, length)
            packed = {"compression": "gzip"} if np.size(made) > 1 and chance.random() < 0.3 else {}
            group.create_dataset(name, data=made, **packed)
            if chance.random() < 0.5:
                unit = chance.choice(["rad", "s", "kg^9^9", b"\xff", 3.0, np.zeros(3), ""])
                group[name].attrs[chance.choice(["unit", "units", "long_name"])] = unit
        if chance.random() < 0.3:
            group[chance.choice(("linked", "t2"))] = h5py.SoftLink(
                chance.choice(("/t", "/none", "/run"))
            )
    return held.getvalue()


def _new_mat(data: bytes, chance: random.Random) -> bytes:
    if chance.random() < 0.5:
        return _flipped(data, chance)
    held, length = io.BytesIO(), chance.choice([1, 2, 20])
    columns: dict[str, Any] = {
        chance.choice(_NAMES[:6]): _array(chance, length) for _ in range(chance.randint(1, 5))
    }
    if chance.random() < 0.4:
        columns = {"run": columns}
    if chance.random() < 0.2:
        columns["cell"] = np.array([1, "a", None], dtype=object)[:2]
    savemat(cast("Any", held), columns, do_compression=chance.random() < 0.5)
    return held.getvalue()


def _flipped(data: bytes, chance: random.Random) -> bytes:
    """Headers come first, and so do most of the changes; now and then the end is lost."""
    changed = bytearray(data or b"\0")
    for _ in range(chance.randint(1, 4)):
        at = int(chance.random() ** 3 * len(changed))
        changed[at] = chance.choice(
            [0, 255, changed[at] ^ (1 << chance.randrange(8)), chance.randrange(256)]
        )
    return bytes(
        changed[: int(chance.random() * len(changed))] if chance.random() < 0.1 else changed
    )


# --- good inputs --------------------------------------------------------------------------------


def _good_machines() -> list[bytes]:
    return [Machine.load(name).toml().encode() for name in ("bench", "linear-axis")]


def _good_hdf5() -> list[bytes]:
    path = _folder() / "good.h5"
    read(_file("good.csv", TABLE.encode())).to_hdf5(path)
    return [path.read_bytes()]


def _good_mat() -> list[bytes]:
    held = io.BytesIO()
    savemat(cast("Any", held), {"t": 0.01 * np.arange(40.0), "theta_m": np.arange(40.0) % 7})
    return [held.getvalue()]


_FORMULAS: Final = (b"-c*speed", b"if(speed>0,c,-c)*tanh(angle)", b"c*sin(2*pi*angle)+min(c,t)")
_UNITS: Final = (
    b"kg*m^2",
    b"arcsec/s",
    b"move:0.1,v=1,a=2",
    b"cycle:0;1;0,v=1mrad/s,a=2,dwell=1",
    string.printable.encode(),
)

TARGETS: Final[dict[str, Target]] = {
    "formulas": Target(lambda: _FORMULAS, _formulas, _new_formula),
    "words": Target(lambda: _UNITS, _units, _new_unit),
    "machines": Target(_good_machines, _machines, _new_toml),
    "mappings": Target(lambda: [MAPPING.encode()], _mappings, _new_toml),
    "tables": Target(lambda: [TABLE.encode()], _tables, _new_table),
    "hdf5": Target(_good_hdf5, partial(_binary, "fuzz.h5"), _new_hdf5),
    "mat": Target(_good_mat, partial(_binary, "fuzz.mat"), _new_mat),
}

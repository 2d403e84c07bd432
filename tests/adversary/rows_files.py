"""Attempts by files: machine files, mappings, tables and binaries, damaged with their form in mind."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np

from dualdrive.run import load_run
from dualdrive.sweeps import load_sweep
from dualdrive.traces import guess_mapping, read

from .attempt import Attempt
from .inputs import MAPPING

#: TOML values in place of the one that belongs there
VALUES: Final = (
    "", "{}", "[]", "{value={}}", "{value=[]}", "true", '""', '" "', "-1", "0", "1e308", "-1e308", "1e-320",
    "inf", "nan", "-inf", "1_0", "0x7fffffffffffffff", "9" * 25, "9" * 400, "9" * 5000, f'"{"9" * 400}"',
    '"kg^9^9^9^9"', '"1 kg^9^9^9^9"', '"1 m"', '"150%"', '"1e400 rad"', '"\\u0000"', f'"{"a" * 5000}"',
    "1979-05-27T07:32:00Z", "[[1,2],[3]]", "{a={b={c={d=1}}}}", "[" * 500 + "]" * 500, '"\\uFFFF"',
    '["a", 1]', "'''\nx\n'''", '{value="22arcsec", frame="moon"}', '{value=1e308, measure="full"}',
)  # fmt: skip
CELLS: Final = (
    "", "nan", "inf", "-inf", "1e308", "-1e308", "1e-320", "1e999", "1_0", "٣", "0x10", "9" * 400, "a" * 200_000,
    '"', "'", ",", ";", "\0", "True", "1.2.3", "--1", "1,5", "#N/A", "\t", "\r", "\x85", "é",
)  # fmt: skip


def _mutated(text: str, chance: random.Random) -> str:
    """A TOML text of which a value, a key, a table or a character is another."""
    rows = text.splitlines()
    for _ in range(chance.randint(1, 2)):
        with_value = [k for k, row in enumerate(rows) if "=" in row]
        k = chance.choice(with_value)
        key = rows[k].partition("=")[0]
        match chance.randrange(7):
            case 0 | 1 | 2:
                rows[k] = f"{key}= {chance.choice(VALUES)}"
            case 3:
                name = chance.choice(("", "x", "a.b", "1", '"é"'))
                rows[k] = f"{name}= {rows[k].partition('=')[2]}"
            case 4:
                rows.insert(
                    k,
                    chance.choice([rows[k], "[x]", "[[x]]", "[table]", "[effects]", "base = '.'"]),
                )
            case 5:
                del rows[k]
            case _:
                rows[k] = rows[k][: chance.randrange(len(rows[k]))]
        if not any("=" in row for row in rows):
            break
    return "\n".join(rows)


def machine_files(chance: random.Random) -> Iterator[Attempt]:
    """Machine files of which a line or two are others, shown and run."""
    from importlib.resources import files

    presets = sorted((files("dualdrive") / "presets").iterdir(), key=lambda item: item.name)
    texts = [item.read_text("utf-8") for item in presets if item.name.endswith(".toml")]
    texts += [chance.choice(texts) + extra for extra in EXTRAS * 3]
    for k in range(260):
        text = _mutated(chance.choice(texts), chance)
        verb = ("machine", "show") if k % 2 else ("simulate",)
        more = () if k % 2 else ("--end", "0.02", "--output-step", "5ms")
        yield _file(f"machine file {k}", "hostile.toml", text.encode("utf-8", "replace"),
                    arguments=[*verb, "hostile.toml", *more])  # fmt: skip


EXTRAS: Final = (
    '\n[[effects]]\neffect = "spline"\nplace = "table"\ncoordinate = "angle"\nlow = 0\nhigh = 1\nknots = 5\n',
    '\n[[effects]]\neffect = "expression"\nplace = "table"\nformula = "-c*speed"\nparameters = { c = "1 N*m*s/rad" }\n',
    '\n[[effects]]\neffect = "coulomb"\nplace = "table"\ntorque = 3\n',
    '\n[[history]]\ntime = "now"\nwhat = "nothing"\ncommand = ""\n',
)  # fmt: skip


def broken_text(chance: random.Random) -> Iterator[Attempt]:
    """Machine files, mappings and drive tables of any bytes, too deep, or of devices."""
    good = Path("machine.toml")
    made: list[Callable[[], bytes]] = [
        lambda: b"a=" + b"[" * 100_000,
        lambda: b"a=" + b"{a=" * 100_000,
        lambda: b".".join([b"a"] * 50_000) + b" = 1",
        lambda: b"schema = 1\nbase = 'x\\u0000y'",
        lambda: b'schema = 1\nbase = "x\\u0000y"',
        lambda: b"schema = 1\nbase = 'hostile.toml'",
        lambda: b"schema = 1\nbase = '" + b"n" * 300 + b"'",
        lambda: b"schema = " + b"1" * 5000,
        lambda: b"\0" * 1000,
        lambda: bytes(range(256)),
        lambda: b"\xff\xfe" + "schema = 1".encode("utf-16-le"),
        lambda: b"a = 1\n" * 200_000,
    ]
    for _ in range(30):
        at, bit = chance.random(), chance.randrange(8)
        made.append(lambda at=at, bit=bit: _flip(good.read_bytes(), at, bit))  # type: ignore[misc]
    for k, make in enumerate(made):
        prepare = partial(_write, "hostile.toml", make)
        for arguments in (["machine", "show", "hostile.toml"],
                          ["compare", "machine.toml", "record.csv", "--map", "hostile.toml"],
                          ["tune", "bench", "--until", "1", "--parameters", "hostile.toml"]):  # fmt: skip
            if k < 12 or arguments[0] == "machine":
                yield Attempt(f"text {k}: {' '.join(arguments)}", arguments, prepare=prepare)


def mappings(chance: random.Random) -> Iterator[Attempt]:
    """Mappings of which a line or two are others, and a record read by them."""
    keys = (
        "[file]\n", "[time]\n", '[columns."theta_m"]\n', '[columns."T_1"]\n', "[rows]\n", "[split]\n"
    )  # fmt: skip
    more = (
        "format", "encoding", "delimiter", "decimal", "header_line", "names", "missing", "group", "ignore",
        "column", "unit", "sample_time", "wrap", "gap", "backwards", "repeated", "zero", "channel", "sign",
        "scale", "offset", "of", "radius", "current", "sign_bit", "reset", "long_name", "keep", "drop", "by",
        "settle", "min_time",
    )  # fmt: skip
    for k in range(180):
        text = MAPPING
        if chance.random() < 0.7:
            head = chance.choice(keys)
            line = f"{chance.choice(more)} = {chance.choice(VALUES)}\n"
            text = text.replace(head, head + line) if head in text else f"{text}{head}{line}"
        else:
            text = _mutated(text, chance)
        name = chance.choice(["record.csv", "record.mat", "trace.h5"])
        yield _file(f"mapping {k} of {name}", "hostile.toml", text.encode("utf-8", "replace"),
                    call=partial(_sound, partial(read, name, "hostile.toml")))  # fmt: skip


def tables(chance: random.Random) -> Iterator[Attempt]:
    """Records as text of which cells, lines or ends are others."""
    for k in range(160):
        change = partial(_damaged_table, chance.getrandbits(64))
        yield Attempt(f"table {k}", call=partial(_sound, _read_or_guess),
                      prepare=partial(_write, "hostile.csv", change))  # fmt: skip


def _read_or_guess() -> Any:
    try:
        guess_mapping("hostile.csv")
    except ValueError as error:
        if not type(error).__module__.startswith("dualdrive"):
            raise
    return read("hostile.csv")


def _damaged_table(seed: int) -> bytes:
    chance = random.Random(seed)
    rows = [row.split(",") for row in Path("record.csv").read_text().splitlines()[:600]]
    for _ in range(chance.randint(1, 6)):
        k = chance.randrange(len(rows)) if chance.random() < 0.7 else 0
        match chance.randrange(6):
            case 0 | 1:
                rows[k][chance.randrange(len(rows[k]))] = chance.choice(CELLS)
            case 2:
                rows[k] = rows[k][: chance.randrange(len(rows[k]) + 1)] or [""]
            case 3:
                rows.insert(k, rows[chance.randrange(len(rows))])
            case 4:
                column = chance.randrange(len(rows[-1]))
                cell = chance.choice(CELLS)
                for row in rows[1:]:
                    if column < len(row):
                        row[column] = cell
            case _:
                units = ("kg^9^9^9^9", "%", "rad", "x" * 500, "")
                rows[0] = [f"{name} [{chance.choice(units)}]" for name in rows[0]]
    text = chance.choice(["\n", "\r\n", "\r"]).join(map(chance.choice([",", ";", "\t"]).join, rows))
    return text.encode(chance.choice(["utf-8", "utf-16", "cp1252"]), "replace")


def binaries(chance: random.Random) -> Iterator[Attempt]:
    """HDF5 and MAT files with flipped bits or cut short, read as trace, run and sweep."""
    readers: dict[str, tuple[Callable[[str], Any], ...]] = {
        "run.h5": (read, load_run, load_sweep),
        "trace.h5": (read,),
        "record.mat": (read,),
        "packed.mat": (read,),
    }
    for name, ways in readers.items():
        for k in range(90):
            at, bit, cut = chance.random(), chance.randrange(8), k % 6 == 0
            early = at**4 if chance.random() < 0.6 else at  # headers come first
            make = partial(_cut if cut else _flip_file, name, early, bit)
            hostile = f"hostile{Path(name).suffix}"
            reader = chance.choice(ways)
            yield Attempt(f"{name} {k}: {reader.__name__}", call=partial(_named, reader, hostile),
                          prepare=partial(_write, hostile, make))  # fmt: skip


def links(_: random.Random) -> Iterator[Attempt]:
    """HDF5 files that lead out of themselves, in circles, or claim more than they hold."""

    def made(change: Callable[[h5py.File], None]) -> Callable[[], None]:
        def make() -> None:
            Path("secret.bin").write_bytes(np.arange(2000.0).tobytes())
            with h5py.File("other.h5", "w") as other:
                other["x"] = np.arange(20.0)
            with h5py.File("hostile.h5", "w") as file:
                file["t"], file["theta_m"] = np.arange(20) * 0.01, np.zeros(20)
                change(file)

        return make

    def external(file: h5py.File) -> None:
        file["T_1"] = h5py.ExternalLink("other.h5", "x")

    def storage(file: h5py.File) -> None:
        file.create_dataset("T_1", (20,), "f8", external=[("secret.bin", 0, 160)])

    def passwords(file: h5py.File) -> None:
        file.create_dataset("T_1", (20,), "u1", external=[("/etc/passwd", 0, 20)])

    def virtual(file: h5py.File) -> None:
        layout = h5py.VirtualLayout((20,), "f8")
        layout[:] = h5py.VirtualSource("other.h5", "x", (20,))
        file.create_virtual_dataset("T_1", layout)

    def circle(file: h5py.File) -> None:
        file["a"], file["b"] = h5py.SoftLink("/b"), h5py.SoftLink("/a")
        file["T_1"] = h5py.SoftLink("/a")
        file.create_group("g")["g"] = file["/"]

    def bomb(file: h5py.File) -> None:
        for name in ("t", "theta_m"):
            del file[name]
            file.create_dataset(name, (2**36,), "f8", chunks=(2**18,), compression="gzip")

    def chunk(file: h5py.File) -> None:
        for k in range(16):
            file.create_dataset(f"x{k}", (20,), "f8", maxshape=(None,), chunks=(2**28,))

    def deep(file: h5py.File) -> None:
        group = file
        for _ in range(3000):
            group = group.create_group("g")

    def wide(file: h5py.File) -> None:
        for k in range(3000):
            file[f"x{k}"] = np.zeros(20)

    def odd(file: h5py.File) -> None:
        file["T_1"] = np.zeros(20, complex)

    def short(file: h5py.File) -> None:
        file["T_1"] = np.zeros(7)

    for change in (
        external,
        storage,
        passwords,
        virtual,
        circle,
        bomb,
        chunk,
        deep,
        wide,
        odd,
        short,
    ):
        ways: tuple[tuple[Callable[[str], Any], tuple[int, ...]], ...] = (
            (read, (0,) if change is wide else (2,)),
            (load_run, (2,)),
        )
        for way, allowed in ways:
            ends = (0, 2) if change is deep else allowed
            yield Attempt(f"{change.__name__}: {way.__name__}", call=partial(_named, way, "hostile.h5"),
                          prepare=made(change), allowed=ends)  # fmt: skip


# --- shared ---------------------------------------------------------------------------------------


def _write(name: str, make: Callable[[], bytes]) -> None:
    Path(name).write_bytes(make())


def _file(what: str, name: str, content: bytes, **more: Any) -> Attempt:
    return Attempt(what, prepare=partial(_write, name, lambda: content), **more)


def _flip(data: bytes, at: float, bit: int) -> bytes:
    changed = bytearray(data)
    changed[int(at * len(data))] ^= 1 << bit
    return bytes(changed)


def _flip_file(name: str, at: float, bit: int) -> bytes:
    return _flip(Path(name).read_bytes(), at, bit)


def _cut(name: str, at: float, _: int) -> bytes:
    data = Path(name).read_bytes()
    return data[: int(at * len(data))]


def _sound(reading: Callable[[], Any]) -> None:
    """A trace that was read is one: time increases and every number is finite."""
    trace = reading()
    if not (np.diff(trace.t) > 0).all() or len(trace) < 2:
        raise AssertionError("time does not increase")
    for name, values in trace.channels.items():
        if not np.isfinite(values).all():
            raise AssertionError(f"{name} is not finite")


def _named(reader: Callable[[str], Any], name: str) -> None:
    """What is refused is refused with the name of the file."""
    try:
        found = reader(name)
    except ValueError as error:
        if type(error).__module__.startswith("dualdrive") and name not in str(error):
            raise AssertionError(f"no file name in: {error}") from None
        raise
    if reader is read:
        _sound(lambda: found)

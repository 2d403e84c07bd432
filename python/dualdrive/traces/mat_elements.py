"""What a MAT file of version 5 claims to hold, before a library believes it.

SciPy's reader trusts sizes and flags: a matrix that is marked as complex and has no imaginary part
ends the process. So every element is looked at first: it lies within the one that holds it, its
type is known, and it holds as many numbers as its dimensions say (MAT-File Format, The MathWorks,
chapter 1).
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from math import prod
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Final, NamedTuple

__all__ = ["MatError", "check_elements"]

_HEADER: Final = 128  # bytes of text before the first variable
#: types of elements -> bytes of one number
_SIZES: Final = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}
_TEXT: Final = {1, 2, 4, 16, 17, 18}  # what characters are kept as
_MATRIX, _PACKED = 14, 15
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE = 1, 2, 3, 4, 5
_NUMERIC: Final = range(6, 16)  # classes of plain arrays
_FOREIGN: Final = (16, 17)  # functions and opaque objects, which the library does not look into
_COMPLEX: Final = 0x0800
_DEEPEST: Final = 50  # structures within structures


class MatError(ValueError):
    """A file that is not what it says; the message says where."""


class _Element(NamedTuple):
    kind: int
    data: memoryview

    def numbers(self, what: str) -> int:
        """How many numbers it holds."""
        if self.kind not in _SIZES:
            raise MatError(f"{what} is kept as type {self.kind}, which is none of a number")
        return len(self.data) // _SIZES[self.kind]


def check_elements(path: Path) -> None:
    """Look at every element of a file of version 5; of version 4 at nothing.

    Raises:
        MatError: one that is damaged.

    """
    if path.stat().st_size <= _HEADER:
        return
    with path.open("rb") as file:
        whole = memoryview(mmap(file.fileno(), 0, access=ACCESS_READ))  # closed with its last view
    mark = bytes(whole[_HEADER - 2 : _HEADER])
    if mark in (b"IM", b"MI"):
        _check_all(whole[_HEADER:], "<" if mark == b"IM" else ">")


def _check_all(variables: memoryview, order: str) -> None:
    for element in _elements(variables, order):
        if element.kind != _PACKED:
            _check(element, order, 0)
            continue
        for inner in _elements(memoryview(_unpacked(element.data, order)), order):
            _check(inner, order, 0)


def _unpacked(data: memoryview, order: str) -> bytes:
    """A packed variable, as far as it says that it goes on."""
    unpack = zlib.decompressobj()
    try:
        tag = unpack.decompress(data, 8)
        if len(tag) < 8:
            raise MatError("a packed variable that holds nothing")
        (size,) = struct.unpack_from(f"{order}I", tag, 4)
        return tag + unpack.decompress(unpack.unconsumed_tail, max(size, 1))
    except zlib.error as error:
        raise MatError(f"a packed variable can't be unpacked: {error}") from None


def _elements(data: memoryview, order: str) -> Iterator[_Element]:
    """The elements one after the other, each with its padding left out."""
    at = 0
    while at + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, at)
        if kind >> 16:  # a small one, in the tag itself
            kind, size = kind & 0xFFFF, kind >> 16
            if size > 4:
                raise MatError(f"a small element of {size} bytes, where 4 is the most")
            yield _Element(kind, data[at + 4 : at + 4 + size])
            at += 8
            continue
        if size > len(data) - at - 8:
            raise MatError(f"an element of {size} bytes, where {len(data) - at - 8} follow")
        yield _Element(kind, data[at + 8 : at + 8 + size])
        at += 8 + size + (-size % 8 if kind != _PACKED else 0)


def _check(element: _Element, order: str, depth: int) -> None:
    """One variable, or a part of one."""
    if element.kind != _MATRIX:
        raise MatError(f"an element of type {element.kind}, where a variable should be")
    if not len(element.data):
        return  # an empty cell
    if depth > _DEEPEST:
        raise MatError(f"structures more than {_DEEPEST} deep")
    inside = _elements(element.data, order)
    flags, dims = _next(inside, "flags"), _next(inside, "dimensions")
    if len(flags.data) < 8 or dims.kind not in (5, 6) or len(dims.data) < 8:
        raise MatError("a variable without its class and dimensions")
    (word,) = struct.unpack_from(f"{order}I", flags.data)
    sizes = struct.unpack(f"{order}{len(dims.data) // 4}i", dims.data)
    if min(sizes) < 0:
        raise MatError(f"dimensions {', '.join(map(str, sizes))}")
    kind, complex_, count = word & 0xFF, bool(word & _COMPLEX), prod(sizes)
    name = _next(inside, "its name")
    if name.kind not in _TEXT:
        raise MatError(f"a name kept as type {name.kind}")
    if kind in _NUMERIC:
        _numbers(inside, count, complex_)
    elif kind == _CHAR:
        text = _next(inside, "its text")
        if text.kind not in _TEXT:
            raise MatError(f"text kept as type {text.kind}")
    elif kind == _SPARSE:
        rows, columns = _next(inside, "rows"), _next(inside, "columns")
        stored = rows.numbers("rows")
        starts = struct.unpack_from(f"{order}{columns.numbers('columns')}i", columns.data)
        if len(sizes) != 2 or len(starts) != sizes[1] + 1 or list(starts) != sorted(starts):
            raise MatError("a sparse variable whose columns do not begin one after the other")
        if starts[0] != 0 or starts[-1] > stored:
            raise MatError("a sparse variable whose columns begin where there is nothing")
        _numbers(inside, None, complex_)
    elif kind == _CELL:
        _parts(inside, count, order, depth)
    elif kind in (_STRUCT, _OBJECT):
        _structure(inside, count, order, depth, named=kind == _OBJECT)
    elif kind not in _FOREIGN:
        raise MatError(f"a variable of class {kind}, which is none")


def _next(inside: Iterator[_Element], what: str) -> _Element:
    found = next(inside, None)
    if found is None:
        raise MatError(f"a variable ends before {what}")
    return found


def _numbers(inside: Iterator[_Element], count: int | None, complex_: bool) -> None:
    parts = ("its numbers", "its imaginary part") if complex_ else ("its numbers",)
    for what in parts:
        held = _next(inside, what).numbers(what)
        if count is not None and held != count:
            raise MatError(f"{held} numbers, where the dimensions want {count}")


def _structure(
    inside: Iterator[_Element], count: int, order: str, depth: int, *, named: bool
) -> None:
    if named:
        _next(inside, "its class")
    length, names = _next(inside, "the length of names"), _next(inside, "the names of its fields")
    if len(length.data) != 4:
        raise MatError("a structure that does not say how long its names are")
    (each,) = struct.unpack_from(f"{order}i", length.data)
    if each < 1 or len(names.data) % each:
        raise MatError(f"{len(names.data)} bytes of names, each {each} long")
    _parts(inside, count * (len(names.data) // each), order, depth)


def _parts(inside: Iterator[_Element], count: int, order: str, depth: int) -> None:
    found = 0
    for element in inside:
        _check(element, order, depth + 1)
        found += 1
    if found < count:
        raise MatError(f"{found} parts, where the dimensions want {count}")

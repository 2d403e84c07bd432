"""Frequency measurements as a SINUMERIK control saves them: XML with arrays in base 85.

The control averages spectra of what it put in, x, and of what came out, y: S_xx, S_yy and, between
both, the conjugate of S_xy = conj(X) Y. The response is S_xy / S_xx, the coherence
|S_xy|^2 / (S_xx S_yy). There is no published description of the layout; it is read off a file of an
840D sl (4.7), tests/py/exports/sinumerik_response.xml.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from dualdrive.linear.errors import LinearError
from dualdrive.linear.response import FrequencyResponse

__all__ = ["is_measurement", "read_measurement"]

_ROOT: Final = "ResponseTestCustom"
#: digits of base 85; five make four bytes, and a full stop stands for four bytes of zero
_DIGITS: Final = {
    digit: value
    for value, digit in enumerate(
        "0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ!#$`()*+-/:;=?@[]^_{|}~"
    )
}


def is_measurement(path: Path) -> bool:
    """Whether a file begins like one. Raises OSError where it can't be read."""
    with path.open("rb") as file:
        return f"<{_ROOT}".encode() in file.read(4096)


def read_measurement(path: Path, *, input: str = "", output: str = "") -> FrequencyResponse:  # noqa: A002
    """Read the response that was measured. Raises LinearError naming file and what is wrong."""
    text = path.read_bytes()
    if b"<!DOCTYPE" in text:
        raise LinearError(f"{path}: defines a document type of its own; no control writes that")
    try:
        return _response(ElementTree.fromstring(text), path, input, output)
    except ElementTree.ParseError as error:
        raise LinearError(f"{path}: no XML, or cut off: {error}") from None
    except _LayoutError as missing:
        raise LinearError(f"{path}: {missing}") from None


class _LayoutError(ValueError):
    """Something that a measurement must have."""


def _response(
    root: ElementTree.Element, path: Path, put_in: str, came_out: str
) -> FrequencyResponse:
    first = _find(root, ".//PrimaryFreqRespSigNodeData")
    x, y = (
        _node(root, _text(first, f"m_i{n}SigNodeUniqueInstanceID")) for n in ("Input", "Output")
    )
    number = _text(x, "m_uNodeId")
    crossed = [
        one
        for one in y.iterfind("./LinkedList[@name='m_crossSpecInfoList']/SigNodeCrossSpectrumInfo")
        if _text(one, "m_uSignodeId") == number
    ]
    if not crossed:
        raise _LayoutError(f"no cross spectrum of the output with signal {number}, the input")
    f = _array(crossed[0] if _has_frequencies(crossed[0]) else y, "m_FrequencyVector")
    spectra = [_complex(part) for part in (crossed[0], _auto(x), _auto(y))]
    if any(one.size != f.size for one in spectra):
        sizes = ", ".join(str(one.size) for one in (f, *spectra))
        raise _LayoutError(f"frequencies and spectra differ in length: {sizes}")
    if not (np.isfinite(f).all() and all(np.isfinite(one).all() for one in spectra)):
        raise _LayoutError("a spectrum has values that are no numbers")
    told = (f > 0.0) & (spectra[1].real > 0.0) & (spectra[2].real > 0.0)
    if not told.any() or (np.diff(f) <= 0.0).any():
        raise _LayoutError("frequencies must rise, and there must be power at some above 0 Hz")
    s_yx, s_xx, s_yy = (one[told] for one in spectra)
    averaged = _text(crossed[0], "m_uNumSpectraInAvg")
    return FrequencyResponse(
        frequency_hz=f[told],
        response=s_yx.conj() / s_xx.real,
        input=put_in or f"signal {number}",
        output=came_out or f"signal {_text(y, 'm_uNodeId')}",
        unit="",
        note=f"{path}; {averaged} spectra averaged; {int((~told).sum())} without power left out",
        coherence=np.minimum(np.abs(s_yx) ** 2 / (s_xx.real * s_yy.real), 1.0),
        origin="measured",
    )


def _node(root: ElementTree.Element, instance: str) -> ElementTree.Element:
    for node in root.iter("PlatformSignalNode"):
        if _text(node, "m_iUniqueInstanceId") == instance:
            return node
    raise _LayoutError(f"no signal of instance {instance}")


def _auto(node: ElementTree.Element) -> ElementTree.Element:
    return _find(node, "./SigNodeCrossSpectrumInfo[@name='m_autospectrumInfo']")


def _has_frequencies(part: ElementTree.Element) -> bool:
    return part.find(".//NumericArray[@name='m_FrequencyVector']") is not None


def _complex(part: ElementTree.Element) -> NDArray[np.complex128]:
    pairs = _array(part, "m_ValueVector")
    if pairs.size % 2:
        raise _LayoutError("a complex spectrum of an odd number of parts")
    return np.asarray(pairs[::2] + 1j * pairs[1::2])


def _array(part: ElementTree.Element, name: str) -> NDArray[np.float64]:
    text = _text(_find(part, f".//NumericArray[@name='{name}']"), "m_pNumberArray")
    data = b"".join(_words("".join(text.split())))
    if len(data) % 8:
        raise _LayoutError(f"{name} ends within a number")
    return np.frombuffer(data, ">f8").astype(float)


def _words(text: str) -> Iterator[bytes]:
    """Four bytes each."""
    at = 0
    while at < len(text):
        if text[at] == ".":
            at += 1
            yield bytes(4)
            continue
        value = 0
        for digit in text[at : at + 5]:
            if digit not in _DIGITS:
                raise _LayoutError(f"{digit!r} is no digit of an array")
            value = 85 * value + _DIGITS[digit]
        if len(text) < at + 5 or value >= 1 << 32:
            raise _LayoutError("an array ends within a number, or holds none")
        at += 5
        yield struct.pack(">I", value)


def _find(part: ElementTree.Element, where: str) -> ElementTree.Element:
    found = part.find(where)
    if found is None:
        raise _LayoutError(f"no {where.lstrip('./')}; measure again and save the spectra")
    return found


def _text(part: ElementTree.Element, name: str) -> str:
    return (_find(part, f"./*[@name='{name}']").text or "").strip()

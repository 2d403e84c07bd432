"""How results that have a picture show themselves in a notebook."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import ClassVar

__all__ = ["Displayed", "Tabled"]


class Displayed:
    """A result that a notebook shows as its picture, with its table where it has one.

    picture: the function of :mod:`dualdrive.plots` that draws it
    """

    __slots__ = ()
    _picture: ClassVar[str]

    def __init_subclass__(cls, *, picture: str) -> None:
        cls._picture = picture
        super().__init_subclass__()

    def _repr_html_(self) -> str:
        import dualdrive  # its lazy name: how a notebook shows things knows of results

        return dualdrive.notebook.pictured(self, self._picture)


class Tabled:
    """A result that a notebook shows as a table; ``_cells()`` has its head and its rows."""

    __slots__ = ()

    def _cells(self) -> tuple[Sequence[str], Iterable[Sequence[str]]]:
        raise NotImplementedError

    def _repr_html_(self) -> str:
        import dualdrive  # as above

        return dualdrive.notebook.tabled(type(self).__name__, *self._cells())

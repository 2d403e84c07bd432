"""How results that have a picture show themselves in a notebook."""

from __future__ import annotations

from typing import ClassVar

__all__ = ["Displayed"]


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

"""Files that come from the page: names looked at first, sizes counted, whole or not at all."""

from __future__ import annotations

from collections.abc import AsyncIterator, Mapping
from pathlib import Path
from typing import Protocol

from dualdrive.files import FileError
from dualdrive.memory import in_words
from dualdrive.traces import read_mapping
from dualdrive.workbench.limits import MOST_MACHINE, MOST_UPLOAD
from dualdrive.workbench.names import MACHINES, accepted
from dualdrive.workbench.story import Story

__all__ = ["Body", "receive"]


class Body(Protocol):
    """A request as far as it is needed here."""

    @property
    def headers(self) -> Mapping[str, str]: ...  # noqa: D102
    def stream(self) -> AsyncIterator[bytes]: ...  # noqa: D102


async def receive(story: Story, name: str, body: Body) -> None:
    """Take a file in. Raises FileError naming name, rule and way out; nothing is left then."""
    name = accepted(name)
    project = story.project
    if not name.lower().endswith(MACHINES):
        ident, place = project.place_for(name)
        await _write(body, place, name, MOST_UPLOAD)
        project.take_in(ident, place, None)
        return
    place = project.path(f"models/{project.name('u')}-{name}")
    await _write(body, place, name, MOST_MACHINE)
    try:
        if name.lower().endswith(".map.toml"):
            _map(story, name, place)
            place.unlink()
        else:
            story.machine(name=name, path=place)
    except BaseException:
        place.unlink(missing_ok=True)
        raise


def _map(story: Story, name: str, place: Path) -> None:
    """A mapping goes to the recording of its name, or to all that could not be read."""
    mapping, stem = read_mapping(place).as_dict(), name[: -len(".map.toml")]
    own = [t for t in story.project.now["traces"] if t["name"] == stem]
    if not own:
        results = [(t, story.result(story.read_key(t))) for t in story.project.now["traces"]]
        own = [t for t, read in results if read is not None and not read["ok"]]
    if not own:
        raise FileError(f"{name}: no recording {stem} here that it could map; drop that first")
    with story.project.change(f"mapping {name}"):
        for told in own:
            told["map"] = mapping


async def _write(body: Body, place: Path, name: str, most: int) -> None:
    """The body into a file that is there whole or not at all."""
    length = body.headers.get("content-length", "")
    too_long = FileError(f"{name}: more than {in_words(most)}; record less, or decimate it first")
    if length.isdecimal() and int(length) > most:
        raise too_long
    part, count = place.with_name(f".{place.name}.part"), 0
    try:
        with part.open("xb") as file:
            async for piece in body.stream():
                count += len(piece)
                if count > most:
                    raise too_long
                file.write(piece)
        if not count:
            raise FileError(f"{name}: the file is empty")
        part.replace(place)
    except OSError as error:
        if isinstance(error, FileError):
            raise
        raise FileError(f"{name}: cannot be kept: {error.strerror}") from None
    finally:
        part.unlink(missing_ok=True)

"""The files that a verb reads and writes, and the one rule that holds for all of them.

An output replaces nothing unless --overwrite says so, never one of the inputs, and never another
output; one process at a time computes what goes to it. That is looked at before anything else is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import click
from click.shell_completion import CompletionItem

from dualdrive.files import (
    FileError,
    WriteError,
    claim,
    make_folder,
    refuse_replacing,
    refuse_unwritable,
    same_file,
)


class _Name(click.ParamType):  # type: ignore[type-arg]  # generic in new click only
    """The name of a file or folder; the shell completes it."""

    name = "file"

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Let the shell look for files."""
        return [CompletionItem(incomplete, type="file")]


class Reads(_Name):
    """A file that is read."""

    def convert(
        self, value: str | Path, param: click.Parameter | None, ctx: click.Context | None
    ) -> Path | str:
        """As a path."""
        return Path(value)

    def files(self, value: Path | str) -> Iterator[Path]:
        """What is read where this is named, which may be more than one file."""
        yield Path(value)


class ReadsTrace(Reads):
    """A recording, with the mapping beside it."""

    def files(self, value: Path | str) -> Iterator[Path]:
        """The recording and its mapping."""
        from dualdrive.traces.mapping_file import find_mapping

        yield Path(value)
        if (mapping := find_mapping(value)) is not None:
            yield mapping


class ReadsMachine(Reads):
    """A machine file or the name of a preset; stays as it was typed."""

    def convert(
        self, value: str | Path, param: click.Parameter | None, ctx: click.Context | None
    ) -> Path | str:
        """As it is."""
        return value

    def files(self, value: Path | str) -> Iterator[Path]:
        """The machine file and those it rests on."""
        from dualdrive.machine_file.layers import preset_names, read_layers

        if str(value) in preset_names():
            return
        yield Path(value)
        try:
            yield from (Path(layer.where) for layer in read_layers(value))
        except (ValueError, OSError, RecursionError):
            return  # what is wrong with it is told where the machine is loaded

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """The presets that begin like this, and else files."""
        from dualdrive.machine_file.layers import preset_names

        names = [name for name in preset_names() if name.startswith(incomplete)]
        return [CompletionItem(name) for name in names] or super().shell_complete(
            ctx, param, incomplete
        )


@dataclass(frozen=True)
class Writes(_Name):
    """A file that is written.

    content:  what it is, where its ending says in which form: a picture, a table
    endings:  those that are known
    stdout:   "-" stands for standard output; the value stays text
    resumed:  --resume goes on with what is there
    """

    content: str = "file"
    endings: Sequence[str] = ()
    stdout: bool = False
    resumed: bool = False

    def convert(
        self, value: str | Path, param: click.Parameter | None, ctx: click.Context | None
    ) -> Path | str:
        """Refuse a name that can't be before anything is computed for it."""
        text = str(value)
        if self.stdout and text == "-":
            return text
        if text in ("", "-", "."):
            self.fail(f"{text!r} names no file; only --json - writes to standard output", param)
        if self.endings and Path(text).suffix.lower() not in self.endings:
            *first, last = self.endings
            self.fail(f"{text}: a {self.content} ends in {', '.join(first)} or {last}", param)
        return text if self.stdout else Path(text)

    @property
    def ways(self) -> str:
        """What else there is to do with a file that is there already."""
        ways = "--resume completes it, --overwrite replaces it, -o names another"
        return ways if self.resumed else ""

    def files(self, value: Path | str, params: Mapping[str, Any]) -> Iterator[Path]:
        """The file, unless it is standard output or one that is resumed."""
        goes_on = self.resumed and params.get("resume")
        if str(value) != "-" and not goes_on:
            yield Path(value)


@dataclass(frozen=True)
class WritesInto(_Name):
    """A folder, made where there is none, and the names of the files that are written there."""

    names: Callable[[Mapping[str, Any]], Iterable[str]]

    def convert(
        self, value: str | Path, param: click.Parameter | None, ctx: click.Context | None
    ) -> Path:
        """As a path."""
        if not str(value):
            self.fail("'' names no folder", param)
        return Path(value)

    def files(self, value: Path | str, params: Mapping[str, Any]) -> Iterator[Path]:
        """The files in the folder."""
        for name in self.names(params):
            yield Path(value) / name


class WorksIn(_Name):
    """A folder that a verb keeps its work in and goes on with; who works in it claims it."""

    def convert(
        self, value: str | Path, param: click.Parameter | None, ctx: click.Context | None
    ) -> Path:
        """As a path. Refuses what is there and no folder."""
        if not str(value) or (Path(value).exists() and not Path(value).is_dir()):
            self.fail(f"{str(value)!r} is no folder; name another", param)
        return Path(value)


OUTPUT = Writes()
JSON = Writes(stdout=True)
PICTURE = Writes("picture", (".png", ".pdf", ".svg"))
MACHINE = ReadsMachine()
TRACE = ReadsTrace()


class Files:
    """Inputs and outputs of the command line as typed; entered, the rule above holds.

    Raises FileError where an output is an input or another output, WriteError where it is there
    already, can't be written, or is claimed by another process.
    """

    def __init__(self, ctx: click.Context) -> None:
        self._inputs, self._outputs = list[_Named](), list[_Named]()
        self._folders, self._claims = list[Path](), list[Path]()
        for param in ctx.command.params:
            given = ctx.params.get(param.name or "")
            for value in given if isinstance(given, tuple) else (given,):
                if value is not None:
                    self._sort_in(param, value, ctx.params)
        self._overwrite = bool(ctx.params.get("overwrite"))
        self._before: dict[Path, object] = {}
        self._held = ExitStack()

    def _sort_in(self, param: click.Parameter, value: Any, params: Mapping[str, Any]) -> None:
        kind, word = param.type, _called(param)
        if isinstance(kind, Reads):
            self._inputs += [_Named(word, file) for file in kind.files(value)]
        elif isinstance(kind, Writes | WritesInto):
            ways = kind.ways if isinstance(kind, Writes) else ""
            self._outputs += [_Named(word, file, ways) for file in kind.files(value, params)]
            if value != "-":
                self._claims.append(Path(value))
            if isinstance(kind, WritesInto):
                self._folders.append(value)

    def __enter__(self) -> Self:
        self._refuse_confusion()
        self._refuse_replacing()
        made = {folder.absolute() for folder in self._folders}
        for output in self._outputs:
            if output.path.absolute().parent not in made:
                refuse_unwritable(output.path)
        for folder in self._folders:
            make_folder(folder)
        for output in self._outputs:
            refuse_unwritable(output.path)
        with ExitStack() as held:
            for path in self._claims:
                held.enter_context(claim(path))
            self._refuse_replacing()  # again: it may have come while the claim was another's
            self._held = held.pop_all()
        self._before = {output.path: _state(output.path) for output in self._outputs}
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.release()

    def release(self) -> None:
        """Let others write to the outputs."""
        self._held.close()

    def written(self) -> list[Path]:
        """The outputs that have been written since."""
        return [path for path, before in self._before.items() if _state(path) != before]

    def __bool__(self) -> bool:
        """Whether anything is to be written at all."""
        return bool(self._outputs)

    def _refuse_confusion(self) -> None:
        for output in self._outputs:
            for given in self._inputs:
                if same_file(output.path, given.path):
                    read = f"{given.path}, which is read ({given.word})"
                    raise FileError(f"{output.word} {output.path}: is {read}; name another file")
        for one, other in combinations(self._outputs, 2):
            if same_file(one.path, other.path):
                rule = f"{other.word} writes to the same file"
                raise FileError(f"{one.word} {one.path}: {rule}; name another")

    def _refuse_replacing(self) -> None:
        for output in self._outputs:
            try:
                refuse_replacing(output.path, overwrite=self._overwrite)
            except WriteError as error:
                if not (output.ways and output.path.is_file()):
                    raise
                raise WriteError(f"{output.path}: exists already; {output.ways}") from error


@dataclass(frozen=True)
class _Named:
    """A file, the word of the command line that named it, and what to do where it is there."""

    word: str
    path: Path
    ways: str = ""


def _called(param: click.Parameter) -> str:
    return (
        max(param.opts, key=len) if isinstance(param, click.Option) else param.human_readable_name
    )


def _state(path: Path) -> object:
    """What changes when a file is replaced."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns, found.st_size

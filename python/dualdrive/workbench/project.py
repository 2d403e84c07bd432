"""The project folder: recordings, the ladder of models, undo, results; everything on disk.

    project.json     what stands now, what stood before (undo) and after (redo), results by key
    traces/<id>/     recordings as they came
    models/          machine files, one per rung of the ladder
    jobs/            computations and what they left

What stands now holds inputs only. A result belongs to a key made from its inputs, so that undo and
redo find it again, and a change makes nothing stale. One server writes; the folder is claimed.
"""

from __future__ import annotations

import copy
import hashlib
import json
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from dualdrive.files import FileError, make_folder, write_atomically
from dualdrive.workbench.jobs import Jobs
from dualdrive.workbench.limits import MOST_FILES
from dualdrive.workbench.names import RECORDINGS, accepted, inside

__all__ = ["Project", "key_of"]

SCHEMA: Final = 1
_MOST_UNDO: Final = 100
_MOST_MESSAGES: Final = 30
_EMPTY: Final[dict[str, Any]] = {
    "machine": None, "traces": [], "steps": [], "variants": [], "diagnosis": None,
}  # fmt: skip


class Project:
    """A project and its state.

    now:      machine, traces, steps (the ladder), variants, diagnosis
    results:  key -> what a finished job left, with its number
    open:     number of a job under way -> what it is for
    """

    def __init__(self, folder: Path, worker: subprocess.Popen[bytes] | None = None) -> None:
        self.folder = folder
        make_folder(folder)
        for name in ("traces", "models"):
            make_folder(folder / name)
        self.jobs = Jobs(folder / "jobs", worker)
        told = self._read()
        self.now: dict[str, Any] = told["now"]
        self.past: list[dict[str, Any]] = told["past"]
        self.future: list[dict[str, Any]] = told["future"]
        self.results: dict[str, dict[str, Any]] = told["results"]
        self.open: dict[str, dict[str, Any]] = told["open"]
        self.messages: list[dict[str, Any]] = told["messages"]
        self._count: int = told["count"]

    def _read(self) -> dict[str, Any]:
        try:
            text = (self.folder / "project.json").read_text("utf-8")
        except FileNotFoundError:
            lists: dict[str, list[Any]] = {name: [] for name in ("past", "future", "messages")}
            return {"now": copy.deepcopy(_EMPTY), **lists, "results": {}, "open": {}, "count": 0}
        try:
            told: dict[str, Any] = json.loads(text)
            if told["schema"] != SCHEMA or not told.keys() >= {"now", "past", "results", "open"}:
                raise ValueError(f"schema = {told['schema']!r}")
        except (ValueError, KeyError, TypeError) as error:
            rule = f"no project of this workbench ({error}); name another folder"
            raise FileError(f"{self.folder / 'project.json'}: {rule}") from None
        return told

    def save(self) -> None:
        """Put the state on the disk, whole or not at all."""
        told = {
            "schema": SCHEMA, "now": self.now, "past": self.past, "future": self.future,
            "results": self.results, "open": self.open, "messages": self.messages,
            "count": self._count,
        }  # fmt: skip
        with write_atomically(self.folder / "project.json") as temporary:
            temporary.write_text(json.dumps(told, allow_nan=False), "utf-8")

    # --- changes and the way back -----------------------------------------------------------------

    @contextmanager
    def change(self, what: str) -> Iterator[dict[str, Any]]:
        """One step that undo takes back; nothing happened where it raises."""
        before = copy.deepcopy(self.now)
        try:
            yield self.now
        except BaseException:
            self.now = before
            raise
        self.past = [*self.past, {"did": what, "state": before}][-_MOST_UNDO:]
        self.future = []
        self.save()

    def undo(self) -> str:
        """Take back the last change; what it was. FileError where there is none."""
        return self._step(self.past, self.future, "nothing to undo")

    def redo(self) -> str:
        """Make the last change again that was taken back. FileError where there is none."""
        return self._step(self.future, self.past, "nothing to do again")

    def _step(self, source: list[dict[str, Any]], target: list[dict[str, Any]], none: str) -> str:
        if not source:
            raise FileError(none)
        last = source.pop()
        target.append({"did": last["did"], "state": self.now})
        self.now = last["state"]
        self.save()
        return str(last["did"])

    def tell(self, text: str, kind: str = "note") -> None:
        """A line for the person at the page; the last thirty are kept."""
        self._count += 1
        told = {"id": self._count, "text": text, "kind": kind}
        self.messages = [*self.messages, told][-_MOST_MESSAGES:]
        self.save()

    def name(self, stem: str) -> str:
        """A new identifier."""
        self._count += 1
        return f"{stem}{self._count}"

    # --- recordings -------------------------------------------------------------------------------

    def trace(self, ident: str) -> dict[str, Any]:
        """A recording by its identifier. FileError where there is none."""
        for told in self.now["traces"]:
            if told["id"] == ident:
                found: dict[str, Any] = told
                return found
        raise FileError(f"{ident}: no such recording here; reload the page")

    def place_for(self, name: str) -> tuple[str, Path]:
        """An identifier and a file for a recording that is about to come."""
        if len(self.now["traces"]) >= MOST_FILES:
            raise FileError(f"{name}: {MOST_FILES} recordings are here already; remove one first")
        name = accepted(name, RECORDINGS)
        ident = self.name("t")
        make_folder(self.folder / "traces" / ident)
        return ident, inside(self.folder, f"traces/{ident}/{name}")

    def take_in(self, ident: str, path: Path, mapping: Mapping[str, Any] | None) -> None:
        """Make a file that has come a recording of the project."""
        stems = {told["name"] for told in self.now["traces"]}
        stem, k = path.stem, 2
        while stem in stems:
            stem, k = f"{path.stem} ({k})", k + 1
        role = "held_out" if "held" in stem.lower() else "fit"
        with self.change(f"recording {stem}") as now:
            now["traces"].append({
                "id": ident, "name": stem, "path": str(path.relative_to(self.folder)),
                "map": dict(mapping) if mapping else None, "role": role, "parts": None,
            })  # fmt: skip

    def copy_in(self, path: Path) -> None:
        """Copy a recording from elsewhere on this computer, with the mapping beside it."""
        from dualdrive.traces import find_mapping, read_mapping

        beside = find_mapping(path)
        mapping = read_mapping(beside).as_dict() if beside is not None else None
        ident, place = self.place_for(path.name)
        try:
            shutil.copyfile(path, place)
        except OSError as error:
            raise FileError(f"{path}: cannot be read: {error.strerror}") from None
        self.take_in(ident, place, mapping)

    # --- models -----------------------------------------------------------------------------------

    def model(self, text: str) -> str:
        """Keep the text of a machine file; its name in the project."""
        name = f"models/{self.name('m')}.toml"
        with write_atomically(self.folder / name) as temporary:
            temporary.write_text(text, "utf-8")
        return name

    @property
    def step(self) -> dict[str, Any]:
        """The rung that the ladder has reached. FileError where there is no machine."""
        if not self.now["steps"]:
            raise FileError("there is no machine yet; drop a machine file or choose a preset")
        found: dict[str, Any] = self.now["steps"][-1]
        return found

    def told_of_traces(self) -> list[dict[str, Any]]:
        """The recordings as a job gets them."""
        return [
            {**told, "path": str((self.folder / told["path"]).absolute())}
            for told in self.now["traces"]
        ]

    def path(self, name: str) -> Path:
        """A file of the project. FileError for a name that leads out of it."""
        return inside(self.folder, name)


def key_of(kind: str, *parts: Any) -> str:
    """The key of a result: the same inputs give the same one."""
    text = json.dumps(parts, sort_keys=True, default=str)
    return f"{kind}:{hashlib.sha256(text.encode()).hexdigest()[:20]}"

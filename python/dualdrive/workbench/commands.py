"""What the page can ask for, by name, with its arguments checked; and what can be taken away."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, Final

from dualdrive.files import FileError, read_text
from dualdrive.machine import presets
from dualdrive.traces.mapping_file import SUFFIX, mapping_from, mapping_text
from dualdrive.workbench.script import script
from dualdrive.workbench.story import Story

__all__ = ["Commands", "downloads"]

ROLES: Final = ("fit", "held_out", "ignored")
Told = Mapping[str, Any]


class Commands:
    """The commands of the page."""

    def __init__(self, story: Story) -> None:
        self.story, self.project = story, story.project
        self._known: dict[str, Callable[[Told], object]] = {
            "demo": lambda _: self.demo(),
            "preset": lambda told: self.preset(str(told["name"])),
            "diagnose": lambda told: story.diagnose(str(told.get("effort", "normal"))),
            "climb": lambda told: story.climb(str(told.get("effort", "normal"))),
            "add": lambda told: story.add(str(told.get("label", ""))),
            "report": lambda _: story.report(),
            "undo": lambda _: self._quiet(self.project.undo),
            "redo": lambda _: self._quiet(self.project.redo),
            "cancel": self.cancel,
            "variant": lambda told: story.variant([str(x) for x in told["without"]]),
            "map": self.map,
            "preview": self.preview,
            "role": self.role,
            "parts": self.parts,
            "remove": self.remove,
            "propose": self.propose,
        }

    def __call__(self, name: str, told: Told) -> None:
        """Do it. Raises FileError in words where it can't be done."""
        if name not in self._known:
            raise FileError(f"{name[:40]}: no such command")
        self._known[name](told)

    def begin(self, machine: str | None, traces: Sequence[Path]) -> None:
        """Take in what the command line names, in a project that has none of it."""
        if machine is not None and not self.project.now["steps"]:
            if machine in presets():
                self.story.machine(preset=machine)
            else:
                text = read_text(Path(machine))
                place = self.project.path(self.project.model(text))
                self.story.machine(name=Path(machine).name, path=place)
        known = {told["name"] for told in self.project.now["traces"]}
        for path in traces:
            if path.stem not in known:
                self.project.copy_in(path)

    def demo(self) -> None:
        """Begin with the shipped machine and its records."""
        if self.project.now["traces"] or self.project.now["steps"]:
            raise FileError("the project is not empty; start the workbench in another folder")
        # by its folder: importing dualdrive.demo would load all of the diagnosis into the server
        with as_file(files("dualdrive") / "demo") as shipped:
            names = ("fit.csv", "held_out.csv")
            self.begin(str(shipped / "machine.toml"), [shipped / name for name in names])

    def preset(self, name: str) -> None:
        """Take a machine that comes with dualdrive."""
        if name not in presets():
            raise FileError(f"{name[:60]}: no such preset")
        self.story.machine(preset=name)

    def cancel(self, told: Told) -> None:
        """Stop a computation; with ``keep`` it hands over what it knows, when it can."""
        number = str(int(told["number"]))
        if number in self.project.open:
            self.project.jobs.cancel(self.project.jobs[int(number)], keep=bool(told.get("keep")))

    # --- recordings -------------------------------------------------------------------------------

    def map(self, told: Told) -> None:
        """Read a recording by this mapping from now on."""
        mapping = self._mapping(told)
        with self.project.change(f"mapping of {self.project.trace(str(told['trace']))['name']}"):
            self.project.trace(str(told["trace"]))["map"] = mapping

    def preview(self, told: Told) -> None:
        """Read a recording by this mapping, for a look."""
        trace = self.project.trace(str(told["trace"]))
        mapping = self._mapping(told)
        [own] = [t for t in self.project.told_of_traces() if t["id"] == trace["id"]]
        for number, other in self.project.open.items():
            if other.get("key") == f"preview:{trace['id']}":
                self.project.jobs.cancel(self.project.jobs[int(number)])
        steps = self.project.now["steps"]
        machine = str(self.project.path(steps[-1]["file"]).absolute()) if steps else None
        arguments = {"trace": {**own, "map": mapping}, "machine": machine}
        self.story.start(
            "preview", f"Preview of {trace['name']}", arguments, key=f"preview:{trace['id']}"
        )

    def propose(self, told: Told) -> None:
        """Propose a mapping for a recording, even for one that could be read."""
        trace = self.project.trace(str(told["trace"]))
        [own] = [t for t in self.project.told_of_traces() if t["id"] == trace["id"]]
        title = f"Proposing a mapping for {trace['name']}"
        self.story.start("propose", title, {"trace": own}, key=f"propose:{trace['id']}")

    def _mapping(self, told: Told) -> dict[str, Any]:
        """A mapping whose every key and value is known; TraceError else."""
        return mapping_from(told["map"], "mapping").as_dict()

    def role(self, told: Told) -> None:
        """Fit to a recording, hold it out, or leave it aside."""
        role = str(told["role"])
        if role not in ROLES:
            raise FileError(f"role {role[:20]!r}: choose one of {', '.join(ROLES)}")
        name = self.project.trace(str(told["trace"]))["name"]
        with self.project.change(f"role of {name}"):
            self.project.trace(str(told["trace"]))["role"] = role

    def parts(self, told: Told) -> None:
        """Which parts of a recording count; all of them where none is named."""
        trace = self.project.trace(str(told["trace"]))
        found = self.story.result(self.story.read_key(trace))
        known = set(found["records"]) if found and found["ok"] else set()
        wanted = [str(name) for name in told["parts"]]
        if stray := set(wanted) - known:
            raise FileError(f"{', '.join(sorted(stray))[:80]}: no part of {trace['name']}")
        with self.project.change(f"parts of {trace['name']}"):
            whole = not wanted or set(wanted) == known
            self.project.trace(str(told["trace"]))["parts"] = None if whole else wanted

    def remove(self, told: Told) -> None:
        """Take a recording out; undo brings it back."""
        name = self.project.trace(str(told["trace"]))["name"]
        with self.project.change(f"removed {name}") as now:
            now["traces"] = [t for t in now["traces"] if t["id"] != told["trace"]]

    def _quiet(self, step: Callable[[], str]) -> None:
        self.story.refuse_change()
        step()


def downloads(story: Story) -> dict[str, Callable[[], bytes]]:
    """What can be saved now: name -> how its content is made."""
    p, found = story.project, dict[str, Callable[[], bytes]]()
    if p.now["steps"]:
        found["machine.toml"] = lambda: p.path(p.step["file"]).read_bytes()
        found["story.py"] = lambda: script(p.now).encode()
    for trace in p.now["traces"]:
        if trace["map"]:
            found[trace["name"] + SUFFIX] = partial(_mapping, trace["map"])
    if (p.folder / "report.html").is_file():
        found["report.html"] = lambda: p.path("report.html").read_bytes()
    if p.now["diagnosis"] and _experiment(story):
        found["next-experiment.csv"] = lambda: _motion(story).encode()
    return found


def _mapping(told: Told) -> bytes:
    """A mapping as a file to put beside its recording."""
    return mapping_text(mapping_from(told, "mapping")).encode()


def _experiment(story: Story) -> dict[str, Any] | None:
    job = story.project.jobs[story.project.now["diagnosis"]["job"]]
    told: dict[str, Any] = json.loads((job.folder / "view.json").read_text("utf-8"))
    return told["next_experiment"] and {**told["next_experiment"], "axis": told["axis"]}


def _motion(story: Story) -> str:
    """The commanded motion of the next experiment, as `dualdrive simulate --motion` takes it."""
    from dualdrive.motion import motion_csv, parse_motion

    told = _experiment(story)
    assert told is not None
    return motion_csv(parse_motion(told["motion"], axis=told["axis"]), axis=told["axis"])

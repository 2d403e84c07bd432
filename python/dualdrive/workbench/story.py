"""How a project goes on: what is computed by itself, what a person asks for, what results mean."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from dualdrive.files import FileError, read_text, write_atomically
from dualdrive.workbench.jobs import Job
from dualdrive.workbench.project import Project, key_of

__all__ = ["Story"]

#: jobs that end by changing the model: one at a time, and nothing else changes it meanwhile
_CHANGING: Final = ("add", "climb", "machine")
#: computations at the same time
_MOST: Final = 3
EFFORTS: Final = ("quick", "normal", "thorough")


class Story:
    """What happens in a project."""

    def __init__(self, project: Project) -> None:
        self.project = project

    # --- keys of results --------------------------------------------------------------------------

    def read_key(self, trace: Mapping[str, Any]) -> str:
        """Of a recording as it is mapped."""
        return key_of("read", trace["path"], trace["map"])

    def compare_key(self, step: Mapping[str, Any], without: tuple[str, ...] = ()) -> str:
        """Of a model held against the recordings."""
        traces = [
            (t["name"], self.read_key(t), t["role"], t["parts"])
            for t in self.project.now["traces"]
            if t["role"] != "ignored"
        ]
        return key_of("compare", step["file"], without, traces, self.mode)

    @property
    def mode(self) -> str:
        """How models are held against the recordings: as the diagnosis judged, where one has.

        A sentence that counts in the torque balance above a ladder of simulated loops would
        contradict it, although both are right.
        """
        told = self.project.now["diagnosis"]
        return str(told.get("mode", "auto")) if told else "auto"

    def result(self, key: str) -> dict[str, Any] | None:
        """What is known under a key, None where nothing is yet."""
        return self.project.results.get(key)

    def ready(self) -> bool:
        """Whether there is something to fit to, and every recording could be read."""
        traces = [t for t in self.project.now["traces"] if t["role"] != "ignored"]
        read = [self.result(self.read_key(t)) for t in traces]
        return any(t["role"] == "fit" for t in traces) and all(r and r["ok"] for r in read)

    # --- what is computed by itself ---------------------------------------------------------------

    def go_on(self) -> bool:
        """Take what has ended and begin what is missing; whether anything changed."""
        changed = self._take()
        for kind, title, key, arguments in self._missing():
            if len(self.project.open) >= _MOST:
                break
            if not any(told.get("key") == key for told in self.project.open.values()):
                self.start(kind, title, {**arguments}, key=key)
                changed = True
        return changed

    def _missing(self) -> list[tuple[str, str, str, dict[str, Any]]]:
        """Kind, title, key and arguments of every computation that the page waits for."""
        p, found = self.project, []
        for told, trace in zip(p.told_of_traces(), p.now["traces"], strict=True):
            key = self.read_key(trace)
            result = self.result(key)
            if result is None:
                found.append(("read", f"Reading {trace['name']}", key, {"trace": told}))
            elif not result["ok"] and self.result(f"propose:{trace['id']}") is None:
                title = f"Proposing a mapping for {trace['name']}"
                found.append(("propose", title, f"propose:{trace['id']}", {"trace": told}))
        if not self.ready() or not p.now["steps"]:
            return found
        shown: list[tuple[dict[str, Any], tuple[str, ...]]]
        shown = [(s, ()) for s in reversed(p.now["steps"])]
        shown += [(p.step, tuple(v["without"])) for v in p.now["variants"]]
        for step, without in shown:
            key = self.compare_key(step, without)
            if self.result(key) is None:
                label = " without ".join([step["label"], *without])
                arguments = {**self._inputs(step), "without": list(without), "mode": self.mode}
                found.append(("compare", f"Comparing: {label}", key, arguments))
        return found

    def _inputs(self, step: Mapping[str, Any]) -> dict[str, Any]:
        return {
            "machine": str(self.project.path(step["file"]).absolute()),
            "traces": self.project.told_of_traces(),
        }

    def start(self, kind: str, title: str, arguments: Mapping[str, Any], **what_for: Any) -> Job:
        """Begin a computation; what_for: kept beside it, ``key`` where its result has one."""
        job = self.project.jobs.start(kind, title, arguments)
        self.project.open[str(job.number)] = {"kind": kind, "title": title, **what_for}
        self.project.save()
        return job

    # --- what results mean ------------------------------------------------------------------------

    def _take(self) -> bool:
        """Take the results of jobs that have ended."""
        ended = [
            (number, told)
            for number, told in self.project.open.items()
            if not self.project.jobs.alive(self.project.jobs[int(number)])
        ]
        for number, told in ended:
            job = self.project.jobs[int(number)]
            done = job.done or {"ok": False, "message": "lost"}
            self.project.open.pop(number)
            if "key" in told:
                if not done.get("stopped"):
                    self.project.results[told["key"]] = {**done, "job": job.number}
            elif not done["ok"]:
                kind = "note" if done.get("stopped") else "error"
                self.project.tell(f"{told['title']}: {done['message']}", kind)
            else:
                getattr(self, f"_take_{told['kind']}")(job, told, done)
            self.project.save()
        if ended:
            self.project.jobs.forget(self._needed())
        return bool(ended)

    def _needed(self) -> set[int]:
        p = self.project
        states = [p.now, *(told["state"] for told in (*p.past, *p.future))]
        diagnoses = {s["diagnosis"]["job"] for s in states if s["diagnosis"]}
        shown = {r["job"] for r in p.results.values()}
        return diagnoses | shown | {int(n) for n in p.open}

    def _take_machine(self, job: Job, told: Mapping[str, Any], done: Mapping[str, Any]) -> None:
        text = read_text(job.folder / "machine.toml")
        about, file = done["machine"], self.project.model(text)
        with self.project.change(f"machine {about['name']}") as now:
            now["machine"] = about
            step = {"id": self.project.name("s"), "label": "nominal", "file": file, "how": "given"}
            now["steps"], now["variants"], now["diagnosis"] = [step], [], None

    def _take_diagnose(self, job: Job, told: Mapping[str, Any], done: Mapping[str, Any]) -> None:
        with self.project.change("diagnosis") as now:
            now["diagnosis"] = _kept(job, told["step"], told, done)

    def _take_add(self, job: Job, told: Mapping[str, Any], done: Mapping[str, Any]) -> None:
        rungs = [("refitted", "refitted.toml", "refitted")]
        if done["label"]:
            rungs.append((f"+ {done['label']}", "added.toml", done["label"]))
        if told["refitted"]:
            rungs = rungs[1:]
        with self.project.change(f"added {done['label']}" if done["label"] else "refitted") as now:
            self._climbed(now, job, rungs, told["effort"])
        if done["said"]:
            self.project.tell(f"{done['label']}: {done['said']}")

    def _take_climb(self, job: Job, told: Mapping[str, Any], done: Mapping[str, Any]) -> None:
        with self.project.change("improved") as now:
            rungs = [(s["label"], s["file"], f"improve: {s['label']}") for s in done["steps"]]
            self._climbed(now, job, rungs, told["effort"])
            if done["diagnosed"] and now["steps"]:
                last = now["steps"][-1]["id"]
                now["diagnosis"] = _kept(job, last, told, done)
        self.project.tell(f"Improved: {done['stopped']}")

    def _climbed(
        self, now: dict[str, Any], job: Job, rungs: list[tuple[str, str, str]], effort: str
    ) -> None:
        for label, file, how in rungs:
            name = self.project.model(read_text(job.folder / file))
            step = {"id": self.project.name("s"), "label": label, "file": name, "how": how}
            now["steps"].append({**step, "effort": effort})
        now["variants"] = []

    def _take_report(self, job: Job, told: Mapping[str, Any], done: Mapping[str, Any]) -> None:
        place = self.project.path("report.html")
        with write_atomically(place) as temporary:
            temporary.write_bytes((job.folder / "report.html").read_bytes())
        self.project.tell(f"The report is saved: {place.absolute()}", "done")

    # --- what a person asks for -------------------------------------------------------------------

    def machine(self, *, preset: str = "", name: str = "", path: Path | None = None) -> None:
        """Take a machine: a preset, or a file that has come."""
        self.refuse_change()
        arguments = {"preset": preset, "name": name, "path": str(path.absolute()) if path else ""}
        self.start("machine", f"Machine {preset or name}", arguments)

    def diagnose(self, effort: str) -> None:
        """Ask what is missing in the model as it stands."""
        step = self._about_to("diagnose", effort)
        inputs = {**self._inputs(step), "effort": effort}
        self.start("diagnose", "Diagnosing", inputs, step=step["id"], effort=effort)

    def climb(self, effort: str) -> None:
        """Diagnose, add and refit until nothing is left."""
        step = self._about_to("climb", effort)
        inputs = {**self._inputs(step), "effort": effort}
        self.start("climb", "Improving until nothing is left", inputs, effort=effort)

    def add(self, label: str) -> None:
        """Add a candidate of the diagnosis and refit; an empty label only takes the refit."""
        told = self.project.now["diagnosis"]
        if told is None:
            raise FileError("there is no diagnosis yet; diagnose first")
        step = self._about_to("add", told["effort"])
        if told["step"] != step["id"] and not self._follows(told["step"]):
            raise FileError("the diagnosis is of another model; diagnose this one first")
        inputs = {**self._inputs(step), "label": label, "diagnosis": self._of_diagnosis()}
        title = f"Refitting with {label}" if label else "Taking the refitted numbers"
        refitted = told["step"] != step["id"]
        self.start("add", title, inputs, refitted=refitted, effort=told["effort"])

    def _follows(self, first: str) -> bool:
        """Whether the last rung is the refit of the one that was diagnosed."""
        steps = self.project.now["steps"]
        return len(steps) > 1 and steps[-2]["id"] == first and steps[-1]["how"] == "refitted"

    def report(self) -> None:
        """Ask for the report of the diagnosis and the ladder."""
        p = self.project
        if p.now["diagnosis"] is None:
            raise FileError("there is no diagnosis yet; the report tells of one")
        steps = []
        for s in p.now["steps"]:
            error = (self.result(self.compare_key(s)) or {}).get("error", {})
            fit, held = error.get("fit", {}), error.get("held_out", {})
            steps.append({
                "label": s["label"], "machine": str(p.path(s["file"]).absolute()),
                "fitted": fit.get("headline"), "held_out": held.get("headline"),
                "noise_floor": fit.get("noise_floor"), "command": "",
            })  # fmt: skip
        held_out = ", ".join(t["name"] for t in p.now["traces"] if t["role"] == "held_out")
        self.start("report", "Drawing the report", {
            "diagnosis": self._of_diagnosis(), "traces": p.told_of_traces(), "steps": steps,
            "held": held_out or "nothing", "stopped": "that is where the workbench stands",
            "commands": self.commands(),
        })  # fmt: skip

    def commands(self) -> list[str]:
        """What to type in the project's folder for the same."""
        now, script = self.project.now, "python story.py"
        used = [t for t in now["traces"] if t["role"] != "ignored"]
        if any(t["map"] or t["parts"] for t in used):
            return [script]  # mappings made in the page stand in the script alone
        fit, held = ([t["path"] for t in used if t["role"] == r] for r in ("fit", "held_out"))
        words = ["dualdrive", "report", now["steps"][0]["file"], *fit]
        words += [word for path in held for word in ("--held-out", path)]
        words += ["--effort", now["diagnosis"]["effort"]]
        words += ["--mode", self.mode] if self.mode != "auto" else []
        return [shlex.join([*words, "--output", "rebuilt.html"]), script]

    def variant(self, without: list[str]) -> None:
        """Switch effects of the model off, for a look beside it; none switches the look off."""
        known = self.effects()
        if stray := set(without) - set(known):
            raise FileError(f"{', '.join(sorted(stray))}: not in this model; reload the page")
        with self.project.change("variant") as now:
            now["variants"] = [{"without": sorted(without)}] if without else []

    def effects(self) -> list[str]:
        """Effects of the model as it stands."""
        from dualdrive.machine import Machine

        step = self.project.step
        text = read_text(self.project.path(step["file"]))
        return list(Machine.from_toml(text, step["label"]).effects)

    def _of_diagnosis(self) -> str:
        return str(self.project.jobs[self.project.now["diagnosis"]["job"]].folder.absolute())

    def _about_to(self, what: str, effort: str) -> dict[str, Any]:
        if effort not in EFFORTS:
            raise FileError(f"effort {effort[:20]!r}: choose one of {', '.join(EFFORTS)}")
        self.refuse_change(("diagnose",) if what == "diagnose" else ())
        if not self.ready():
            raise FileError("no recording to fit to is ready; map it, or give one the role fit")
        return self.project.step

    def refuse_change(self, also: tuple[str, ...] = ()) -> None:
        """Raise FileError while a computation is under way that ends by changing the model."""
        for told in self.project.open.values():
            if told["kind"] in (*_CHANGING, *also):
                raise FileError(f"{told['title']}: still under way; wait for it, or cancel it")


def _kept(job: Job, step: str, told: Mapping[str, Any], done: Mapping[str, Any]) -> dict[str, Any]:
    """What a project keeps of a diagnosis: where it lies, of which rung it is, how it judged."""
    return {"job": job.number, "step": step, "effort": told["effort"], "mode": done["mode"]}

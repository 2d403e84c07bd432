"""The state as every tab gets it: small, whole, and the same for all."""

from __future__ import annotations

from itertools import count
from typing import Any, Final

from dualdrive.describe import linear_words
from dualdrive.machine_file.frames import unit_on_axis
from dualdrive.web.live import units
from dualdrive.workbench.story import Story

__all__ = ["shown"]

#: answers overtake one another on their way; the page keeps the latest
_TURN: Final = count()


def shown(story: Story) -> dict[str, Any]:
    """Everything that the page shows but series and large results."""
    p = story.project
    now = p.now
    return {
        "turn": next(_TURN),
        "project": str(p.folder.absolute()),
        "units": units(),
        "machine": now["machine"],
        "traces": [_trace(story, told) for told in now["traces"]],
        "steps": [_model(story, step) for step in now["steps"]],
        "variants": [
            {"without": v["without"], **_compared(story, p.step, tuple(v["without"]))}
            for v in now["variants"]
        ],
        "diagnosis": now["diagnosis"],
        "ready": story.ready(),
        "jobs": [_job(story, n, told) for n, told in p.open.items()],
        "undo": p.past[-1]["did"] if p.past else None,
        "redo": p.future[-1]["did"] if p.future else None,
        "messages": p.messages,
    }


def _trace(story: Story, told: dict[str, Any]) -> dict[str, Any]:
    found = story.result(story.read_key(told))
    own: dict[str, Any] = {k: told[k] for k in ("id", "name", "role", "parts", "map")}
    own["preview"] = _on_axis(story, story.result(f"preview:{told['id']}"))
    if found is None:
        return {**own, "status": "reading"}
    if found["ok"]:
        return {**own, "status": "ready", "records": _on_axis(story, found)["records"],
                "store": f"{found['job']}/series"}  # fmt: skip
    proposed = story.result(f"propose:{told['id']}")
    return {**own, "status": "unread", "message": found["message"], "proposed": proposed}


def _on_axis(story: Story, found: Any) -> Any:
    """What was read, its channels in the units and words of the machine's axis.

    A recording knows nothing of it: a linear axis is read as a rotary one of 1 m radius.
    """
    machine = story.project.now["machine"]
    if not found or not found["ok"] or not machine or machine["axis"] != "linear":
        return found
    rigid = machine["drive_train"] == "rigid"
    return {**found, "records": {
        name: {**record, "channels": [_linear(c, rigid=rigid) for c in record["channels"]]}
        for name, record in found["records"].items()
    }}  # fmt: skip


def _linear(channel: dict[str, Any], *, rigid: bool) -> dict[str, Any]:
    unit = unit_on_axis(channel["name"], channel["unit"], axis="linear", rigid=rigid)
    if unit == channel["unit"]:
        return channel
    return {**channel, "unit": unit, "long_name": linear_words(channel["long_name"])}


def _model(story: Story, step: dict[str, Any]) -> dict[str, Any]:
    own = {k: step[k] for k in ("id", "label", "how")}
    return {**own, **_compared(story, step)}


def _compared(story: Story, step: dict[str, Any], without: tuple[str, ...] = ()) -> dict[str, Any]:
    found = story.result(story.compare_key(step, without))
    if found is None:
        return {"status": "waiting"}
    if not found["ok"]:
        return {"status": "failed", "message": found["message"]}
    own = {"job": found["job"], "error": found["error"], "mode": found.get("mode", "")}
    return {"status": "ready", **own}


def _job(story: Story, number: str, told: dict[str, Any]) -> dict[str, Any]:
    events = story.project.jobs[int(number)].events()
    last = events[-1] if events else {"text": "starting"}
    return {
        "number": int(number),
        "kind": told["kind"],
        "title": told["title"],
        **last,
        "lines": [e["text"] for e in events[-12:]],
    }

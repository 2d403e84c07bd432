"""The state as every tab gets it: small, whole, and the same for all."""

from __future__ import annotations

from itertools import count
from typing import Any, Final

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
    own["preview"] = story.result(f"preview:{told['id']}")
    if found is None:
        return {**own, "status": "reading"}
    if found["ok"]:
        return {**own, "status": "ready", "records": found["records"],
                "store": f"{found['job']}/series"}  # fmt: skip
    proposed = story.result(f"propose:{told['id']}")
    return {**own, "status": "unread", "message": found["message"], "proposed": proposed}


def _model(story: Story, step: dict[str, Any]) -> dict[str, Any]:
    own = {k: step[k] for k in ("id", "label", "how")}
    return {**own, **_compared(story, step)}


def _compared(story: Story, step: dict[str, Any], without: tuple[str, ...] = ()) -> dict[str, Any]:
    found = story.result(story.compare_key(step, without))
    if found is None:
        return {"status": "waiting"}
    if not found["ok"]:
        return {"status": "failed", "message": found["message"]}
    return {"status": "ready", "job": found["job"], "error": found["error"]}


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

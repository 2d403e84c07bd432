"""The figures as a page of plain text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

#: what the figures are held to
TARGETS = {
    "false alarms": "<= 1 %",
    "false alarms, loop known": "<= 1 %",
    "false alarms, loop unknown": "<= 1 %",
    "false alarms, drifted numbers": "<= 1 %",
    "top-1": ">= 75 %",
    "top-1 where the record tells": ">= 90 %",
    "top-3 where the record tells": ">= 97 %",
    "unknown, recall": ">= 85 %",
    "unknown, wrongly used": "<= 3 %",
    "both of two in the first three": ">= 80 %",
    "right equation": ">= 95 %",
    "cut": "none",
    "held-out error over floor": "<= 1.05",
    "effect parameters": "92 to 98 %",
    "refitted nominals": "92 to 98 %",
    "Brier": "<= 0.06",
}


def page(figures: Mapping[str, Any]) -> str:
    """All of it, the failures last."""
    lines = [f"{figures['cases']} cases", ""]
    shares = figures["alarms"] | figures["naming"] | figures["coverage of 95 % intervals"]
    lines += [_share(name, row) for name, row in shares.items()]
    lines += [_spread(name, row) for name, row in figures["errors"].items()]
    lines += [_spread("seconds", figures["seconds"])]
    lines += _trust(figures["trust"])
    lines += ["", "verdicts by group", *_table(figures["verdicts"])]
    lines += ["", "hidden effect: what was named", *_table(figures["confusion"])]
    for by, rows in figures["right answers by"].items():
        lines += ["", f"right answers by {by}"]
        lines += [_share(f"    {name}", row) for name, row in rows.items()]
    lines += ["", f"{len(figures['failures'])} failures"]
    lines += [_failure(row) for row in figures["failures"]]
    return "\n".join(lines) + "\n"


def _goal(name: str) -> str:
    return f"   ({TARGETS[name]})" if name in TARGETS else ""


def _share(name: str, row: Mapping[str, Any]) -> str:
    if row["of"] == 0:
        return f"{name:34s}     -"
    band = f"{row['low']:.1%} .. {row['high']:.1%}"
    return f"{name:34s} {row['share']:6.1%}  {row['hits']}/{row['of']}, {band}{_goal(name)}"


def _spread(name: str, row: Mapping[str, Any]) -> str:
    if row["of"] == 0:
        return f"{name:34s}     -"
    return (
        f"{name:34s} median {row['median']:.3f}, 95 % within {row['p95']:.3f}, "
        f"most {row['most']:.3f}, of {row['of']}{_goal(name)}"
    )


def _trust(row: Mapping[str, Any]) -> list[str]:
    if row["Brier"] is None:
        return [f"{'Brier':34s}     -"]
    lines = [f"{'Brier':34s} {row['Brier']:.3f} of {row['of']}{_goal('Brier')}"]
    for bin_ in row["reliability"]:
        said = f"claimed {bin_['claimed']:.2f}, right {bin_['share']:.2f}, of {bin_['of']}"
        lines.append(f"    from {bin_['from']:.2f}: {said}")
    return lines


def _table(rows: Mapping[str, Mapping[str, int]]) -> list[str]:
    return [
        f"    {name:28s} " + ", ".join(f"{column} {n}" for column, n in row.items())
        for name, row in rows.items()
    ]


def _failure(row: Mapping[str, Any]) -> str:
    hidden = " + ".join(row["hidden"]) or "nothing"
    size = f" (ratio {row['detectability']:.0f}" if row["detectability"] is not None else ""
    size += f", {row['told']:.0f} to {row['rival']}" if row["told"] is not None else ""
    said = row["why"] or f"{row['verdict']}: {'; '.join(row['named'])}"
    where = f"{row['case']} {row['group']}, loop {row['loop']}"
    return f"    {where}: {hidden}{size + ')' if size else ''} -> {said}"

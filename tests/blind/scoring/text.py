"""The figures as a page of plain text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

#: what the figures are held to
TARGETS = {
    "false alarms": "<= 1 %",
    "top-1 where delta-lambda >= 33": ">= 90 %",
    "top-3 where delta-lambda >= 33": ">= 97 %",
    "top-1 where the record tells": ">= 90 %",
    "top-3 where the record tells": ">= 97 %",
    "top-1, effect": ">= 75 %",
    "unknown, recall": ">= 80 %",
    "unknown, wrongly used": "<= 5 %",
    "both of two in the top 3": ">= 75 %",
    "right equation": ">= 95 %",
    "held-out error over floor": "median <= 1.05, p95 <= 1.2",
    "gap closed": "median >= 95 %",
    "effect parameters": "90 to 98 %",
    "refitted nominals": "90 to 98 %",
    "Brier": "<= 0.08",
}


def page(figures: Mapping[str, Any]) -> str:
    """All of it, the failures last."""
    lines = [f"{figures['cases']} cases", ""]
    shares = figures["naming"] | figures["coverage of 95 % intervals"]
    lines += [_share(name, row) for name, row in shares.items()]
    lines += [_spread(name, row) for name, row in figures["errors"].items()]
    lines += [_spread("seconds", figures["seconds"])]
    lines += _trust(figures["trust"])
    lines += ["", "verdicts by group", *_table(figures["verdicts"])]
    lines += ["", "hidden effect: what was named", *_table(figures["confusion"])]
    lines += ["", "by kind of record and machine", *_table(figures["kinds"])]
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
    for bin_ in row["calibration"]:
        said = f"claimed {bin_['claimed']:.2f}, right {bin_['right']:.2f}, of {bin_['of']}"
        lines.append(f"    from {bin_['from']:.2f}: {said}")
    for bin_ in row["by what is left"]:
        said = f"{bin_['right']} of {bin_['of']} leaders right"
        lines.append(f"    leaves {bin_['from']:.2f} of the floor or more: {said}")
    return lines


def _table(rows: Mapping[str, Mapping[str, int]]) -> list[str]:
    return [
        f"    {name:28s} " + ", ".join(f"{column} {n}" for column, n in row.items())
        for name, row in rows.items()
    ]


def _failure(row: Mapping[str, Any]) -> str:
    hidden = " + ".join(row["hidden"]) or "nothing"
    size = ", ".join(f"{v:.0f}" for v in row["lambdas"])
    said = row["why"] or f"{row['verdict']}: {'; '.join(row['named'])}"
    where = f"{row['case']} {row['group']}, {row['family']}, {row['mode']}"
    return f"    {where}: {hidden}" + (f" (lambda {size})" if size else "") + f" -> {said}"

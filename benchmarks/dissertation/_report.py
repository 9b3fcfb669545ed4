"""The report as data: each table and figure with its published values, rows, pictures and state."""

import os
import platform
from collections import Counter
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from typing import Any

from ._outline import CHAPTERS, Chapter, Item, benchmarks_of
from ._parts import Part
from ._summary import BETTER, NOT_REACHED, REPRODUCED, VERDICTS, lines, verdict

# States of an item without a verdict.
NO_VALUES = "no values"
DRAWN, REPLACED = "drawn", "drawn from a replacement"
SKETCH, NOT_MEASURED = "sketch", "not measured"
STATES = (REPRODUCED, BETTER, NOT_REACHED, NO_VALUES, DRAWN, REPLACED, SKETCH, NOT_MEASURED)


def report_of(
    parts: Mapping[str, Part],
    *,
    quick: bool,
    cluster: str,
    recorded: bool = False,
    chapters: Sequence[Chapter] = CHAPTERS,
) -> dict[str, Any]:
    """The report for JSON; a missing part leaves its items "not measured"."""
    described = [
        {
            "number": chapter.number,
            "title": chapter.title,
            "items": [described_item(item, parts, quick=quick) for item in chapter.items],
        }
        for chapter in chapters
    ]
    items = [item for chapter in described for item in chapter["items"]]
    rows = {(row["target"], row["detail"]): row for item in items for row in item["rows"]}.values()
    states = Counter(item["state"] for item in items)
    verdicts = Counter(row["verdict"] for row in rows)
    dates = sorted({part.measured for part in parts.values()})
    by_label = {name: {row["target"]: row for row in part.rows} for name, part in parts.items()}
    wanted = benchmarks_of(tuple(item for chapter in chapters for item in chapter.items))
    missing = [name for name in wanted if name not in parts or parts[name].error]
    return {
        "quick": quick,
        "recorded": recorded,
        "complete": not missing,
        "version": version("bentray"),
        "measured": dates[:: len(dates) - 1] if len(dates) > 1 else dates,
        "machine": f"{os.cpu_count()} processors, {platform.machine()}, {platform.system()}",
        "cluster": cluster,
        "seconds": sum(part.seconds or 0.0 for part in parts.values()),
        "items": {state: states[state] for state in STATES if states[state]},
        "rows": {name: verdicts[name] for name in (REPRODUCED, BETTER, NOT_REACHED)}
        | {"without a value": verdicts[""]},
        "summary": list(lines(by_label)),
        "chapters": described,
        "parts": [described_part(name, parts.get(name)) for name in wanted],
    }


def described_item(item: Item, parts: Mapping[str, Part], *, quick: bool) -> dict[str, Any]:
    """One table or figure."""
    rows, pictures, errors = [], [], []
    for source in item.sources:
        part = parts.get(source.benchmark)
        if part is None:
            continue
        beside = [row for row in part.rows if row["target"].startswith(source.targets)]
        rows += [{**row, "verdict": verdict(row["value"], row["goal"], row["met"])} for row in beside]
        pictures += [
            {"benchmark": part.benchmark, "file": name} for name in item.pictures if name in part.pictures
        ]
        if part.error:
            errors.append(f"{part.benchmark} stopped: {part.error}")
    state = state_of(item, rows, pictures)
    return {
        "name": item.name,
        "key": item.key,
        "title": item.title,
        "published": dict(item.published),
        "state": state,
        "replaced": item.replaced,
        "sentence": sentence(item, state, rows, quick=quick),
        "errors": errors,
        "rows": rows,
        "pictures": pictures,
    }


def state_of(item: Item, rows: Sequence[Mapping[str, Any]], pictures: Sequence[object]) -> str:
    """One of ``STATES``: the worst verdict of the rows, if they have one."""
    if item.sketch:
        return SKETCH
    verdicts = {row["verdict"] for row in rows} - {""}
    if verdicts:
        return NOT_REACHED if item.unreached else min(verdicts, key=VERDICTS.index)
    if rows:
        return NO_VALUES
    if pictures:
        return REPLACED if item.replaced else DRAWN
    return NOT_MEASURED


def sentence(item: Item, state: str, rows: Sequence[Mapping[str, Any]], *, quick: bool) -> str:
    """One sentence on what does not reproduce; empty if there is nothing to explain."""
    if state == SKETCH:
        return "A sketch of the method, which has no result to reproduce."
    if state == NOT_MEASURED:
        return "Not measured in this run."
    if state != NOT_REACHED:
        return ""
    missed = sum(row["verdict"] == NOT_REACHED for row in rows)
    if not missed:
        return item.why
    small = " on the small problems of a quick run" if quick else ""
    return f"{missed} of {len(rows)} rows are not reached{small}. {item.why}".strip()


def described_part(name: str, part: Part | None) -> dict[str, Any]:
    """Description of the run of a benchmark in the report."""
    if part is None:
        return {"benchmark": name, "measured": None}
    return {
        "benchmark": name,
        "measured": part.measured,
        "seconds": part.seconds,
        "load": part.load,
        "rows": len(part.rows),
        "error": part.error,
        "on_workers": part.uses_cluster,
    }

"""Parts of the report from the recorded rows, each benchmark as it was last measured."""

import json
from pathlib import Path

from ._outline import benchmarks_of, items
from ._parts import Part

RECORDED = "recorded rows"


def recorded_parts(results: Path) -> dict[str, Part]:
    """By benchmark; without time and load, which rows state in their details where they matter.

    Args:
        results: folder of ``NAME.json``, lists of rows with a date, and of the pictures.
    """
    pictures = {name for item in items() for name in item.pictures if (results / name).is_file()}
    parts = {}
    for name in benchmarks_of(tuple(items())):
        file = results / f"{name}.json"
        if file.is_file():
            rows = json.loads(file.read_text())
            measured = max(row["measured"] for row in rows)
            parts[name] = Part(name, {}, measured, None, None, rows, sorted(pictures))
    return parts

"""Results page of the documentation: tables compared with recorded rows, and the list of missed goals.

``python -m benchmarks.shared._results_page`` writes the list anew.
"""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
RESULTS, PAGE = ROOT / "benchmarks" / "results", ROOT / "docs" / "reference" / "benchmark-results.md"

# The list of missed goals lies between these lines of the page.
BEGIN, END = "<!-- missed goals: begin -->", "<!-- missed goals: end -->"

NOT_MEASURED = "not measured"
SIGNS = {"<=": "≤", "<": "<", ">=": "≥", ">": ">", "==": "="}
BASELINES = ("best constant", "water alone", "straight rays", "default settings")

# Factors from the unit of a row to the unit on the page.
FACTORS = {
    ("s", "ms"): 1e3,
    ("of range", "%"): 100.0,
    ("% of range", "%"): 1.0,
    ("% points", "%"): 1.0,
    ("of pairs", "%"): 100.0,
}
FIGURE = re.compile(r"(?P<sign>[≤≥<>=] )?(?P<number>-?[\d,]*\.?\d+(e-?\d+)?)( (?P<unit>.+))?")

# Of a recorded row, as JSON.
Recorded = Mapping[str, Any]


@dataclass(frozen=True)
class Claim:
    """One line of the page about one row: its cells by the head of their column.

    Attributes:
        file: of the row, without ``.json``.
        target: label of the row.
        cells: text of the cells.
    """

    file: str
    target: str
    cells: Mapping[str, str]


def recorded(folder: Path = RESULTS) -> dict[str, dict[str, Recorded]]:
    """All recorded rows, by file and label.

    Raises:
        ValueError: if a label is in a file twice.
    """
    by_file: dict[str, dict[str, Recorded]] = {}
    for path in sorted(folder.glob("*.json")):
        rows = json.loads(path.read_text())
        by_file[path.stem] = {row["target"]: row for row in rows}
        if len(by_file[path.stem]) != len(rows):
            raise ValueError(f"{path.name}: a label occurs twice")
    return by_file


def tables(text: str) -> Iterator[list[dict[str, str]]]:
    """The tables of a page in Markdown: a list of lines, each a mapping from column to cell."""
    block: list[list[str]] = []
    for line in [*text.splitlines(), ""]:
        if line.startswith("|"):
            block.append([cell.strip() for cell in line.strip().strip("|").split("|")])
        elif block:
            head, _, *body = block
            yield [dict(zip(head, cells, strict=True)) for cells in body]
            block = []


def claims(text: str) -> Iterator[Claim]:
    """Statements about single rows, from the tables with a column ``label``.

    A label is the name of a file in backticks and the label of a row. Several rows share a line: labels and
    results are then separated by semicolons, a goal may be shared.
    """
    for table in tables(text):
        for line in table:
            if "label" not in line:
                continue
            _, file, rest = line["label"].split("`", 2)
            targets = split(rest)
            columns = {}
            for name, cell in line.items():
                cells_of = split(cell)
                columns[name] = cells_of * len(targets) if len(cells_of) == 1 else cells_of
                if name in ("result", "goal", "error", *BASELINES) and len(columns[name]) != len(targets):
                    raise ValueError(f"{file}, {rest}: {len(targets)} labels, {len(cells_of)} in {name}")
            for k, target in enumerate(targets):
                cells = {name: values[k] for name, values in columns.items() if len(values) > k}
                yield Claim(file, target, cells)


def split(cell: str) -> list[str]:
    """The parts of a cell."""
    return [value.strip() for value in cell.split(";")]


def contradictions(claim: Claim, rows: Mapping[str, Mapping[str, Recorded]]) -> list[str]:
    """Errors in a line of the page: empty if it agrees with the recorded row."""
    row = rows.get(claim.file, {}).get(claim.target)
    name = f"{claim.file}: {claim.target}"
    if row is None:
        return [f"{name}: there is no such row"]
    result = claim.cells["result"]
    bold = result.startswith("**")
    wrong = []
    if bold is row["met"]:
        wrong.append(f"{name}: the goal is {'met' if row['met'] else 'missed'}, bold is a missed one")
    if not agrees(result.strip("*"), row["value"], row["unit"]):
        wrong.append(f"{name}: result {result}, recorded {row['value']} {row['unit']}")
    goal = claim.cells["goal"]
    if not agrees(goal, row["goal"], row["unit"]) or not goal.startswith(SIGNS[row["op"]] + " "):
        wrong.append(f"{name}: goal {goal}, recorded {row['op']} {row['goal']} {row['unit']}")
    baselines = {"error": row.get("error"), **row.get("baselines", {})}
    for column in ("error", *BASELINES):
        cell = claim.cells.get(column)
        if cell is not None and not agrees(cell, baselines.get(column), row["unit"]):
            wrong.append(f"{name}: {column} {cell}, recorded {baselines.get(column)}")
    return wrong


def agrees(text: str, value: float | None, unit: str) -> bool:
    """Whether a figure on the page is a recorded value, rounded to the digits that it has."""
    if value is None:
        return text in (NOT_MEASURED, "none")
    match = FIGURE.fullmatch(text)
    if match is None:
        return False
    shown = match["unit"] or unit
    if shown != unit and (unit, shown) not in FACTORS:
        return False
    number = Decimal(match["number"].replace(",", ""))
    exact = value * FACTORS.get((unit, shown), 1.0)
    half = 0.5 * 10.0 ** int(number.as_tuple().exponent)
    return abs(exact - float(number)) <= half + 1e-9 * abs(exact)


def missed_goals(rows: Mapping[str, Mapping[str, Recorded]]) -> str:
    """Tables of all rows that miss their goal, file by file, in Markdown."""
    lines = []
    for file, of_file in rows.items():
        missed = [row for row in of_file.values() if not row["met"]]
        if missed:
            dates = sorted({row["measured"] for row in missed})
            when = dates[0] if len(dates) == 1 else f"{dates[0]} to {dates[-1]}"
            lines.append(f"`{file}`, {len(missed)} of {len(of_file)} rows, measured {when}:")
            lines.append(_table(missed))
    return "\n\n".join(lines)


def _table(missed: Sequence[Recorded]) -> str:
    images = any("baselines" in row for row in missed)
    columns = ["row", "measured", "wanted", *(("error", *BASELINES) if images else ())]
    lines = [columns, ["---"] * len(columns)]
    for row in missed:
        value = NOT_MEASURED if row["value"] is None else f"{rounded(row['value'])} {row['unit']}".strip()
        goal = f"{SIGNS[row['op']]} {rounded(row['goal'])} {row['unit']}".strip()
        baselines = {"error": row.get("error"), **row.get("baselines", {})}
        errors = [rounded(baselines.get(name)) for name in columns[3:]]
        lines.append([row["target"], value, goal, *errors])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def rounded(value: float | None) -> str:
    """Three significant digits, without an exponent from 0.001 up."""
    if value is None:
        return "none"
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"


def with_missed_goals(text: str, rows: Mapping[str, Mapping[str, Recorded]]) -> str:
    """The page with its list of missed goals written anew."""
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    return f"{before}{BEGIN}\n\n{missed_goals(rows)}\n\n{END}{after}"


if __name__ == "__main__":
    PAGE.write_text(with_missed_goals(PAGE.read_text(), recorded()))

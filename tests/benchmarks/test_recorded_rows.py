"""Recorded rows are rows that the benchmarks of today write: their labels, goals and words."""

import ast
import json
import re
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ROWS = {
    path.stem: rows
    for path in sorted((ROOT / "benchmarks/results").glob("*.json"))
    if isinstance(rows := json.loads(path.read_text()), list)
}

# Goals of these are plans, values of other rows, read from tables or in proportion to cores, not in sources.
COMPUTED = {
    "acquisition_picking", "any_scan", "chapter3", "chapter4", "chapter7_readings", "devices", "head_to_head",
    "published_systems", "scaling", "scoreboard", "sizing", "subdomains", "table5", "task_memory",
}  # fmt: skip
# In results of devices, their names.
NAMES = {"portable", "computing", "language", "pthread", "intel", "xeon", "processor", "epyc"}
# Words of the product in rows that were not measured since it says them otherwise.
FORMER = {"curved": "bent since 2026-11-27"}
WORD = re.compile(r"[a-z]{4,}")


@cache
def sources(path: Path) -> tuple[ast.Module, ...]:
    """A benchmark and the modules of the benchmarks that it imports, and these again."""
    found: dict[Path, ast.Module] = {}
    waiting = [path]
    while waiting:
        module = waiting.pop()
        if module in found or not module.is_file():
            continue
        found[module] = ast.parse(module.read_text())
        for node in ast.walk(found[module]):
            if isinstance(node, ast.ImportFrom) and node.level:
                folder = module.parents[node.level - 1].joinpath(*(node.module or "").split("."))
                waiting += [folder.with_suffix(".py"), *(folder / f"{name.name}.py" for name in node.names)]
    return tuple(found.values())


def nodes(benchmark: str) -> Iterator[ast.AST]:
    (path,) = (ROOT / "benchmarks").glob(f"*/{benchmark}.py")
    for tree in sources(path):
        yield from ast.walk(tree)


def texts(trees: Iterator[ast.AST]) -> set[str]:
    return {node.value for node in trees if isinstance(node, ast.Constant) and isinstance(node.value, str)}


@cache
def words_of_the_product() -> set[str]:
    paths = (path for part in ("kernels", "workers", "service") for path in (ROOT / part).rglob("*.py"))
    return {word for path in paths for word in WORD.findall(path.read_text().lower())}


@pytest.mark.parametrize("benchmark", ROWS)
def test_labels_are_written_by_the_benchmark(benchmark: str) -> None:
    patterns = set(map(re.escape, texts(nodes(benchmark))))
    for node in nodes(benchmark):
        if isinstance(node, ast.JoinedStr):
            fixed = [value.value if isinstance(value, ast.Constant) else None for value in node.values]
            if len("".join(filter(None, fixed))) > 2:
                patterns.add("".join(".+" if text is None else re.escape(text) for text in fixed))
    written = re.compile("|".join(patterns))
    unknown = [row["target"] for row in ROWS[benchmark] if not written.fullmatch(row["target"])]
    # A goal, and the name of a peer after it.
    assert [label for label in unknown if not any(map(written.fullmatch, _beginnings(label)))] == []


def _beginnings(label: str) -> Iterator[str]:
    words = label.split(" ")
    return (" ".join(words[:count]) for count in range(2, len(words)))


@pytest.mark.parametrize("benchmark", sorted(ROWS.keys() - COMPUTED))
def test_goals_are_those_of_the_benchmark(benchmark: str) -> None:
    numbers = set()
    for node in nodes(benchmark):
        if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            numbers.add(float(node.value))
        elif isinstance(node, ast.BinOp) and isinstance(node.left, ast.Constant):
            with suppress(NameError, TypeError, ArithmeticError):
                numbers.add(float(eval(ast.unparse(node), {"__builtins__": {}})))
    assert [row["target"] for row in ROWS[benchmark] if float(row["goal"]) not in numbers] == []


@pytest.mark.parametrize("benchmark", ROWS)
def test_details_have_no_word_that_no_code_writes(benchmark: str) -> None:
    names = {node.id for node in nodes(benchmark) if isinstance(node, ast.Name)}
    own = {word for text in texts(nodes(benchmark)) | names for word in WORD.findall(text.lower())}
    known = own | words_of_the_product() | NAMES | FORMER.keys()
    said = {word for row in ROWS[benchmark] for word in WORD.findall(row["detail"].lower())}
    assert said - known == set()
    assert not [row["target"] for row in ROWS[benchmark] if "recorded on" in row["detail"]]

"""`bentray bench`: run one file of `benchmarks/` and write its rows."""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated

import typer

from bentray_kernels.errors import InvalidInput
from bentray_workers.atomic import write_bytes

from .endings import WorkFailed
from .row import Row
from .terminal import Step, print_lines, print_table, progress_bar, without_nan

Rows = Callable[[bool, Step], Iterable[Row]]


def bench(
    name: Annotated[str, typer.Argument(help="Name of a file in benchmarks/, without .py.")],
    json_file: Annotated[Path, typer.Option("--json", help="File to write the rows to.")],
    quick: Annotated[bool, typer.Option("--quick", help="Smaller problems, for trying it out.")] = False,
) -> None:
    """Measure the rows of one table of targets, in this run and on this machine.

    A row that misses its goal is a result, not an error: the exit code is 0 once every row is measured.

    Example:  bentray bench reconstruction --json rows.json
    """
    if not json_file.parent.is_dir():
        raise InvalidInput("--json", f"{json_file} (its folder is absent)", "a path in a folder that exists")
    measure = load(name, benchmark_folder())
    with progress_bar(f"Measuring {name}") as step:
        rows = list(measure(quick, step))
    text = json.dumps(without_nan([row.to_dict() for row in rows]), indent=2, allow_nan=False)
    write_bytes(json_file, (text + "\n").encode())
    columns = ("target", "value", "", "goal", "unit", "met", "detail")
    print_table(
        f"{name}, quick" if quick else name, columns, [_cells(row) for row in rows], ("value", "goal")
    )
    print_lines([str(json_file)])


def benchmark_folder() -> Path:
    """The folder of the benchmarks: beside the packages in a source checkout, which no wheel contains.

    Raises:
        InvalidInput: when Bentray does not run from a checkout.
    """
    folder = Path(__file__).resolve().parents[3] / "benchmarks"
    if not folder.is_dir():
        raise InvalidInput("benchmarks", f"no folder {folder}", "a source checkout with `make install`")
    return folder


def load(name: str, folder: Path) -> Rows:
    """The function ``rows(quick, progress)`` of one benchmark.

    Raises:
        InvalidInput: for a name that is no benchmark; lists those that are.
        WorkFailed: when the file does not define ``rows``.
    """
    # A benchmark called as a package is has an underscore behind its name, so as not to stand in for it.
    files = (path.stem for path in folder.glob("*.py") if not path.stem.startswith("_"))
    known = {stem.rstrip("_"): stem for stem in sorted(files)}
    # A hyphen is what a command line has between words, an underscore what a module has.
    stem = name.replace("-", "_")
    if stem not in known:
        raise InvalidInput("name", repr(name), "one of " + ", ".join(known))
    # As a script would see it: benchmarks share files whose names begin with an underscore.
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))
    module = importlib.import_module(known[stem])
    measure: Rows | None = getattr(module, "rows", None)
    if measure is None:
        raise WorkFailed(f"benchmarks/{stem}.py defines no rows(quick, progress)")
    return measure


def _cells(row: Row) -> tuple[str, ...]:
    value = "none" if row.value is None else f"{row.value:.4g}"
    return row.target, value, row.op, f"{row.goal:.4g}", row.unit, "yes" if row.met else "no", row.detail

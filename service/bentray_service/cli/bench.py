"""`bentray bench`: run one benchmark of `benchmarks/` and write its rows."""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Callable, Iterable
from datetime import date
from pathlib import Path
from typing import Annotated

import typer

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.atomic import write_bytes

from .output.benchmark_context import BenchmarkContext
from .output.benchmark_row import Row
from .output.exit_codes import WorkFailed
from .output.terminal import print_lines, print_table, progress_bar, without_nan

Rows = Callable[[BenchmarkContext], Iterable[Row]]


def bench(
    name: Annotated[str, typer.Argument(help="Benchmark: a file name in benchmarks/*/, without .py.")],
    json_file: Annotated[Path, typer.Option("--json", help="File to write the rows to.")],
    quick: Annotated[bool, typer.Option("--quick", help="Smaller problems, as a quick check.")] = False,
    pictures: Annotated[
        Path | None,
        typer.Option(
            help="Folder to write pictures to, e.g. benchmarks/results.", show_default="no pictures"
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(help="Dask scheduler to use instead of own workers, e.g. tcp://head:8786."),
    ] = None,
    tls: Annotated[
        Path | None,
        typer.Option(
            help="Folder with authority.pem, certificate.pem and key.pem, for a scheduler at tls://…"
        ),
    ] = None,
) -> None:
    """Run a benchmark against its targets and peers, in one run on this machine.

    A row that misses its goal is a result, not an error: the exit code is 0 once every row is measured.

    Example:  bentray bench reconstruction --json rows.json
    """
    if not json_file.parent.is_dir():
        raise InvalidInput(
            "--json", f"{json_file} (its folder does not exist)", "a path in an existing folder"
        )
    if pictures is not None and not pictures.is_dir():
        raise InvalidInput("--pictures", f"{pictures} (no such folder)", "an existing folder")
    measure = load(name, benchmark_folder())
    with progress_bar(f"Measuring {name}") as step:
        rows = list(measure(BenchmarkContext(quick, step, pictures, scheduler, tls)))
    measured = {"measured": date.today().isoformat()}
    text = json.dumps(without_nan([row.to_dict() | measured for row in rows]), indent=2, allow_nan=False)
    write_bytes(json_file, (text + "\n").encode())
    columns = ("target", "value", "", "goal", "unit", "met", "detail")
    print_table(
        f"{name}, quick" if quick else name, columns, [_cells(row) for row in rows], ("value", "goal")
    )
    print_lines([str(json_file)])


def benchmark_folder() -> Path:
    """The folder of the benchmarks in a source checkout; it is not part of the wheel.

    Raises:
        InvalidInput: when Bentray does not run from a checkout.
    """
    folder = Path(__file__).resolve().parents[3] / "benchmarks"
    if not folder.is_dir():
        raise InvalidInput("benchmarks", f"no folder {folder}", "a source checkout with `make install`")
    return folder


def load(name: str, folder: Path) -> Rows:
    """The function ``rows(context)`` of one benchmark.

    Raises:
        InvalidInput: for an unknown name, with the list of all benchmarks.
        WorkFailed: when the file does not define ``rows``.
    """
    # Modules imported by several benchmarks start with an underscore.
    files = (path for path in folder.glob("*/*.py") if not path.stem.startswith("_"))
    known = {path.stem: path.parent.name for path in sorted(files, key=lambda path: path.stem)}
    # Hyphens are accepted in place of underscores.
    stem = name.replace("-", "_")
    if stem not in known:
        raise InvalidInput("name", repr(name), "one of " + ", ".join(known))
    # The benchmarks are a namespace package of the checkout.
    if str(folder.parent) not in sys.path:
        sys.path.insert(0, str(folder.parent))
    module = importlib.import_module(f"{folder.name}.{known[stem]}.{stem}")
    measure: Rows | None = getattr(module, "rows", None)
    if measure is None:
        raise WorkFailed(f"benchmarks/{known[stem]}/{stem}.py defines no rows(context)")
    return measure


def _cells(row: Row) -> tuple[str, ...]:
    value = "none" if row.value is None else f"{row.value:.4g}"
    return row.target, value, row.op, f"{row.goal:.4g}", row.unit, "yes" if row.met else "no", row.explained

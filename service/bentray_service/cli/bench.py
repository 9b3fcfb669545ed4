"""`bentray bench`: run one benchmark of `benchmarks/` and write its rows."""

import importlib
import sys
from collections.abc import Callable, Iterable, Sequence
from datetime import date
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Annotated

import typer

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.atomic import write_json

from .output.benchmark_context import BenchmarkContext
from .output.benchmark_row import Row
from .output.exit_codes import WorkFailed
from .output.terminal import print_lines, print_table, progress_bar, remark, without_nan

Rows = Callable[[BenchmarkContext], Iterable[Row]]

# The benchmark that writes a report of others.
REPORT = "dissertation"


def bench(
    name: Annotated[
        str,
        typer.Argument(help="Benchmark: a file name in benchmarks/*/, without .py; or dissertation."),
    ],
    json_file: Annotated[
        Path | None,
        typer.Option("--json", help="File to write the rows to; required except for dissertation."),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Smaller problems, as a quick check.")] = False,
    pictures: Annotated[
        Path | None,
        typer.Option(
            help="Existing folder to write pictures to, e.g. benchmarks/results.", show_default="no pictures"
        ),
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(
            help="scoreboard: folder with the downloaded OpenBreastUS and NBPslices2D files.",
            show_default="no public cases",
        ),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(
            help="dissertation: measure only a chapter, table or figure, e.g. chapter6, table8, figure31; "
            "may be repeated."
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="dissertation: folder of report.html and report.json. A run with the same folder continues.",
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

    dissertation measures every table and figure of chapters 3 to 7 of the dissertation and writes one report
    to -o DIR. Parts that are complete there are kept, if size, version and cluster are the same.

    Example:  bentray bench reconstruction --json rows.json
    """
    if name == REPORT:
        if json_file is not None or pictures is not None:
            option = "--json" if json_file is not None else "--pictures"
            raise InvalidInput(option, f"given with {REPORT}", "-o DIR, which holds rows and pictures")
        if output is None:
            raise InvalidInput("-o", "none", f"a folder for the report of {REPORT}")
        with progress_bar("Measuring") as step:
            write_report(BenchmarkContext(quick, step, None, scheduler, tls), output, only or [])
        return
    if only or output is not None:
        raise InvalidInput("--only" if only else "-o", f"given with {name}", f"the benchmark {REPORT}")
    if json_file is None:
        raise InvalidInput("--json", "none", "a path in an existing folder")
    if not json_file.parent.is_dir():
        raise InvalidInput(
            "--json", f"{json_file} (its folder does not exist)", "a path in an existing folder"
        )
    if pictures is not None and not pictures.is_dir():
        raise InvalidInput("--pictures", f"{pictures} (no such folder)", "an existing folder")
    if data is not None and not data.is_dir():
        raise InvalidInput("--data", f"{data} (no such folder)", "an existing folder")
    measure = load(name, benchmark_folder())
    with progress_bar(f"Measuring {name}") as step:
        rows = list(measure(BenchmarkContext(quick, step, pictures, scheduler, tls, data=data)))
    measured = {"measured": date.today().isoformat()}
    write_json(json_file, without_nan([row.to_dict() | measured for row in rows]))
    columns = ("target", "value", "", "goal", "unit", "met", "detail")
    print_table(
        f"{name}, quick" if quick else name, columns, [_cells(row) for row in rows], ("value", "goal")
    )
    print_lines([str(json_file)])


def write_report(context: BenchmarkContext, output: Path, only: Sequence[str]) -> None:
    """Measure the tables and figures of the dissertation; print the state of each and the files.

    Raises:
        InvalidInput: for a file in place of the folder, or an unknown table or figure.
        WorkFailed: when a benchmark stopped with an error; the report states it.
    """
    if output.exists() and not output.is_dir():
        raise InvalidInput("-o", f"{output} (a file)", "a folder")
    folder = benchmark_folder()
    made = module_of(REPORT, folder).report(context, output, only, partial(load, folder=folder), remark)
    rows = [(item["name"], item["state"], item["title"]) for one in made["chapters"] for item in one["items"]]
    print_table("dissertation, quick" if context.quick else REPORT, ("item", "state", "content"), rows)
    print_lines([str(output / "report.html"), str(output / "report.json")])
    stopped = [f"{part['benchmark']}: {part['error']}" for part in made["parts"] if part.get("error")]
    if stopped:
        raise WorkFailed("; ".join(stopped))


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
    module = module_of(name, folder)
    measure: Rows | None = getattr(module, "rows", None)
    if measure is None:
        *_, area, stem = module.__name__.split(".")
        raise WorkFailed(f"benchmarks/{area}/{stem}.py defines no rows(context)")
    return measure


def module_of(name: str, folder: Path) -> ModuleType:
    """The module of one benchmark.

    Raises:
        InvalidInput: for an unknown name, with the list of all benchmarks.
    """
    # Modules imported by several benchmarks start with an underscore.
    files = (path for path in folder.glob("*/*.py") if not path.stem.startswith("_"))
    benchmarks = {path.stem: path.parent.name for path in sorted(files, key=lambda path: path.stem)}
    # Hyphens are accepted in place of underscores.
    stem = name.replace("-", "_")
    if stem not in benchmarks:
        raise InvalidInput("name", repr(name), "one of " + ", ".join(benchmarks))
    # The benchmarks are a namespace package of the checkout.
    if str(folder.parent) not in sys.path:
        sys.path.insert(0, str(folder.parent))
    return importlib.import_module(f"{folder.name}.{benchmarks[stem]}.{stem}")


def _cells(row: Row) -> tuple[str, ...]:
    value = "none" if row.value is None else f"{row.value:.4g}"
    return row.target, value, row.op, f"{row.goal:.4g}", row.unit, "yes" if row.met else "no", row.explained

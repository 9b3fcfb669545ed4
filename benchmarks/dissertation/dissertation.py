"""Every table and figure of chapters 3 to 7 of the dissertation beside ours, in one report."""

import json
import shutil
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from bentray_kernels.errors import InvalidInput
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.terminal import without_nan
from bentray_workers.files.atomic import write_bytes

from ._outline import CHAPTERS, Item, benchmarks_of, items
from ._page import page
from ._parts import OWN_WORKERS, Part, Parts, Rows, settings_of
from ._process import Load, measure_in_process
from ._report import report_of

Measure = Callable[[Load, Parts, str, BenchmarkContext], Part]

JSON, HTML = "report.json", "report.html"


def report(
    context: BenchmarkContext,
    folder: Path,
    only: Sequence[str],
    load: Load,
    say: Callable[[str], None],
    measure: Measure = measure_in_process,
) -> dict[str, Any]:
    """Measure what is not complete in a folder, and write ``report.json`` and ``report.html`` there.

    Both files are written anew after each part, so that a run that is ended early leaves its report.

    Args:
        context: size, progress and cluster; pictures and temporary files go into the folder.
        folder: of the report, made if it does not exist.
        only: names of chapters, tables and figures to measure; empty: all.
        load: the rows of a benchmark by its name.
        say: called with a line after each part.
        measure: measures and keeps a part.

    Raises:
        InvalidInput: for a name that is no chapter, table or figure, or an address without a scheduler.
    """
    chosen = benchmarks_of(selected(only))
    if context.scheduler is not None:
        with context.cluster():
            # An address without a scheduler is refused before anything is measured.
            pass
    scratch = folder / "work"
    # Of a run that was killed.
    shutil.rmtree(scratch, ignore_errors=True)
    scratch.mkdir(parents=True)
    context = replace(context, scratch=scratch)
    store = Parts(folder)
    measures = {name: load(name) for name in benchmarks_of(tuple(items()))}
    parts = kept(store, measures, context)
    outcome = written(store, parts, context)
    for number, name in enumerate(chosen):
        if name in parts:
            say(f"{name}: complete, measured on {parts[name].measured}")
            continue

        def step(done: int, total: int, note: str = "", name: str = name, number: int = number) -> None:
            share = done / total if total else 0.0
            context.progress(int(100 * (number + min(share, 1.0))), 100 * len(chosen), f"{name}: {note}")

        part = parts[name] = measure(load, store, name, replace(context, progress=step))
        outcome = written(store, parts, context)
        ended = f"stopped: {part.error}" if part.error else f"{len(part.rows)} rows"
        say(f"{name}: {ended} in {part.seconds:.0f} s ({number + 1} of {len(chosen)})")
    context.progress(100 * len(chosen), 100 * len(chosen), "done")
    return outcome


def selected(only: Iterable[str]) -> tuple[Item, ...]:
    """The items by names of chapters, tables and figures; all of them without a name.

    Raises:
        InvalidInput: for another name.
    """
    names = {chapter.key: chapter.items for chapter in CHAPTERS}
    names |= {item.key: (item,) for item in items()}
    chosen: list[Item] = []
    for name in only:
        key = name.lower().replace(" ", "").replace("-", "")
        if key not in names:
            raise InvalidInput("--only", repr(name), "one of " + ", ".join(names))
        chosen += names[key]
    return tuple(chosen) if only else tuple(items())


def kept(store: Parts, measures: dict[str, Rows], context: BenchmarkContext) -> dict[str, Part]:
    """The parts that are complete for the settings of this run."""
    complete = {name: store.complete(name, settings_of(rows, context)) for name, rows in measures.items()}
    return {name: part for name, part in complete.items() if part is not None}


def written(store: Parts, parts: dict[str, Part], context: BenchmarkContext) -> dict[str, Any]:
    """Write both files of the report; returns its data."""
    cluster = f"workers of {context.scheduler}" if context.scheduler else OWN_WORKERS
    outcome = report_of(parts, quick=context.quick, cluster=cluster)
    text = json.dumps(without_nan(outcome), indent=1, ensure_ascii=False, allow_nan=False)
    write_bytes(store.folder / JSON, (text + "\n").encode())
    html = page(outcome, lambda benchmark, name: store.pictures(benchmark) / name)
    write_bytes(store.folder / HTML, html.encode())
    return outcome

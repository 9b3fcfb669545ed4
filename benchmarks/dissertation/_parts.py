"""Parts of a report, rows and pictures of one benchmark each, kept in files so that a run can continue."""

import json
import os
import shutil
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field, replace
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import Any

from bentray_kernels.compilation.sources import digest
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import without_nan
from bentray_workers.files.atomic import write_bytes

from ._outline import benchmarks_of, items

Rows = Callable[[BenchmarkContext], Iterable[Row]]

OWN_WORKERS, RECORDED = "own workers", "recorded rows"


@dataclass(frozen=True)
class Part:
    """Rows, pictures and errors of one benchmark.

    Attributes:
        benchmark: its name.
        settings: on which its rows depend; a part is complete for the same ones only.
        measured: date.
        seconds: computing time of the benchmark, s; None of recorded rows.
        load: load average at the end; None of recorded rows.
        rows: in the form of ``Row.to_dict``.
        pictures: names of files in the folder of its pictures.
        error: why the benchmark stopped; empty if it did not.
        uses_cluster: whether it computed on workers.
    """

    benchmark: str
    settings: dict[str, Any]
    measured: str
    seconds: float | None
    load: float | None
    rows: list[dict[str, Any]] = field(default_factory=list)
    pictures: list[str] = field(default_factory=list)
    error: str = ""
    uses_cluster: bool = False


@dataclass(frozen=True)
class Parts:
    """The parts in a folder: ``parts/NAME.json`` and the pictures in ``parts/NAME/``."""

    folder: Path

    def pictures(self, benchmark: str) -> Path:
        """Folder of the pictures of a part."""
        return self.folder / "parts" / benchmark

    def read(self, benchmark: str) -> Part | None:
        """A part that was written, of any settings; None without one or if its file is damaged."""
        try:
            return Part(**json.loads(self._file(benchmark).read_text()))
        except (OSError, ValueError, TypeError):
            return None

    def complete(self, benchmark: str, settings: dict[str, Any]) -> Part | None:
        """A part that need not be measured again; None if it is missing, failed or of other settings."""
        part = self.read(benchmark)
        if part is None or part.error or part.settings != settings:
            return None
        drawn = all((self.pictures(benchmark) / name).is_file() for name in part.pictures)
        return part if drawn else None

    def measure(self, benchmark: str, rows: Rows, context: BenchmarkContext) -> Part:
        """Run a benchmark and keep its part; the file appears only after the last row.

        An exception of the benchmark is kept as ``error``: other parts are still measured.
        """
        drawn, settings = self.pictures(benchmark), settings_of(rows, context)
        self.forget(benchmark)
        drawn.mkdir(parents=True)
        connected = ConnectedContext(**vars(replace(context, pictures=drawn)))
        started, measured, error = time.perf_counter(), [], ""
        try:
            measured += rows(connected)
        except Exception as exception:  # Of any package that a benchmark compares with.
            error = f"{type(exception).__name__}: {exception}"
        return self._kept(
            Part(
                benchmark,
                settings,
                date.today().isoformat(),
                time.perf_counter() - started,
                os.getloadavg()[0],
                [row.to_dict() for row in measured],
                sorted(path.name for path in drawn.iterdir()),
                error,
                bool(connected.connections),
            )
        )

    def forget(self, benchmark: str) -> None:
        """Delete a part and its pictures."""
        self._file(benchmark).unlink(missing_ok=True)
        shutil.rmtree(self.pictures(benchmark), ignore_errors=True)

    def keep_failure(self, benchmark: str, error: str, seconds: float) -> Part:
        """Keep a part without rows, of a benchmark that ended its process."""
        return self._kept(
            Part(benchmark, {}, date.today().isoformat(), seconds, os.getloadavg()[0], error=error)
        )

    def _kept(self, part: Part) -> Part:
        text = json.dumps(without_nan(asdict(part)), indent=1, allow_nan=False)
        write_bytes(self._file(part.benchmark), text.encode())
        return part

    def _file(self, benchmark: str) -> Path:
        return self.folder / "parts" / f"{benchmark}.json"


@dataclass(frozen=True)
class ConnectedContext(BenchmarkContext):
    """A context that records whether a benchmark used a cluster."""

    connections: list[str] = field(default_factory=list)

    def cluster(self) -> Any:
        """See ``BenchmarkContext``."""
        self.connections.append(self.scheduler or OWN_WORKERS)
        return super().cluster()


def settings_of(rows: Rows, context: BenchmarkContext) -> dict[str, Any]:
    """Settings that the rows of a benchmark depend on: size, version, sources and cluster."""
    return {
        "quick": context.quick,
        "version": version("bentray"),
        "sources": digest(rows.__module__),
        "cluster": context.scheduler or OWN_WORKERS,
    }


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

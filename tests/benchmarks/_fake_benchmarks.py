"""Benchmarks made for the tests of the report of the dissertation."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from benchmarks.dissertation import dissertation
from benchmarks.dissertation._outline import benchmarks_of, items
from benchmarks.dissertation._parts import Part, Parts
from benchmarks.dissertation._process import Load

from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

NAMES = benchmarks_of(tuple(items()))
PNG = b"\x89PNG"
IMAGE = {"best constant": 0.3, "water alone": 0.4, "straight rays": 0.2, "default settings": 0.1}


class Fakes:
    """Benchmarks by name: each yields two rows for every label of the outline, and its pictures."""

    def __init__(self) -> None:
        self.ran: list[str] = []
        self.stops: dict[str, BaseException] = {}

    def load(self, name: str) -> Callable[[BenchmarkContext], Iterable[Row]]:
        def rows(context: BenchmarkContext) -> Iterable[Row]:
            self.ran.append(name)
            sources = [(item, entry) for item in items() for entry in item.sources if entry.benchmark == name]
            for file in {file for item, _ in sources for file in item.pictures}:
                context.save_picture(file, lambda: PNG)
            context.progress(1, 2, "half")
            for target in dict.fromkeys(target for _, source in sources for target in source.targets):
                yield Row(f"{target} <first>", 0.1, 0.2, "<=", "of range", "a & b", baselines=IMAGE)
                yield Row(f"{target} second", 2.0, 1.0, "<=", "", "missed")
            if name in self.stops:
                raise self.stops[name]
            if name == "reconstruction_volume":
                context.cluster()

        return rows

    def report(self, folder: Path, *only: str, quick: bool = True, scheduler: str | None = None) -> dict:
        context = BenchmarkContext(quick, lambda done, total, note="": None, scheduler=scheduler)
        return dissertation.report(context, folder, only, self.load, lambda line: None, in_this_process)


def in_this_process(load: Load, store: Parts, name: str, context: BenchmarkContext) -> Part:
    return store.measure(name, load(name), context)


def by_name(name: str):
    return next(item for item in items() if item.name == name)


def of(made: dict, name: str) -> dict:
    return next(item for chapter in made["chapters"] for item in chapter["items"] if item["name"] == name)


def state_of(made: dict, name: str) -> str:
    return of(made, name)["state"]

"""Tables and figures of chapters 3 to 7 of the dissertation: published values, and the rows beside them."""

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

FILE = Path(__file__).parent / "outline.toml"


@dataclass(frozen=True)
class Source:
    """Rows of a benchmark.

    Attributes:
        benchmark: name for ``bentray bench``.
        targets: beginnings of the labels of the rows; empty: only pictures are used.
    """

    benchmark: str
    targets: tuple[str, ...] = ()


@dataclass(frozen=True)
class Item:
    """A table or figure.

    Attributes:
        name: number in the dissertation, as ``Table 8``.
        title: content, in a few words.
        published: what was published, by name; figures alone.
        sources: rows beside it.
        pictures: files that the benchmarks draw.
        replaced: what a replaced input is, if the picture cannot be drawn of the published one.
        sketch: whether it is a sketch of a method, which has no result.
        unreached: whether a published value is not reached although no row has it as its goal.
        why: one sentence on what does not reproduce.
    """

    name: str
    title: str
    published: Mapping[str, str] = field(default_factory=dict)
    sources: tuple[Source, ...] = ()
    pictures: tuple[str, ...] = ()
    replaced: str = ""
    sketch: bool = False
    unreached: bool = False
    why: str = ""

    @property
    def key(self) -> str:
        """Name for ``--only``, as ``table8``."""
        return self.name.lower().replace(" ", "")


@dataclass(frozen=True)
class Chapter:
    """A chapter with its tables and figures, in the order of the dissertation."""

    number: int
    title: str
    items: tuple[Item, ...]

    @property
    def key(self) -> str:
        """Name for ``--only``, as ``chapter8``."""
        return f"chapter{self.number}"


def read(file: Path = FILE) -> tuple[Chapter, ...]:
    """The chapters in ``outline.toml``."""

    def item(entry: dict[str, Any]) -> Item:
        lists = {"pictures": tuple(entry.pop("pictures", ()))}
        named = entry.pop("sources", {})
        sources = tuple(Source(name, tuple(targets)) for name, targets in named.items())
        return Item(**entry, **lists, sources=sources)

    chapters = tomllib.loads(file.read_text())["chapters"]
    return tuple(
        Chapter(entry["number"], entry["title"], tuple(map(item, entry["items"]))) for entry in chapters
    )


CHAPTERS = read()


def items() -> Iterator[Item]:
    """All items, in the order of the dissertation."""
    for chapter in CHAPTERS:
        yield from chapter.items


def benchmarks_of(chosen: Iterator[Item] | tuple[Item, ...]) -> list[str]:
    """Benchmarks that measure or draw some items, each once, in the order of the dissertation."""
    return list(dict.fromkeys(source.benchmark for item in chosen for source in item.sources))

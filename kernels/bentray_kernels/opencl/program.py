"""A program for OpenCL devices: source files and the macros that the compiler gets with them."""

from __future__ import annotations

from importlib import resources
from typing import NamedTuple


class Program(NamedTuple):
    """Sources that are built as one. Each engine lists its own; ``device_engines.programs`` has all.

    Attributes:
        sources: names of the files ``sources/<source>.cl``, in the order in which the compiler reads them.
        defines: ``NAME=VALUE``.
    """

    sources: tuple[str, ...]
    defines: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """The files, each with its name for messages of the compiler."""
        return "".join(map(_named, self.sources))


def _named(source: str) -> str:
    file = f"{source}.cl"
    text = resources.files(__package__).joinpath("sources", *file.split("/")).read_text()
    return f'#line 1 "{file}"\n{text}\n'

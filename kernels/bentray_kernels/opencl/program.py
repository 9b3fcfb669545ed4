"""A program for OpenCL devices: source files and the macros that the compiler gets with them."""

import re
from functools import cache
from importlib import resources
from typing import NamedTuple


class Program(NamedTuple):
    """Sources that are built as one.

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

    def positions(self, kernel: str) -> dict[str, int]:
        """Positions of a kernel's arguments by name, as its source declares them."""
        return _positions(self.text, kernel)


@cache
def _positions(text: str, kernel: str) -> dict[str, int]:
    signature = re.search(rf"\bkernel void {kernel}\(([^)]*)\)", text)
    assert signature is not None, kernel
    return {re.findall(r"\w+", one)[-1]: k for k, one in enumerate(signature[1].split(","))}


def _named(source: str) -> str:
    file = f"{source}.cl"
    text = resources.files(__package__).joinpath("sources", *file.split("/")).read_text()
    return f'#line 1 "{file}"\n{text}\n'

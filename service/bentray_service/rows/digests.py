"""What a stored thing holds, as a number of bytes and a SHA-256."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import NamedTuple


class Digest(NamedTuple):
    """Of a file, or of all files in a folder.

    Attributes:
        bytes: how many.
        sha256: in hexadecimal; of a folder that of its files' names, each with its SHA-256.
    """

    bytes: int
    sha256: str


def digest_of(path: Path) -> Digest:
    """Of what lies at ``path``, read a piece at a time.

    Raises:
        FileNotFoundError: when there is nothing.
    """
    if not path.is_dir():
        with path.open("rb") as file:
            found = hashlib.file_digest(file, "sha256").hexdigest()
            return Digest(file.tell(), found)
    whole, size = hashlib.sha256(), 0
    for inside in sorted(path.iterdir()):
        one = digest_of(inside)
        size += one.bytes
        whole.update(f"{one.sha256}  {inside.name}\n".encode())
    return Digest(size, whole.hexdigest())


def stamp_of(path: Path) -> tuple[int, ...]:
    """What tells a thing that was written anew from the old one without reading it."""
    inside = sorted(path.iterdir()) if path.is_dir() else [path]
    states = [one.stat() for one in inside]
    return tuple(figure for one in states for figure in (one.st_ino, one.st_mtime_ns, one.st_size))

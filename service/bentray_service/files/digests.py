"""Size and SHA-256 of a stored file or folder."""

from __future__ import annotations

import hashlib
from pathlib import Path

from ..rows.checksums import Digest


def digest_of(path: Path) -> Digest:
    """Compute the digest of a file or folder, read in blocks.

    Raises:
        FileNotFoundError: when ``path`` does not exist.
    """
    if not path.is_dir():
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
            return Digest(file.tell(), digest)
    whole, size = hashlib.sha256(), 0
    for inside in sorted(path.iterdir()):
        one = digest_of(inside)
        size += one.bytes
        whole.update(f"{one.sha256}  {inside.name}\n".encode())
    return Digest(size, whole.hexdigest())


def stamp_of(path: Path) -> tuple[int, ...]:
    """Inode, modification time and size of each file, to detect changes without reading the files."""
    inside = sorted(path.iterdir()) if path.is_dir() else [path]
    states = [one.stat() for one in inside]
    return tuple(figure for one in states for figure in (one.st_ino, one.st_mtime_ns, one.st_size))

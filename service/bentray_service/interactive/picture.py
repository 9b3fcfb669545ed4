"""A picture as bytes that a notebook shows."""

from __future__ import annotations

import os
from pathlib import Path


class Picture(bytes):
    """A picture in PNG; a notebook shows it."""

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write it to a file, which is replaced.

        Raises:
            OSError: where the folder cannot be written to or the disk is full.
        """
        from bentray_workers.files.atomic import write_bytes

        target = Path(path)
        write_bytes(target, self)
        return target

    def _repr_png_(self) -> bytes:
        return bytes(self)

    def __repr__(self) -> str:
        # Of a PNG, width and height follow the name of its first chunk.
        width, height = (int.from_bytes(self[at : at + 4]) for at in (16, 20))
        return f"<bentray.Picture of {width} x {height} pixels>"

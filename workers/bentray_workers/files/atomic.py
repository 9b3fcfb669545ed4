"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """A path beside ``target`` to write to; on leaving, what lies there takes the target's place.

    The content reaches the disk before the name does, and the folder after it, so that a crash leaves
    the old file or the new one. On any error the target stays as it was and the partial file goes.
    Each use has its own partial file: of two writers at once, the last to finish wins.

    Raises:
        OSError: where the folder cannot be written to.
    """
    partial = target.with_name(f"{target.name}.{secrets.token_hex(4)}.partial")
    try:
        yield partial
        sync(partial)
        partial.replace(target)
    except BaseException:
        with suppress(FileNotFoundError):
            partial.unlink()
        raise
    sync(target.parent)


def write_bytes(target: Path, content: bytes) -> None:
    """Write ``content`` to ``target`` whole or not at all; see ``replacing``."""
    with replacing(target) as partial:
        partial.write_bytes(content)


def sync(path: Path) -> None:
    """Let the content of a file, or the names in a folder, survive a power cut."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)

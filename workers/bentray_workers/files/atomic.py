"""Atomic writing of files."""

import json
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def atomic_replace(target: Path) -> Iterator[Path]:
    """A temporary path beside ``target`` to write to; renamed to the target at the end of the context.

    The content is synchronised to the disk before the name, and then the folder, so that a crash leaves
    the old file or the new one. On any error the target is unchanged and the temporary file is removed.
    Each use has its own temporary file: of two concurrent writers, the last to finish wins.

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
    """Write ``content`` to ``target`` atomically."""
    with atomic_replace(target) as partial:
        partial.write_bytes(content)


def write_json(target: Path, content: object) -> None:
    """Write plain values to ``target`` atomically, as indented JSON."""
    write_bytes(target, (json.dumps(content, indent=2, allow_nan=False) + "\n").encode())


def sync(path: Path) -> None:
    """Synchronise the content of a file, or the names in a folder, to the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)

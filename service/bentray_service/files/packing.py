"""Packing of a folder into one file, and unpacking."""

from __future__ import annotations

import hashlib
import os
import secrets
import shutil
import tarfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from bentray_workers.files.atomic import sync


@contextmanager
def packed(path: Path, scratch: Path) -> Iterator[Path]:
    """The file at ``path``, or a temporary tar file of the folder.

    Args:
        path: a file, or a folder with files only.
        scratch: folder of the temporary file.
    """
    if not path.is_dir():
        yield path
        return
    whole = scratch / f"{secrets.token_hex(8)}.tar"
    try:
        with tarfile.open(whole, "w") as archive:
            for inside in sorted(path.iterdir()):
                archive.add(inside, inside.name, recursive=False)
        yield whole
    finally:
        whole.unlink(missing_ok=True)


def metadata_of(path: Path, whole: Path) -> dict[str, str]:
    """Metadata for ``unpack``: SHA-256, form and modification time."""
    with whole.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    form = "folder" if path.is_dir() else "file"
    return {"sha256": digest, "form": form, "mtime-ns": str(path.stat().st_mtime_ns)}


def unpack(whole: Path, metadata: Mapping[str, str], path: Path) -> None:
    """Unpack ``whole`` to ``path``, atomically and durably, with the original modification time.

    Raises:
        ValueError: when the SHA-256 differs from the metadata.
    """
    if metadata_of(whole, whole)["sha256"] != metadata.get("sha256"):
        raise ValueError(f"the SHA-256 of {path.name} has changed")
    ready = whole
    try:
        if metadata["form"] == "folder":
            ready = whole.with_suffix(".unpacked")
            with tarfile.open(whole) as archive:
                archive.extractall(ready, filter="data")
            for inside in ready.iterdir():
                sync(inside)
            sync(ready)
        else:
            sync(whole)
        os.utime(ready, ns=(ready.stat().st_atime_ns, int(metadata["mtime-ns"])))
        # An existing folder has the same content, since names are never reused.
        if not path.is_dir():
            ready.replace(path)
        sync(path.parent)
    finally:
        if ready is not whole:
            shutil.rmtree(ready, ignore_errors=True)

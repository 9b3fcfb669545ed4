"""A thing as one file: a file as it is, a folder packed, and back."""

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
    """One file that holds what lies at ``path``: itself, or for a folder a tar file, which goes again.

    Args:
        path: of a file, or of a folder with nothing but files.
        scratch: where the tar file lies meanwhile.
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
    """What to tell beside ``whole``, so that ``unpack`` can check it and make ``path`` again."""
    with whole.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    form = "folder" if path.is_dir() else "file"
    return {"sha256": digest, "form": form, "mtime-ns": str(path.stat().st_mtime_ns)}


def unpack(whole: Path, told: Mapping[str, str], path: Path) -> None:
    """Let the thing in ``whole`` lie at ``path``, with the age it had, at once and safe from a power cut.

    Raises:
        ValueError: when it is not what was told of it.
    """
    if metadata_of(whole, whole)["sha256"] != told.get("sha256"):
        raise ValueError(f"{path.name} has another SHA-256 than when it was written")
    ready = whole
    try:
        if told["form"] == "folder":
            ready = whole.with_suffix(".unpacked")
            with tarfile.open(whole) as archive:
                archive.extractall(ready, filter="data")
            for inside in ready.iterdir():
                sync(inside)
            sync(ready)
        else:
            sync(whole)
        os.utime(ready, ns=(ready.stat().st_atime_ns, int(told["mtime-ns"])))
        # A folder that lies there by now is the same: no name is ever used for anything else.
        if not path.is_dir():
            ready.replace(path)
        sync(path.parent)
    finally:
        if ready is not whole:
            shutil.rmtree(ready, ignore_errors=True)

"""Files on disk: usage, removal, digests, permissions, and packing of folders."""

import hashlib
import logging
import os
import secrets
import shutil
import stat
import tarfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.atomic import sync

from ..rows.checksums import Digest

# Permissions of the group and of others.
OTHERS = stat.S_IRWXG | stat.S_IRWXO


def bytes_in(folder: Path) -> int:
    """Total size of the files in a folder, bytes; files deleted meanwhile are ignored."""
    total = 0
    for place, _, names in os.walk(folder):
        for name in names:
            with suppress(FileNotFoundError):
                total += Path(place, name).lstat().st_size
    return total


def remove_path(path: Path) -> None:
    """Remove a file or a folder with its content; a missing one is ignored."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def sha256_of(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def digest_of(path: Path) -> Digest:
    """Compute the digest of a file or folder, read in blocks.

    Raises:
        FileNotFoundError: when ``path`` does not exist.
    """
    if not path.is_dir():
        return Digest(path.stat().st_size, sha256_of(path))
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
    form = "folder" if path.is_dir() else "file"
    return {"sha256": sha256_of(whole), "form": form, "mtime-ns": str(path.stat().st_mtime_ns)}


def unpack(whole: Path, metadata: Mapping[str, str], path: Path) -> None:
    """Unpack ``whole`` to ``path``, atomically and durably, with the original modification time.

    Raises:
        ValueError: when the SHA-256 differs from the metadata.
    """
    if sha256_of(whole) != metadata.get("sha256"):
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


log = logging.getLogger("bentray.storage")


@contextmanager
def private_files() -> Iterator[None]:
    """Create files with mode 0600 and folders with 0700 within the block."""
    before = os.umask(OTHERS)
    try:
        yield
    finally:
        os.umask(before)


def close_to_others(root: Path) -> None:
    """Remove the permissions of other users from a folder and its content.

    Raises:
        InvalidInput: when they cannot be removed.
    """
    found = stat.S_IMODE(root.stat().st_mode)
    if not found & OTHERS:
        return
    with suppress(PermissionError):
        root.chmod(found & ~OTHERS)
    if stat.S_IMODE(root.stat().st_mode) & OTHERS:
        raise InvalidInput(
            "data_dir",
            f"{root}, accessible for other users of this machine (mode {found:04o})",
            "a folder whose permissions this user can change, e.g. a new folder inside",
        )
    # Files in a private folder are not reachable; this covers files that are moved or copied later.
    changed = 0
    for folder, folders, files in os.walk(root):
        for path in (Path(folder, name) for name in (*folders, *files)):
            with suppress(FileNotFoundError, PermissionError):
                mode = stat.S_IMODE(path.lstat().st_mode)
                if mode & OTHERS and not path.is_symlink():
                    path.chmod(mode & ~OTHERS)
                    changed += 1
    log.warning(
        "%s had mode %04o; removed the permissions of others from it and %d files", root, found, changed
    )

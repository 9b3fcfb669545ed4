"""The folder of a backup: its files, their checksums, and the description that makes it complete."""

import fcntl
import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.atomic import atomic_replace, write_bytes

# Written last: a folder without it is no backup.
DESCRIPTION = "backup.json"
# Marks a folder whose backup was begun; locked while it is written.
UNFINISHED = "unfinished"
# For `sha256sum -c`.
SUMS = "SHA256SUMS"
DATABASE = "database.sqlite"
# Folders of the data folder that are in a backup.
FOLDERS = ("tenants", "audit")
# In the data folder: the time of its newest backup, for the metrics.
NEWEST = "newest-backup.json"

FORMAT, FORMAT_VERSION = "bentray-backup", 1
BLOCK = 1 << 20


@dataclass(frozen=True)
class Description:
    """Contents of a backup.

    Attributes:
        bentray: version that wrote it.
        schema: version of the database.
        finished: s since 1970.
        id: unique.
        items: number of stored items; bytes: size of all files.
        missing: items that were damaged or missing in the service, and are not in the backup.
        sums: SHA-256 of ``SHA256SUMS``.
    """

    bentray: str
    schema: int
    finished: float
    id: str
    items: int
    bytes: int
    missing: tuple[str, ...]
    sums: str

    def write(self, folder: Path) -> None:
        """Make the backup in a folder complete."""
        content = {"format": FORMAT, "format_version": FORMAT_VERSION, **asdict(self)}
        write_bytes(folder / DESCRIPTION, json.dumps(content, indent=2).encode())


def read_description(folder: Path, newest_schema: int) -> Description:
    """The description of a complete backup.

    Raises:
        InvalidInput: when the folder holds none, or one of a later version.
    """
    path = folder / DESCRIPTION
    try:
        content: dict[str, Any] = json.loads(path.read_bytes())
        of_format = content.pop("format") == FORMAT
        version = content.pop("format_version")
        if of_format and version == FORMAT_VERSION and content["schema"] <= newest_schema:
            return Description(**{**content, "missing": tuple(content["missing"])})
    except FileNotFoundError:
        unfinished = (folder / UNFINISHED).exists()
        found = f"{folder}, {'an unfinished backup' if unfinished else 'without backup.json'}"
        accepted = "the folder of a complete backup"
        if unfinished:
            accepted += "; the same `bentray backup` continues this one"
        raise InvalidInput("backup", found, accepted) from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InvalidInput("backup", f"{path} ({error})", "the description of a backup") from error
    found = f"{path}, version {version} with schema version {content['schema']}"
    accepted = f"version {FORMAT_VERSION} with schema version up to {newest_schema}; use a newer Bentray"
    raise InvalidInput("backup", found, accepted)


@contextmanager
def unfinished_backup(folder: Path) -> Iterator[None]:
    """Begin a backup in an empty folder, or continue one; the folder is locked in the block.

    Raises:
        InvalidInput: when the folder has other content, a complete backup, or another process writes to it.
    """
    mark = folder / UNFINISHED
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if (folder / DESCRIPTION).exists():
            raise InvalidInput("folder", f"{folder}, which holds a complete backup", "a new folder")
        if not mark.exists() and any(folder.iterdir()):
            raise InvalidInput("folder", f"{folder}, which is not empty", "a new folder, or an empty one")
        handle = mark.open("ab")
    except OSError as error:
        raise InvalidInput("folder", f"{folder} ({error.strerror})", "a folder to write to") from error
    with handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            found = f"{folder}, to which another process writes"
            raise InvalidInput("folder", found, "a separate folder for every backup") from error
        yield
        mark.unlink()


def newest_backup(data: Path) -> float | None:
    """When the newest backup of a data folder was finished, s since 1970; None if there is none."""
    try:
        return float(json.loads((data / NEWEST).read_bytes())["finished"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def copy_file(source: Path, target: Path, limit: int | None = None) -> str:
    """Copy a file atomically; returns the SHA-256 of the copy.

    Args:
        source, target: paths; the folder of the target is created.
        limit: only these first bytes.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    digest, left = hashlib.sha256(), limit
    with source.open("rb") as reading, atomic_replace(target) as partial, partial.open("wb") as writing:
        while block := reading.read(BLOCK if left is None else min(BLOCK, left)):
            digest.update(block)
            writing.write(block)
            if left is not None:
                left -= len(block)
    return digest.hexdigest()


def write_sums(folder: Path, sums: Mapping[str, str]) -> str:
    """Write the checksums by path; returns the SHA-256 of the list."""
    content = "".join(f"{sums[name]}  {name}\n" for name in sorted(sums)).encode()
    write_bytes(folder / SUMS, content)
    return hashlib.sha256(content).hexdigest()


def read_sums(folder: Path, expected: str) -> dict[str, str]:
    """The checksums by path.

    Raises:
        InvalidInput: when the list is missing or was changed.
    """
    path = folder / SUMS
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InvalidInput("backup", f"{path} ({error.strerror})", "the list of a complete backup") from error
    if hashlib.sha256(content).hexdigest() != expected:
        raise InvalidInput("backup", f"{path}, which was changed", "the list of the backup, unchanged")
    pairs = (line.split("  ", 1) for line in content.decode().splitlines())
    sums = {name: digest for digest, name in pairs}
    for name in sums:
        parts = PurePosixPath(name).parts
        if name != DATABASE and (parts[0] not in FOLDERS or ".." in parts):
            raise InvalidInput("backup", f"{path} with {name!r}", f"paths below {' and '.join(FOLDERS)}")
    return sums

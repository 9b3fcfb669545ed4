"""File permissions: the data folder is accessible for the user of the service only."""

from __future__ import annotations

import logging
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from bentray_kernels.errors import InvalidInput

log = logging.getLogger("bentray.storage")

# Permissions of the group and of others.
OTHERS = stat.S_IRWXG | stat.S_IRWXO


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

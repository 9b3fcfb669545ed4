"""What lies in the data folder is for the user of the service alone: made so, checked and tightened."""

from __future__ import annotations

import logging
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from bentray_kernels.errors import InvalidInput

log = logging.getLogger("bentray.storage")

# Reading, writing and entering by the group and by everybody else.
OTHERS = stat.S_IRWXG | stat.S_IRWXO


@contextmanager
def private_files() -> Iterator[None]:
    """What this process, and each that it starts, makes meanwhile is for its user alone: 0700 and 0600."""
    before = os.umask(OTHERS)
    try:
        yield
    finally:
        os.umask(before)


def close_to_others(root: Path) -> None:
    """Take a folder, and what an older version left in it, from all users but its owner.

    Raises:
        InvalidInput: where others would still reach it.
    """
    found = stat.S_IMODE(root.stat().st_mode)
    if not found & OTHERS:
        return
    with suppress(PermissionError):
        root.chmod(found & ~OTHERS)
    if stat.S_IMODE(root.stat().st_mode) & OTHERS:
        raise InvalidInput(
            "data_dir",
            f"{root}, which other users of this machine can reach (mode {found:04o})",
            "a folder that this user can close to others, as a new one in there",
        )
    # Behind a closed folder nothing is reached; this is for what is moved or copied out of it.
    changed = 0
    for folder, folders, files in os.walk(root):
        for path in (Path(folder, name) for name in (*folders, *files)):
            with suppress(FileNotFoundError, PermissionError):
                mode = stat.S_IMODE(path.lstat().st_mode)
                if mode & OTHERS and not path.is_symlink():
                    path.chmod(mode & ~OTHERS)
                    changed += 1
    log.warning("%s had mode %04o; it and %d files in it are now for its owner alone", root, found, changed)

"""Disk usage and removal of files and folders."""

from __future__ import annotations

import os
import shutil
from pathlib import Path


def bytes_in(folder: Path) -> int:
    """Total size of the files in a folder, bytes; files deleted meanwhile are ignored."""
    total = 0
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                try:
                    inside = entry.is_dir(follow_symlinks=False)
                    total += bytes_in(Path(entry)) if inside else entry.stat(follow_symlinks=False).st_size
                except FileNotFoundError:
                    continue
    except FileNotFoundError:
        return 0
    return total


def remove_path(path: Path) -> None:
    """Remove a file or a folder with its content; a missing one is ignored."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)

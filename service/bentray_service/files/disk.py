"""Disk usage of a folder."""

from __future__ import annotations

import os
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

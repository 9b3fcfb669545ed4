"""The limit of open file descriptors of this process."""

from __future__ import annotations

import resource
from contextlib import suppress
from pathlib import Path

from bentray_kernels.errors import InvalidInput

# Enough for the maximum number of connections.
WANTED = 65_536
# Minimum for the database, Dask and some connections.
MIN_DESCRIPTORS = 512


def raise_limit() -> int:
    """Raise the limit of open files as far as the system permits; returns it.

    Raises:
        InvalidInput: when it is below ``MIN_DESCRIPTORS``.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    target = WANTED if hard == resource.RLIM_INFINITY else min(hard, WANTED)
    if soft != resource.RLIM_INFINITY and soft < target:
        with suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (target, hard))
            soft = target
    found = WANTED if soft == resource.RLIM_INFINITY else soft
    if found < MIN_DESCRIPTORS:
        accepted = f"at least {MIN_DESCRIPTORS}; raise the hard limit (ulimit -Hn, LimitNOFILE= of systemd)"
        raise InvalidInput("open files", f"a limit of {found} for this process", accepted)
    return found


def in_use() -> int:
    """Number of open file descriptors; 0 if unknown."""
    folder = Path("/proc/self/fd")
    return sum(1 for _ in folder.iterdir()) if folder.is_dir() else 0

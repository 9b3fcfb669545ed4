"""How many files and connections this process may have open, and has."""

from __future__ import annotations

import resource
from contextlib import suppress
from pathlib import Path

from bentray_kernels.errors import InvalidInput

# Enough for any number of connections that we take.
WANTED = 65_536
# With fewer there is no room for anybody beside the database and Dask.
LEAST = 512


def raise_limit() -> int:
    """Raise the number of open files to what the system lets it be raised to; returns it.

    Raises:
        InvalidInput: where it stays below ``LEAST``.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = WANTED if hard == resource.RLIM_INFINITY else min(hard, WANTED)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        with suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
            soft = wanted
    found = WANTED if soft == resource.RLIM_INFINITY else soft
    if found < LEAST:
        accepted = f"at least {LEAST}; raise the hard limit (ulimit -Hn, LimitNOFILE= of systemd)"
        raise InvalidInput("open files", f"a limit of {found} for this process", accepted)
    return found


def in_use() -> int:
    """How many are open now; 0 where the system does not tell."""
    folder = Path("/proc/self/fd")
    return sum(1 for _ in folder.iterdir()) if folder.is_dir() else 0

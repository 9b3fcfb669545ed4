"""Limits the number of malloc arenas of glibc, to reduce the memory use of many threads."""

from __future__ import annotations

import ctypes

# Parameter of ``mallopt`` in <malloc.h>.
M_ARENA_MAX = -8
# In addition to the main arena; threads rarely allocate at the same time because of the GIL.
MAX_ARENAS = 2


def limit_arenas() -> None:
    """Set the limit; to be called before threads are started. No effect with other C libraries."""
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return
    mallopt(M_ARENA_MAX, MAX_ARENAS)

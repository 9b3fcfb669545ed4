"""Few arenas of memory for many threads: each keeps what is free in it, and glibc makes a dozen of them."""

from __future__ import annotations

import ctypes

# glibc's number for ``mallopt``, of <malloc.h>.
M_ARENA_MAX = -8
# Beside the first: threads hardly allocate at the same time, for they take turns with the interpreter.
MOST = 2


def limit_arenas() -> None:
    """To be called before there are threads; where the C library is another, nothing happens."""
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return
    mallopt(M_ARENA_MAX, MOST)

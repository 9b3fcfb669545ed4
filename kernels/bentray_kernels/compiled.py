"""The decorator of every compiled kernel: no GIL, cached on disk, stale as soon as any kernel changed."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, overload

from numba import njit


def _stamp() -> str:
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()


# Numba's own cache looks at the time and size of a function's file, not at the files of what it calls:
# after an edit or an upgrade it would go on running the old inner function. So the content of all decides.
SOURCES = _stamp()


Function = TypeVar("Function", bound=Callable[..., Any])


@overload
def kernel(function: Function) -> Function: ...


@overload
def kernel(*, inline: str) -> Callable[[Function], Function]: ...


def kernel(function: Callable[..., Any] | None = None, *, inline: str = "never") -> Any:
    """Compile with numba on first call, without the GIL.

    Args:
        function: the function, when used without arguments.
        inline: as numba's; ``always`` for small functions inside the innermost loops.
    """
    if function is None:
        return lambda wrapped: _compiled(wrapped, inline)
    return _compiled(function, inline)


def _compiled(function: Callable[..., Any], inline: str) -> Any:
    dispatcher = njit(cache=True, nogil=True, inline=inline)(function)
    dispatcher._cache._cache_file._source_stamp = SOURCES
    return dispatcher

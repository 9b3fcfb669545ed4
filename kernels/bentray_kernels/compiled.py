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
        inline: ``always`` for the functions inside innermost loops; they may not make arrays.
    """
    if function is None:
        return lambda wrapped: _compiled(wrapped, inline == "always")
    return _compiled(function, inline == "always")


def _compiled(function: Callable[..., Any], inner: bool) -> Any:
    # Inner functions are inlined by LLVM and built without reference counts. Inlined by numba instead, each
    # would count its array arguments up and down, atomically: factored marching took four times as long.
    dispatcher = njit(cache=True, nogil=True, error_model="numpy", forceinline=inner, _nrt=not inner)(
        function
    )
    dispatcher._cache._cache_file._source_stamp = SOURCES
    return dispatcher

"""The decorator of every compiled kernel: no GIL, cached on disk, stale as soon as what it calls changed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, overload

from numba import njit

from .sources import digest

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
    # Numba's own stamp is the time and size of the function's file: after an edit of what it calls, or an
    # upgrade, it would go on running the old inner function. So the content of all that it imports decides.
    dispatcher._cache._cache_file._source_stamp = digest(function.__module__)
    return dispatcher

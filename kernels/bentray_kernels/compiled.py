"""The decorator of compiled kernels: numba without the GIL, cached on disk by the content of all sources."""

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
        inline: ``always`` for functions inside innermost loops; they must not allocate arrays.
    """
    if function is None:
        return lambda wrapped: _compiled(wrapped, inline == "always")
    return _compiled(function, inline == "always")


def _compiled(function: Callable[..., Any], inner: bool) -> Any:
    # LLVM inlines inner functions, which are built without reference counts. If numba inlined them, each
    # would count references to its array arguments atomically: factored marching took four times as long.
    dispatcher = njit(cache=True, nogil=True, error_model="numpy", forceinline=inner, _nrt=not inner)(
        function
    )
    # Numba's own stamp is the time and size of the function's file: after an edit of an imported module, or
    # an upgrade, the old inner function would still run. So the stamp is the content of all imported modules.
    index = dispatcher._cache._cache_file
    index._source_stamp = digest(function.__module__)
    index._load_index = _without_unknown_types(index._load_index)
    return dispatcher


def _without_unknown_types(load: Callable[[], dict[Any, Any]]) -> Callable[[], dict[Any, Any]]:
    """An index of another version may name types that this one does not have: it counts as empty."""

    def loaded() -> dict[Any, Any]:
        try:
            return load()
        except (AttributeError, ImportError):
            return {}

    return loaded

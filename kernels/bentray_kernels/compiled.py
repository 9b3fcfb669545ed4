"""The decorator of compiled kernels: numba without the GIL, cached on disk by the content of all sources."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar, overload

from .cache_folder import use_writable_kernel_cache
from .sources import ROOT, digest

# Before numba reads its variables.
use_writable_kernel_cache(ROOT)

from numba import config, njit  # noqa: E402

# Another package may have imported numba earlier.
config.reload_config()

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
    dispatcher = njit(nogil=True, error_model="numpy", forceinline=inner, _nrt=not inner)(function)
    try:
        dispatcher.enable_caching()
    except RuntimeError:  # numba finds no folder that it can write to
        return dispatcher
    # Numba's own stamp is the time and size of the function's file: after an edit of an imported module, or
    # an upgrade, the old inner function would still run. So the stamp is the content of all imported modules.
    index = dispatcher._cache._cache_file
    index._source_stamp = digest(function.__module__)
    index._load_index = _without_unknown_types(index._load_index)
    dispatcher._cache.save_overload = _where_possible(dispatcher._cache.save_overload)
    return dispatcher


def _where_possible(save: Callable[..., None]) -> Callable[..., None]:
    """A full disk, or a folder that has become read-only, stores nothing; the compiled function runs."""

    def saved(*arguments: Any) -> None:
        with suppress(OSError):
            save(*arguments)

    return saved


def _without_unknown_types(load: Callable[[], dict[Any, Any]]) -> Callable[[], dict[Any, Any]]:
    """An index of another version may name types that this one does not have: it counts as empty."""

    def loaded() -> dict[Any, Any]:
        try:
            return load()
        except (AttributeError, ImportError):
            return {}

    return loaded

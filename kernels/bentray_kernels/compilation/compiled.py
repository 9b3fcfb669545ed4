"""The decorator of compiled kernels: numba without the GIL, cached on disk by the content of all sources."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cached_property, wraps
from pathlib import Path
from typing import Any, TypeVar, overload

import numpy as np

from .cache_folder import fault_of, name_in_cache, use_writable_kernel_cache
from .sources import ROOT, digest

# Before numba reads its variables.
use_writable_kernel_cache(ROOT)

from numba import config, njit, types  # noqa: E402
from numba.core import event  # noqa: E402
from numba.extending import models, register_model, typeof_impl  # noqa: E402

from .compile_events import KIND, CompiledMeanwhile, CompileEvents, needed  # noqa: E402

# Another package may have imported numba earlier.
config.reload_config()

# Kernels take whole numbers in this width, so that one compilation serves all callers. To the type checker it
# is any number.
int64: Any = np.int64

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
        return lambda wrapped: Kernel(wrapped, inline == "always")
    return Kernel(function, inline == "always")


class Kernel:
    """A function that numba compiles once for each type of its arguments.

    Args:
        function: in Python.
        inner: whether it is inlined. Numba then compiles no wrapper for calls from Python, which takes a
            third of the time; such a call, as of a test, compiles a kernel around it.

    Attributes:
        py_func: the function.
        dispatcher: numba's.
    """

    def __init__(self, function: Callable[..., Any], inner: bool) -> None:
        wraps(function)(self)
        self.py_func = function
        # LLVM inlines inner functions, which are built without reference counts. If numba inlined them, each
        # would count references to its array arguments atomically: factored marching took four times as long.
        self.dispatcher = njit(
            nogil=True,
            error_model="numpy",
            no_cfunc_wrapper=True,
            no_cpython_wrapper=inner,
            forceinline=inner,
            _nrt=not inner,
        )(function)
        self._inner = inner
        usual, config.CACHE_LOCATOR_CLASSES = config.CACHE_LOCATOR_CLASSES, f"{__name__}.CacheLocator"
        try:
            self.dispatcher.enable_caching()
        except RuntimeError:  # the locator finds no folder
            pass
        finally:
            config.CACHE_LOCATOR_CLASSES = usual

    def __call__(self, *arguments: Any) -> Any:
        try:
            return self._called(*arguments)
        except CompiledMeanwhile:
            return self(*arguments)
        except OSError:
            # A full disk, or a folder that has become read-only, stores nothing; the function is compiled.
            return self._called(*arguments)

    def __reduce__(self) -> str:
        return self.py_func.__qualname__

    @cached_property
    def _called(self) -> Callable[..., Any]:
        if not self._inner:
            return self.dispatcher  # type: ignore[no-any-return]
        return njit(nogil=True, error_model="numpy")(lambda *arguments: self(*arguments))  # type: ignore[no-any-return]


class KernelType(types.Dispatcher):  # type: ignore[misc]
    """The type of a kernel that another one calls."""

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        """Compile for the types of a call: literal numbers as any others, which LLVM inlines as constants."""
        args = tuple(types.unliteral(argument) for argument in args)
        try:
            return super().get_call_type(context, args, kws)
        except OSError:  # as in ``Kernel.__call__``
            return super().get_call_type(context, args, kws)


register_model(KernelType)(models.OpaqueModel)


@typeof_impl.register(Kernel)
def _type_of_kernel(value: Kernel, _context: Any) -> KernelType:
    return KernelType(value.dispatcher)


def _missing(function: Callable[..., Any]) -> int:
    return 1 + sum(
        not kernel.dispatcher.signatures and kernel.py_func is not function
        for kernel in needed(function, Kernel)
    )


def _name(function: Callable[..., Any]) -> str | None:
    locator = _locators.get(function)
    return None if locator is None else f"{locator.get_cache_path()} {locator.get_disambiguator()}"


_events = CompileEvents(_missing, _name)
event.register(KIND, _events)
# How many kernels this process has compiled, of those that it needs.
compilation = _events.now


# Of cached kernels, by their functions.
_locators: dict[Callable[..., Any], CacheLocator] = {}


class CacheLocator:
    """Where numba caches a kernel, in the form that ``NUMBA_CACHE_LOCATOR_CLASSES`` documents.

    Numba's own locators stamp a kernel by its own file: after an edit of an imported module, or an upgrade,
    the old inner function would still run. Here the names of its files contain the digest of all modules that
    its own imports.
    """

    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        self._folder = folder
        self._digest = digest(function.__module__)[:16]
        # Functions of one name are in several modules of a folder.
        self._module = Path(function.__code__.co_filename).stem
        self._function = function.__qualname__.replace("<", "").replace(">", "")
        self._line = function.__code__.co_firstlineno

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> CacheLocator | None:
        """The locator of a kernel; None if it is of no file, or no folder can be written."""
        sources = Path(file).resolve().parent
        folder = (
            Path(config.CACHE_DIR, name_in_cache(sources)) if config.CACHE_DIR else sources / "__pycache__"
        )
        if not Path(file).is_file() or fault_of(folder):
            return None
        locator = _locators[function] = cls(function, folder)
        return locator

    def get_cache_path(self) -> str:
        """The folder."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """The digest of the sources."""
        return self._digest

    def get_disambiguator(self) -> str:
        """What names of files contain beside that of the function."""
        return f"{self._line}-{self._digest}"

    def ensure_cache_path(self) -> None:
        """Make the folder before a kernel is stored, and remove what was compiled from other sources."""
        self._folder.mkdir(parents=True, exist_ok=True)
        version = f"py{sys.version_info.major}{sys.version_info.minor}"
        for file in self._folder.glob(f"{self._module}.{self._function}-*.{version}*.nb[ic]"):
            if self._digest not in file.name:
                file.unlink(missing_ok=True)

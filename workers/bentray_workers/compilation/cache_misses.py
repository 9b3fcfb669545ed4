"""Detection of kernels that numba compiles because they are not in its cache."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

from llvmlite.binding import get_host_cpu_name  # type: ignore[import-untyped]
from numba.core import event

log = logging.getLogger("bentray.compiling")

KIND = "numba:compile"


class _Listener(event.Listener):  # type: ignore[misc]
    """Records the name of each compiled kernel; cached kernels cause no event."""

    def __init__(self) -> None:
        self.kernels: list[str] = []

    def on_start(self, event: Any) -> None:
        function = event.data["dispatcher"].py_func
        self.kernels.append(f"{function.__module__}.{function.__qualname__}")

    def on_end(self, event: Any) -> None:
        return


class _Announcer(_Listener):
    """Also counts the compilations in progress; those of called kernels are nested."""

    def __init__(self) -> None:
        super().__init__()
        self._lock = threading.Lock()
        self.in_progress = 0

    def on_start(self, event: Any) -> None:
        with self._lock:
            self.in_progress += 1
        if not self.kernels:
            log.warning(
                "Compiling kernels for this processor (%s), which are not in the cache: minutes, once.",
                get_host_cpu_name(),
            )
        super().on_start(event)

    def on_end(self, event: Any) -> None:
        with self._lock:
            self.in_progress -= 1


@cache
def announce() -> Callable[[], bool]:
    """Log the first kernel that this process compiles; returns a function that tells if it compiles now."""
    announcer = _Announcer()
    event.register(KIND, announcer)
    return lambda: announcer.in_progress > 0


@contextmanager
def compiled_kernels() -> Iterator[list[str]]:
    """The kernels that are compiled while the context is open."""
    with event.install_listener(KIND, _Listener()) as listener:
        yield listener.kernels

"""Detection of kernels that numba compiles because they are not in its cache: log lines, and their names."""

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

from llvmlite.binding import get_host_cpu_name  # type: ignore[import-untyped]
from numba.core import event

from bentray_kernels.compilation.compile_events import KIND
from bentray_kernels.compilation.compiled import compilation

log = logging.getLogger("bentray.compiling")

# Between two lines of a log, s.
LINE_S = 2.0


class _Listener(event.Listener):  # type: ignore[misc]
    """Records the name of each compiled kernel; cached kernels cause no event."""

    def __init__(self) -> None:
        self.kernels: list[str] = []

    def on_start(self, event: Any) -> None:
        function = event.data["dispatcher"].py_func
        self.kernels.append(f"{function.__module__}.{function.__qualname__}")

    def on_end(self, event: Any) -> None:
        return


class Announcer(event.Listener):  # type: ignore[misc]
    """Logs that kernels are compiled, and the counts every few seconds.

    Args:
        counts: whether to log the counts, where no progress bar has them.
    """

    def __init__(self, *, counts: bool) -> None:
        self._counts = counts
        self._said: float | None = None

    def on_start(self, event: Any) -> None:
        if self._said is None:
            log.warning(
                "Compiling kernels for this processor (%s), which are not in the cache: minutes, once.",
                get_host_cpu_name(),
            )
            self._said = time.monotonic()

    def on_end(self, event: Any) -> None:
        now = compilation()
        if self._counts and self._said is not None and time.monotonic() - self._said >= LINE_S:
            self._said = time.monotonic()
            log.warning("Compiling kernels: %d of %d", now.done, now.total)


@cache
def announce(*, counts: bool = False) -> None:
    """Log the first kernel that this process compiles; with ``counts`` the progress, too."""
    event.register(KIND, Announcer(counts=counts))


@contextmanager
def compiled_kernels() -> Iterator[list[str]]:
    """The kernels that are compiled while the context is open."""
    with event.install_listener(KIND, _Listener()) as listener:
        yield listener.kernels

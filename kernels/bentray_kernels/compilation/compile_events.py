"""Events of Numba while it compiles: counts for progress, and one process at a time for each kernel."""

import fcntl
import gc
import os
import tempfile
import time
import zlib
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import IO, Any, NamedTuple

from numba.core import event

KIND = "numba:compile"
# Kernels are counted anew after a time without compilation, s.
IDLE_S = 10.0
# Longest wait for another process that compiles the same kernel, and between two attempts, s.
WAIT_S, POLL_S = 120.0, 0.05
# Numba stores a kernel just after the event of its end, s.
STORE_S = 0.25


class Compilation(NamedTuple):
    """Kernels that this process compiles.

    Attributes:
        done: compiled so far.
        total: with those that the call in progress needs beside them.
        active: whether one is compiled now.
    """

    done: int = 0
    total: int = 0
    active: bool = False


class CompiledMeanwhile(Exception):  # noqa: N818 - not an error: the call is repeated
    """Another process has compiled a kernel since this one has looked for it in the cache."""


class CompileEvents(event.Listener):  # type: ignore[misc]
    """Counts compiled kernels, and meanwhile pauses the search for cyclic garbage, a tenth of the time.

    Numba lets one thread compile at a time; kernels that are called compile within their caller. Cached ones
    cause no event.

    A call of a cached kernel that another process compiles at this moment waits for it. Numba has looked into
    its cache by then, so the call ends with ``CompiledMeanwhile`` and is to be repeated.

    Args:
        missing: how many kernels the call of a function needs that are not loaded, with its own.
        name: of a kernel with its version; None for functions that are not cached.
        clock: seconds.
    """

    def __init__(
        self,
        missing: Callable[[Any], int],
        name: Callable[[Any], str | None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._missing, self._name, self._clock = missing, name, clock
        self._depth = self._done = self._total = 0
        self._ended = -IDLE_S
        self._collects = self._refused = False
        self._claim: IO[bytes] | None = None
        self._newest: str | None = None

    def now(self) -> Compilation:
        """The counts."""
        return Compilation(self._done, max(self._total, self._done), self._depth > 0)

    def on_start(self, event: Any) -> None:
        """Count a kernel.

        Raises:
            CompiledMeanwhile: after another process has compiled it.
        """
        if self._depth == 0:
            function = event.data["dispatcher"].py_func
            if self._clock() - self._ended > IDLE_S:
                self._done = 0
            self._total = self._done + self._missing(function)
            self._depth = 1
            self._collects = gc.isenabled()
            gc.disable()
            name, before = self._name(function), self._newest
            self._newest = name
            self._claim, waited = (None, False) if name is None else claim(name)
            # Not again, as for a process that ended before it had stored the kernel.
            if waited and name != before:
                self._refused = True
                raise CompiledMeanwhile(name)
        else:
            self._depth += 1
        self._total = max(self._total, self._done + self._depth)

    def on_end(self, event: Any) -> None:
        """Count it as compiled."""
        self._depth -= 1
        self._done += not self._refused
        if self._depth == 0:
            self._refused, self._total, self._ended = False, self._done, self._clock()
            if self._collects:
                gc.enable()
            if self._claim is not None:
                self._claim.close()
                self._claim = None


def claim(name: str) -> tuple[IO[bytes] | None, bool]:
    """Claim a kernel among the processes of this machine and user.

    Args:
        name: of the kernel.

    Returns:
        A file that holds the claim while it is open, None without any; and whether another process held it.
    """
    started = time.monotonic()
    with suppress(OSError):
        file = Path(tempfile.gettempdir(), f"bentray-compiling-{os.getuid()}.lock").open("ab")  # noqa: SIM115
        while True:
            try:
                # One byte of the file for each kernel.
                fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, zlib.crc32(name.encode()))
            except BlockingIOError:
                if time.monotonic() - started > WAIT_S:
                    file.close()
                    break
                time.sleep(POLL_S)
                continue
            waited = time.monotonic() - started > POLL_S
            if waited:
                time.sleep(STORE_S)
                file.close()
            return file, waited
    return None, False


def needed(function: Any, kernel_class: type[Any]) -> set[Any]:
    """The kernels that a function calls by name, directly or through others.

    Args:
        function: in Python.
        kernel_class: of the kernels; they have ``py_func``.
    """
    found: set[Any] = set()
    ahead = [function]
    while ahead:
        for value in _names(ahead.pop()):
            if isinstance(value, kernel_class) and value not in found:
                found.add(value)
                ahead.append(value.py_func)
    return found


def _names(function: Any) -> Iterable[Any]:
    """Values that a function uses: globals, attributes of modules, variables of an enclosing function."""
    names = function.__code__.co_names
    for name in names:
        value = function.__globals__.get(name)
        yield value
        if isinstance(value, ModuleType):
            yield from (getattr(value, attribute, None) for attribute in names)
    for cell in function.__closure__ or ():
        with suppress(ValueError):  # still empty
            yield cell.cell_contents

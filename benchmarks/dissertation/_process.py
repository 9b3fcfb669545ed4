"""A part measured in a process of its own, so that a crash or the memory of a benchmark stays there."""

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection

from bentray_service.cli.output.benchmark_context import BenchmarkContext

from ._parts import Part, Parts, Rows

# Finds the rows of a benchmark by its name; can be pickled.
Load = Callable[[str], Rows]

# A forked process would share threads and locks of numerical libraries.
SPAWN = multiprocessing.get_context("spawn")

# Least time between two messages about the progress, s.
PAUSE_S = 0.2


def measure_in_process(load: Load, store: Parts, name: str, context: BenchmarkContext) -> Part:
    """Measure and keep a part; a benchmark that ends its process gives a part with an error."""
    here, there = SPAWN.Pipe(duplex=False)
    silent = replace(context, progress=_no_progress)
    process = SPAWN.Process(target=_measure, args=(there, load, store, name, silent))
    started = time.perf_counter()
    store.forget(name)
    process.start()
    there.close()
    try:
        while True:
            try:
                context.progress(*here.recv())
            except EOFError:
                break
        process.join()
    finally:
        if process.is_alive():
            process.terminate()
            process.join()
    part = store.read(name)
    if part is not None:
        return part
    code = process.exitcode or 0
    reason = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
    return store.keep_failure(name, f"its process ended with {reason}", time.perf_counter() - started)


def _no_progress(done: int, total: int, note: str = "") -> None:
    pass


def _measure(connection: Connection, load: Load, store: Parts, name: str, context: BenchmarkContext) -> None:
    """In the new process: it ends with the command, and Ctrl-C is left to the command."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    last = 0.0

    def progress(done: int, total: int, note: str = "") -> None:
        nonlocal last
        if time.monotonic() - last > PAUSE_S:
            last = time.monotonic()
            connection.send((done, total, note))

    store.measure(name, load(name), replace(context, progress=progress))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)

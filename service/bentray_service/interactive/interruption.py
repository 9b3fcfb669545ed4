"""Work that Ctrl-C, or the interruption of a notebook, stops cleanly."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

from bentray_kernels.tomography.result import Progress

T = TypeVar("T")

# Between two looks at the progress, and between two calls of ``show`` without a new one, s.
LOOK_S, SHOW_S = 0.1, 1.0

OnProgress = Callable[[Progress], None]
Stop = Callable[[], bool]


def run_interruptibly(work: Callable[[OnProgress, Stop], T], show: OnProgress) -> T:
    """Run ``work`` in a thread, so that an interruption never breaks into its files and tasks.

    Args:
        work: called with a function that reports progress, and one that it polls several times a second;
            once this is true it raises ``Cancelled``.
        show: called with the latest progress in the calling thread, where notebooks expect output; at least
            once a second, so that a clock moves.

    Returns:
        The result of ``work``.

    Raises:
        KeyboardInterrupt: after ``work`` has stopped; a second Ctrl-C does not wait for it.
        BaseException: what ``work`` raises.
    """
    stop, reported, result = threading.Event(), deque[Progress](maxlen=1), Future[T]()

    def run() -> None:
        try:
            result.set_result(work(reported.append, stop.is_set))
        except BaseException as error:
            result.set_exception(error)

    # Of a daemon nobody waits for the end, unlike of the threads of an executor.
    running = threading.Thread(target=run, name="bentray", daemon=True)
    running.start()
    shown, at = Progress(0, 0), time.monotonic()
    try:
        while running.is_alive():
            running.join(LOOK_S)
            newest = reported[-1] if reported else shown
            if newest is not shown or (running.is_alive() and time.monotonic() - at >= SHOW_S):
                shown, at = newest, time.monotonic()
                show(shown)
    except KeyboardInterrupt:
        stop.set()
        running.join()
        raise
    return result.result()

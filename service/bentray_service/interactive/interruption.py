"""Work that Ctrl-C, or the interruption of a notebook, stops cleanly."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from bentray_kernels.tomography.result import Progress

T = TypeVar("T")

# Between two looks at the progress, s.
LOOK_S = 0.1

OnProgress = Callable[[Progress], None]
Stop = Callable[[], bool]


def run_interruptibly(work: Callable[[OnProgress, Stop], T], show: OnProgress) -> T:
    """Run ``work`` in a thread, so that an interruption never breaks into its files and tasks.

    Args:
        work: called with a function that reports progress, and one that it polls several times a second;
            once this is true it raises ``Cancelled``.
        show: called with the latest progress in the calling thread, where notebooks expect output.

    Returns:
        The result of ``work``.

    Raises:
        KeyboardInterrupt: after ``work`` has stopped; a second Ctrl-C does not wait for it.
        BaseException: what ``work`` raises.
    """
    running = _Running(work)
    running.start()
    shown: Progress | None = None
    try:
        while running.is_alive():
            running.join(LOOK_S)
            latest = running.latest
            if latest is not None and latest is not shown:
                shown = latest
                show(latest)
    except KeyboardInterrupt:
        running.stop.set()
        running.join()
        raise
    if running.error is not None:
        raise running.error
    return running.result


class _Running(threading.Thread, Generic[T]):
    """``work`` in a thread, with its latest progress and its result or error."""

    result: T

    def __init__(self, work: Callable[[OnProgress, Stop], T]) -> None:
        super().__init__(name="bentray", daemon=True)
        self._work = work
        self.stop = threading.Event()
        self.latest: Progress | None = None
        self.error: BaseException | None = None

    def run(self) -> None:
        try:
            self.result = self._work(self._report, self.stop.is_set)
        except BaseException as error:
            self.error = error

    def _report(self, progress: Progress) -> None:
        self.latest = progress

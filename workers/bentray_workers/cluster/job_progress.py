"""Progress of a job while its tasks run: kernels that its workers compile, and stages of a long task."""

import time
from collections.abc import Callable
from dataclasses import replace

from distributed import Client

from bentray_kernels.compilation.compile_events import Compilation
from bentray_kernels.tomography.result import Progress

from .connected import connected_workers
from .worker_health import compilation_of

# Phase of a job whose tasks wait for kernels; its count is that of the kernels.
COMPILING = "compiling"
# Between two looks at the workers and the stage of a task, s.
LOOK_S = 1.0
# Compilation is shown once nothing was reported for so long: it may be of another job, s.
QUIET_S = 2.0


def compilation_on(client: Client) -> Compilation:
    """Kernels that the workers of a cluster compile now, all together."""
    try:
        workers = connected_workers(client).values()
    except (OSError, TimeoutError):
        return Compilation()
    active = [counts for counts in map(compilation_of, workers) if counts.active]
    return Compilation(sum(c.done for c in active), sum(c.total for c in active), bool(active))


class JobProgress:
    """Reports the progress of a job, also between its tasks.

    Args:
        show: takes the progress.
        compilation: the kernels that are compiled now.
        current: the progress now, with the stage of a task that runs; None: the last report.
        clock: seconds.
    """

    def __init__(
        self,
        show: Callable[[Progress], None],
        compilation: Callable[[], Compilation],
        current: Callable[[], Progress] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._show, self._compilation, self._clock = show, compilation, clock
        self._reported = self._shown = Progress(0, 0)
        self._current = current or (lambda: self._reported)
        self._at = self._looked = clock()

    def report(self, progress: Progress) -> None:
        """Show the progress after a task."""
        self._reported = self._shown = progress
        self._at = self._clock()
        self._show(progress)

    def look(self) -> None:
        """Show what has changed without a report; to be called several times a second."""
        now = self._clock()
        if now - self._looked < LOOK_S:
            return
        self._looked = now
        progress = self._current()
        if now - self._at >= QUIET_S:
            counts = self._compilation()
            if counts.active:
                progress = replace(progress, done=counts.done, total=counts.total, phase=COMPILING)
        if progress != self._shown:
            self._shown = progress
            self._show(progress)

    def watching(self, stop: Callable[[], bool] | None) -> Callable[[], bool]:
        """The ``stop`` of a run of tasks, which is polled several times a second, with a look each time."""

        def polled() -> bool:
            self.look()
            return stop is not None and stop()

        return polled


def job_progress(
    client: Client | None,
    show: Callable[[Progress], None] | None,
    current: Callable[[], Progress] | None = None,
) -> JobProgress:
    """The progress of a job on a cluster; compilation in this process is shown by its own progress bar."""
    counts = Compilation if client is None else lambda: compilation_on(client)
    return JobProgress(show or (lambda _: None), counts, current)

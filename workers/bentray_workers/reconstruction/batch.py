"""Batch processing: many datasets on one cluster, a bounded number at a time, with separate failures."""

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from pathlib import Path

from distributed import KilledWorker
from distributed.comm import CommClosedError
from distributed.scheduler import NoValidWorkerError, NoWorkerError

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Progress

from ..files.dataset import read_dataset
from ..files.reconstruction import read_reconstruction
from ..images.report import report_png

POLL_S = 0.25


@dataclass
class Entry:
    """State of one dataset of a batch; written by the thread that processes it.

    Attributes:
        source: the dataset's file.
        state: ``waiting``, ``running``, then ``succeeded``, ``failed`` or ``skipped``.
        done, total: see ``Progress``.
        residual_rms_s: of the latest iteration, s; None before the first is finished.
        seconds: duration so far.
        reason: of a failure.
        doubt: why its result is doubtful; else empty.
    """

    source: Path
    state: str = "waiting"
    done: int = 0
    total: int = 0
    residual_rms_s: float | None = None
    reason: str = ""
    doubt: str = ""
    _begun: float = field(default=0.0, repr=False)
    _seconds: float | None = field(default=None, repr=False)

    @property
    def name(self) -> str:
        return self.source.stem

    @property
    def seconds(self) -> float:
        if self._seconds is not None:
            return self._seconds
        return time.perf_counter() - self._begun if self.state == "running" else 0.0

    def begin(self) -> None:
        """Start."""
        self.state, self._begun = "running", time.perf_counter()

    def show(self, progress: Progress) -> None:
        """Set the progress."""
        self.done, self.total = progress.done, progress.total
        if progress.history:
            self.residual_rms_s = progress.history[-1].residual_rms_s

    def end(self, state: str, reason: str = "") -> None:
        """Finish in a state."""
        self._seconds = self.seconds
        self.state, self.reason = state, reason

    def skip(self, seconds: float, residual_rms_s: float | None, doubt: str = "") -> None:
        """Skip: its result exists already."""
        self.state, self._seconds, self.residual_rms_s = "skipped", seconds, residual_rms_s
        self.doubt = doubt


def run(
    entries: Sequence[Entry],
    work: Callable[[Entry, Callable[[], bool]], None],
    watch: Callable[[], None],
    at_once: int,
) -> None:
    """Process all entries in order.

    Args:
        entries: waiting ones; changed in place.
        work: called in a thread; its second argument returns whether to stop. The entry has failed if it
            raises an exception.
        watch: called in this thread several times a second.
        at_once: entries processed at the same time.
    """
    stop = threading.Event()
    waiting = deque(entries)
    running: dict[Future[None], Entry] = {}
    with ThreadPoolExecutor(at_once) as pool:
        try:
            while waiting or running:
                while waiting and len(running) < at_once:
                    entry = waiting.popleft()
                    entry.begin()
                    running[pool.submit(work, entry, stop.is_set)] = entry
                for future in wait(running, POLL_S, FIRST_COMPLETED).done:
                    _finish(running.pop(future), future)
                watch()
        finally:
            # Also after Ctrl-C: the pool waits for its threads, which poll this event.
            stop.set()


def _finish(entry: Entry, future: Future[None]) -> None:
    try:
        future.result()
    # Any failure must not affect the other datasets.
    except Exception as error:
        entry.end("failed", explain_failure(error))
    else:
        entry.end("succeeded")


def report_of(result: Path, source: Path) -> bytes:
    """Task: report of a reconstruction file with the truth of its dataset, as PNG."""
    dataset = read_dataset(source, traces=False)
    return report_png(read_reconstruction(result), dataset.truth, dataset.roi)


def explain_failure(error: Exception) -> str:
    """Reason of a failure in one line."""
    if isinstance(error, InvalidInput):
        return str(error)
    if isinstance(error, MemoryError):
        return "the memory ran out: use fewer nodes"
    if isinstance(error, KilledWorker):
        return "the workers that ran it died one after the other, usually for lack of memory"
    if isinstance(error, NoValidWorkerError | NoWorkerError):
        return "the cluster has no worker for reconstructions"
    if isinstance(error, CommClosedError):
        return "the connection to the scheduler was lost"
    words = " ".join(str(error).split())
    return f"{type(error).__name__}: {words}" if words else type(error).__name__

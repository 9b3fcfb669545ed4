"""Many datasets through one cluster: a bounded number at a time, each failing by itself."""

from __future__ import annotations

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
    """One dataset of a batch, as it stands; written by the thread that works on it.

    Attributes:
        source: the dataset's file.
        state: ``waiting``, ``running``, then ``succeeded``, ``failed`` or ``skipped``.
        done, total: of the work, as ``Progress`` has them.
        residual_rms_s: of the newest sweep, s; None before the first has ended.
        seconds: from its begin to its end; while it runs, to now.
        reason: why it failed.
    """

    source: Path
    state: str = "waiting"
    done: int = 0
    total: int = 0
    residual_rms_s: float | None = None
    reason: str = ""
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
        """It is worked on from now."""
        self.state, self._begun = "running", time.perf_counter()

    def show(self, progress: Progress) -> None:
        """How far it is."""
        self.done, self.total = progress.done, progress.total
        if progress.history:
            self.residual_rms_s = progress.history[-1].residual_rms_s

    def end(self, state: str, reason: str = "") -> None:
        """It is over."""
        self._seconds = self.seconds
        self.state, self.reason = state, reason

    def skip(self, seconds: float, residual_rms_s: float | None) -> None:
        """Its result was there already."""
        self.state, self._seconds, self.residual_rms_s = "skipped", seconds, residual_rms_s


def run(
    entries: Sequence[Entry],
    work: Callable[[Entry, Callable[[], bool]], None],
    watch: Callable[[], None],
    at_once: int,
) -> None:
    """See every entry to its end, in their order.

    Args:
        entries: those that wait; changed in place.
        work: called in a thread; its second argument tells whether to give up. The entry has failed if it
            raises, and succeeded if it does not.
        watch: called in this thread several times a second.
        at_once: entries that are worked on at the same time.
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
                    _settle(running.pop(future), future)
                watch()
        finally:
            # Also after Ctrl-C: the pool waits for its threads, and they look at this.
            stop.set()


def _settle(entry: Entry, future: Future[None]) -> None:
    try:
        future.result()
    # Whatever it was, the other datasets must not suffer from it.
    except Exception as error:
        entry.end("failed", explain_failure(error))
    else:
        entry.end("succeeded")


def report_of(result: Path, source: Path) -> bytes:
    """Task: the picture of a reconstruction file beside the truth of its dataset, as PNG."""
    dataset = read_dataset(source, traces=False)
    return report_png(read_reconstruction(result), dataset.truth, dataset.roi)


def explain_failure(error: Exception) -> str:
    """Why a dataset failed, in one line."""
    if isinstance(error, InvalidInput):
        return str(error)
    if isinstance(error, MemoryError):
        return "the memory ran out: use fewer nodes"
    if isinstance(error, KilledWorker):
        return "the workers that ran it died one after the other, most often for lack of memory"
    if isinstance(error, NoValidWorkerError | NoWorkerError):
        return "the cluster has no worker that takes reconstructions"
    if isinstance(error, CommClosedError):
        return "the connection to the scheduler was lost"
    words = " ".join(str(error).split())
    return f"{type(error).__name__}: {words}" if words else type(error).__name__

"""The threads that take queued jobs in order and see each to its end."""

from __future__ import annotations

import errno
import logging
import shutil
import threading
from collections.abc import Callable
from concurrent.futures import CancelledError
from contextlib import suppress
from pathlib import Path
from typing import Any

from distributed.client import FutureCancelledError
from distributed.comm import CommClosedError
from distributed.scheduler import NoValidWorkerError, NoWorkerError
from sqlalchemy.exc import SQLAlchemyError

from bentray_kernels.task_graph import Cancelled
from bentray_workers.cluster.fair_shares import Shares

from ..compute import Compute
from ..files.data_folder import Files
from ..files.disk import bytes_in
from ..files.tenant_files import TenantFiles
from ..logs import about
from ..refusals import Damaged, DatabaseFull, DatabaseUnavailable, StorageUnavailable
from ..rows.job_queue import LEASE_S, Queue
from ..rows.records import JobRow
from ..rows.schema import ENDED
from .failures import CRASHED, explain
from .kind import Kind, Task
from .kinds import KINDS
from .reporter import Reporter

log = logging.getLogger("bentray.jobs")

# How long an idle thread waits before it looks by itself; a new job wakes it at once.
IDLE_SECONDS = 1.0
# How long a job may take to notice that the service leaves.
STOP_SECONDS = 30.0
# How often the database may refuse the end of a job.
REFUSALS = 3
# How long a result waits for a store that is away, before it is tried again.
STORE_SECONDS = 5.0
# How often leases are renewed, and those of dead services looked for.
LEASE_CHECK_SECONDS = LEASE_S / 6.0

# What a client raises when its scheduler dies under it, or has no workers left.
AWAY = (
    CommClosedError,
    FutureCancelledError,
    CancelledError,
    ConnectionError,
    NoWorkerError,
    NoValidWorkerError,
)
FULL = (errno.ENOSPC, errno.EDQUOT)


class Runner:
    """Runs up to ``at_once`` jobs at the same time, and one of each tenant that has none, up to ``tenants``.

    A thread only drives its job: the work is done by the cluster, which the jobs share. While the disk has
    less than ``min_free_bytes`` free, or the store is away, jobs wait.
    """

    def __init__(
        self,
        queue: Queue,
        files: Files,
        compute: Compute,
        at_once: int,
        tenants: int,
        min_free_bytes: int,
        *,
        alone: bool,
    ) -> None:
        """Args:
        at_once: jobs that run whoever's they are.
        tenants: jobs that run at most, those beyond ``at_once`` of tenants without another one.
        alone: whether no other service uses the database; see ``Jobs.recover``.
        """
        self._queue = queue
        self._files = files
        self._compute = compute
        self._min_free_bytes = min_free_bytes
        self._alone = alone
        self._at_once = at_once
        self._most = max(at_once, tenants)
        self._shares = Shares()
        self._wake, self._leaving = threading.Event(), threading.Event()
        # The job of each thread. One that was released may be taken again before its thread has ended.
        self._in_hand: dict[threading.Thread, str] = {}
        self._threads = [
            threading.Thread(target=self._take, name="jobs", daemon=True),
            threading.Thread(target=self._keep_leases, name="leases", daemon=True),
        ]

    def start(self) -> None:
        """Take up what a dead process left, then begin."""
        self._recover()
        self._files.keep_work(self._queue.unfinished())
        for thread in self._threads:
            thread.start()

    def _recover(self) -> None:
        crashed = CRASHED.model_dump(exclude_none=True)
        again = self._queue.recover(crashed, alone=self._alone, held=self._held())
        if again:
            log.warning("%d jobs of a service that died wait again", again)
            self.notify()

    def _held(self) -> tuple[str, ...]:
        """The jobs that are at work here."""
        return tuple(self._in_hand.copy().values())

    def _keep_leases(self) -> None:
        while not self._leaving.wait(LEASE_CHECK_SECONDS):
            try:
                self._queue.renew(self._held())
                self._recover()
            except DatabaseUnavailable as error:
                log.warning("the leases could not be renewed: %s", error)
            except SQLAlchemyError:
                log.exception("the leases could not be renewed")

    def notify(self) -> None:
        """Say that a job has been queued."""
        self._wake.set()

    def alive(self) -> bool:
        """Whether the threads that take jobs and keep leases are there."""
        return all(thread.is_alive() for thread in self._threads)

    def stop(self) -> None:
        """Stop the running jobs, put them back in the queue and end the threads."""
        self._leaving.set()
        self._wake.set()
        for thread in [*self._threads, *tuple(self._in_hand)]:
            thread.join(STOP_SECONDS)
            if thread.is_alive():
                log.warning(
                    "%s did not stop in %g s; its job runs again at the next start", thread.name, STOP_SECONDS
                )

    def _take(self) -> None:
        """Take jobs as long as there is room for one more, and begin each in a thread of its own."""
        while not self._leaving.is_set():
            # Before looking: what is queued from here on wakes this thread again.
            self._wake.clear()
            try:
                if self._begin():
                    continue
            except DatabaseUnavailable:
                # The thread must outlive it; that it is away is in the log already, once.
                pass
            except Exception:
                # Whatever it is: no job would ever begin again.
                log.exception("a job could not be taken; trying again in %g s", IDLE_SECONDS)
            self._wake.wait(IDLE_SECONDS)

    def _begin(self) -> bool:
        """Begin a job, if there is one that may."""
        running = len(self._in_hand)
        if running >= self._most or not self._has_room() or self._files.store.fault() is not None:
            return False
        job = self._queue.claim(idle_only=running >= self._at_once)
        if job is None:
            return False
        thread = threading.Thread(target=self._see_to_its_end, args=(job,), name=job["id"], daemon=True)
        self._in_hand[thread] = job["id"]
        try:
            thread.start()
        except BaseException:
            del self._in_hand[thread]
            raise
        return True

    def _see_to_its_end(self, job: JobRow) -> None:
        try:
            self._run(job)
        except Exception:
            # Whatever it is, as a full disk: the job is taken up again, since nobody is at work on it.
            log.exception("%s could not be ended", job["id"])
        finally:
            del self._in_hand[threading.current_thread()]
            self._wake.set()

    def _has_room(self) -> bool:
        return shutil.disk_usage(self._files.root).free >= self._min_free_bytes

    def _run(self, job: JobRow) -> None:
        with about(job=job["id"]):
            self._run_known(job)

    def _run_known(self, job: JobRow) -> None:
        job_id, files = job["id"], self._files.of(job["tenant"])
        reporter = Reporter(
            self._queue, job_id, self._leaving.is_set, taken=lambda: bytes_in(files.work(job_id))
        )
        kind = KINDS[job["kind"]]
        target = kind.target(files, job)
        try:
            source = self._files.store.fetch(kind.source(files, job))
            try:
                # Another job may have made the same, and a kind may then take it as it is.
                self._files.store.fetch(target)
            except FileNotFoundError:
                pass
            except Damaged:
                # It is made again.
                self._files.store.remove([target])
            client = self._compute.client
            with self._shares.of(job["tenant"], kind.lane, client) as share:
                result = kind.run(
                    Task(
                        client=client,
                        source=source,
                        settings=job["settings"],
                        target=target,
                        work_dir=files.work(job_id),
                        on_progress=reporter.report,
                        on_saved=reporter.saved,
                        stop=reporter.stop,
                        share=share,
                    )
                )
            self._keep(target, reporter)
        except Cancelled:
            if not reporter.lost:
                self._settle(job_id, lambda: self._stopped(job_id, files, reporter))
        except (*AWAY, DatabaseUnavailable, StorageUnavailable) as error:
            kinds = (
                (DatabaseUnavailable, "database"),
                (StorageUnavailable, "storage"),
                (Exception, "workers"),
            )
            away = next(name for kind, name in kinds if isinstance(error, kind))
            reason = f"no answer from the {away}; the job continues when available"
            self._put_back(job_id, reason, error)
            self._leaving.wait(IDLE_SECONDS)
        except Exception as error:
            if isinstance(error, OSError) and error.errno in FULL and not self._has_room():
                self._put_back(job_id, "the disk is full; the job continues once there is space", error)
                return
            problem = explain(job_id, error).model_dump(exclude_none=True)
            self._settle(job_id, lambda: self._failed(job_id, files, reporter, problem))
        else:
            self._settle(job_id, lambda: self._succeeded(job_id, files, reporter, kind, result, target))

    def _put_back(self, job_id: str, reason: str, error: BaseException) -> None:
        """Queue a job again for a reason that is no fault of the job."""
        log.warning("%s waits: %s (%s)", job_id, reason, error)
        self._settle(job_id, lambda: self._queue.release(job_id, reason))

    def _keep(self, target: Path, reporter: Reporter) -> None:
        """Keep a result for good before a row tells of it, however long the store is away.

        Raises:
            Cancelled: when the job was to stop meanwhile.
        """
        while True:
            try:
                return self._files.store.publish(target)
            except StorageUnavailable as error:
                log.warning("%s waits for the storage: %s", target.name, error)
                if self._leaving.wait(STORE_SECONDS) or reporter.stop():
                    raise Cancelled from error

    def _stopped(self, job_id: str, files: TenantFiles, reporter: Reporter) -> None:
        reporter.flush()
        if self._leaving.is_set():
            self._queue.release(job_id, "the service was stopped")
        else:
            self._queue.mark_cancelled(job_id)
        if self._queue.state(job_id) in ENDED:
            files.drop_work(job_id)

    def _failed(self, job_id: str, files: TenantFiles, reporter: Reporter, problem: dict[str, Any]) -> None:
        reporter.flush()
        self._queue.fail(job_id, problem)
        files.drop_work(job_id)

    def _succeeded(
        self,
        job_id: str,
        files: TenantFiles,
        reporter: Reporter,
        kind: Kind[Any],
        result: dict[str, Any] | None,
        target: Path,
    ) -> None:
        reporter.flush()
        # One that has no row is one file.
        size = target.stat().st_size if result is None else 0
        if not self._queue.succeed(job_id, result, kind.table, size):
            if self._queue.held_state(job_id) is None:
                # Another service runs it by now, and writes the same file.
                return
            with suppress(StorageUnavailable):
                # What stays is found as an orphan.
                kind.discard(files, target)
            self._queue.mark_cancelled(job_id)
        files.drop_work(job_id)

    def _settle(self, job_id: str, write_the_end: Callable[[], None]) -> None:
        """Write the end of a job, for as long as the database is away: it would count as running otherwise.

        An end that the database does not take although it is there will not be taken later either; the job
        fails by it.
        """
        refused = 0
        while True:
            try:
                return write_the_end()
            except (DatabaseUnavailable, DatabaseFull):
                if self._leaving.wait(IDLE_SECONDS):
                    raise
            except SQLAlchemyError as error:
                refused += 1
                log.exception("the end of %s is refused by the database", job_id)
                if refused >= REFUSALS:
                    problem = explain(job_id, error).model_dump(exclude_none=True)
                    self._queue.fail(job_id, problem)
                    return None
                if self._leaving.wait(IDLE_SECONDS):
                    raise

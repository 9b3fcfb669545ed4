"""The job runner: claims queued jobs, runs each in a thread, and stores the outcome."""

import errno
import logging
import shutil
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import suppress
from pathlib import Path
from typing import Any

from distributed.client import FutureCancelledError
from distributed.comm import CommClosedError
from distributed.scheduler import NoValidWorkerError, NoWorkerError
from prometheus_client import Counter, Histogram
from prometheus_client.metrics_core import Metric
from sqlalchemy.exc import SQLAlchemyError

from bentray_kernels.task_graph import Cancelled
from bentray_workers.cluster.fair_shares import Shares
from bentray_workers.cluster.short_lane import SHORT_LANE, is_short
from bentray_workers.cluster.task_pool import JobControl

from ..background import BackgroundThread
from ..compute import Compute
from ..errors import Damaged, DatabaseFull, DatabaseUnavailable, StorageUnavailable
from ..files.data_folder import Files
from ..files.disk import bytes_in
from ..files.tenant_files import TenantFiles
from ..logs import about
from ..rows.accounts import Accounts
from ..rows.job_queue import LEASE_S, Queue
from ..rows.tables import ENDED, JobRow, Plain
from ..settings import ServiceSettings
from .estimate import estimate
from .kind import JobRun, Kind
from .kinds import KINDS
from .reporter import CRASHED, Reporter, explain
from .traces import JobTraces

log = logging.getLogger("bentray.jobs")

# Attempts to store the outcome of a job against errors of the database.
REFUSALS = 3
# Interval between attempts to store a result, s.
STORE_SECONDS = 5.0
# Interval between renewals of leases and searches for dead services, s.
LEASE_CHECK_SECONDS = LEASE_S / 6.0

# Errors of a client whose scheduler has died or has no workers.
UNAVAILABLE = (
    CommClosedError,
    FutureCancelledError,
    CancelledError,
    ConnectionError,
    NoWorkerError,
    NoValidWorkerError,
)
FULL = (errno.ENOSPC, errno.EDQUOT)

# From a picture-sized job to a night.
BUCKETS_S = (1.0, 5.0, 15.0, 60.0, 300.0, 900.0, 3600.0, 14400.0, 43200.0)

# What ended or failed under a running job that is queued again.
REASONS = ("service", "workers", "database", "storage", "disk")


class JobMetrics:
    """Durations of attempts that ended, and attempts that are repeated."""

    def __init__(self) -> None:
        self._seconds = Histogram(
            "bentray_job_duration_seconds",
            "Time from the start of the last attempt of a job to its end.",
            ("kind", "state"),
            buckets=BUCKETS_S,
            registry=None,
        )
        self._retries = Counter(
            "bentray_job_retries_total",
            "Running jobs that were queued again, by what was not available.",
            ("reason",),
            registry=None,
        )
        for reason in REASONS:
            self._retries.labels(reason)

    def observe_end(self, kind: str, state: str, seconds: float) -> None:
        """Count an ended job."""
        self._seconds.labels(kind, state).observe(max(seconds, 0.0))

    def count_retries(self, reason: str, number: int = 1) -> None:
        """Count jobs that were queued again."""
        self._retries.labels(reason).inc(number)

    def collect(self) -> Iterator[Metric]:
        """The metrics, for a collector."""
        yield from self._seconds.collect()
        yield from self._retries.collect()


class Runner(BackgroundThread):
    """Runs up to ``at_once`` jobs at the same time, and one job of every further tenant up to ``tenants``.

    The last job of more than one is always that of a further tenant, so that none holds all. One job that is
    planned to be short runs beside them: it has its own lane on the workers.
    A thread only controls its job; the cluster, shared by all jobs, does the computation. Jobs wait while
    less than ``min_free_bytes`` of disk space is free, or the store is unavailable.

    Attributes:
        metrics: durations and retries of jobs.
    """

    idle_s, failure = 1.0, "no job could be claimed"

    def __init__(
        self, queue: Queue, accounts: Accounts, files: Files, compute: Compute, settings: ServiceSettings
    ) -> None:
        """Args:
        settings: ``jobs_at_once``, ``tenants_at_once`` and ``min_free_bytes``.
        """
        super().__init__("jobs")
        self.metrics, self._traces = JobMetrics(), JobTraces()
        self.queue, self._accounts = queue, accounts
        self._files = files
        self.compute = compute
        self._min_free_bytes = settings.min_free_bytes
        self._most = max(settings.jobs_at_once, settings.tenants_at_once)
        self._at_once = max(1, min(settings.jobs_at_once, self._most - 1))
        self._shares = Shares()
        # The job of each thread. A released job may be claimed again before its thread has ended.
        self._running: dict[threading.Thread, str] = {}
        # The short job that runs beside ``at_once`` others.
        self._extra = ""
        self._leases = threading.Thread(target=self._keep_leases, name="leases", daemon=True)

    def start(self) -> None:
        """Take over jobs of a dead service, then start the threads."""
        self._recover()
        unfinished = self.queue.unfinished()
        for files in self._files.all():
            files.keep_work(unfinished)
        super().start()
        self._leases.start()

    def _recover(self) -> None:
        crashed = CRASHED.model_dump(exclude_none=True)
        again = self.queue.recover(crashed, held=self._held())
        if again:
            log.warning("%d jobs of a dead service are queued again", again)
            self.metrics.count_retries("service", again)
            self.notify()

    def _held(self) -> tuple[str, ...]:
        """The jobs that run in this service."""
        return tuple(self._running.copy().values())

    def _keep_leases(self) -> None:
        while not self._leaving.wait(LEASE_CHECK_SECONDS):
            try:
                self.queue.renew(self._held())
                self._recover()
            except DatabaseUnavailable as error:
                log.warning("the leases could not be renewed: %s", error)
            except SQLAlchemyError:
                log.exception("the leases could not be renewed")

    def notify(self, started: str = "") -> None:
        """Wake the runner after jobs were queued.

        Args:
            started: id of the job or batch that the present request started.
        """
        if started:
            self._traces.remember(started)
        self._wake.set()

    def alive(self) -> bool:
        """Whether the threads of the runner are alive."""
        return super().alive() and self._leases.is_alive()

    def stop(self) -> None:
        """Stop the running jobs, queue them again and end the threads."""
        self._leaving.set()
        self._wake.set()
        _join([self._thread, self._leases], self.stop_s)
        # A job may have begun until they ended.
        _join(tuple(self._running), self.stop_s)

    def _step(self) -> bool:
        """Start the next job, if any, in a thread of its own; returns whether one was started."""
        held = self._held()
        if len(held) >= self._most or not self._has_free_space() or self._files.store.fault() is not None:
            return False
        full = len(held) - (self._extra in held) >= self._at_once
        job = self.queue.claim(idle_only=full)
        if job is None and full and self._extra not in held:
            job = self.queue.claim(accepts=self._is_short)
            self._extra = "" if job is None else job.id
        if job is None:
            return False
        thread = threading.Thread(target=self._run_to_end, args=(job,), name=job.id, daemon=True)
        self._running[thread] = job.id
        try:
            thread.start()
        except BaseException:
            del self._running[thread]
            raise
        return True

    def _is_short(self, plan: Plain) -> bool:
        return is_short(plan, _seconds(plan), self.compute.capacities())

    def _run_to_end(self, job: JobRow) -> None:
        try:
            with about(job=job.id), self._traces.attempt(job):
                self._run(job)
        except Exception:
            # The lease expires, and the job is claimed again.
            log.exception("the outcome of %s could not be stored", job.id)
        finally:
            del self._running[threading.current_thread()]
            self._wake.set()

    def _has_free_space(self) -> bool:
        return shutil.disk_usage(self._files.root).free >= self._min_free_bytes

    def _run(self, job: JobRow) -> None:
        job_id, files = job.id, self._files.of(job.tenant)
        reporter = Reporter(
            self.queue, job_id, self._leaving.is_set, taken=lambda: bytes_in(files.work(job_id))
        )
        kind = KINDS[job.kind]
        target = kind.target(files, job)
        try:
            source = self._files.store.fetch(kind.source(files, job))
            try:
                # An existing result of an identical job may be reused.
                self._files.store.fetch(target)
            except FileNotFoundError:
                pass
            except Damaged:
                # The damaged file is replaced.
                self._files.store.remove([target])
            client = self.compute.client
            plan, lane = job.plan or {}, kind.lane
            if self._is_short(plan):
                lane = SHORT_LANE
            with self._shares.of(self._accounts.of(job.tenant), lane, client) as share:
                control = JobControl(
                    on_progress=reporter.report, on_saved=reporter.saved, stop=reporter.stop, share=share
                )
                work_dir = files.work(job_id)
                result = kind.run(JobRun(client, source, job.settings, target, work_dir, control))
            self._publish_result(target, reporter)
        except Cancelled:
            if not reporter.lost:
                self._store_outcome(job_id, lambda: self._stopped(job_id, files, reporter))
                self._count_end(job)
        except (*UNAVAILABLE, DatabaseUnavailable, StorageUnavailable) as error:
            kinds = (
                (DatabaseUnavailable, "database"),
                (StorageUnavailable, "storage"),
                (Exception, "workers"),
            )
            away = next(name for kind, name in kinds if isinstance(error, kind))
            reason = f"no answer from the {away}; the job continues when available"
            self._requeue(job_id, reason, error)
            self.metrics.count_retries(away)
            self._leaving.wait(self.idle_s)
        except Exception as error:
            if isinstance(error, OSError) and error.errno in FULL and not self._has_free_space():
                self._requeue(job_id, "the disk is full; the job continues once there is space", error)
                self.metrics.count_retries("disk")
                return
            problem = explain(job_id, error).model_dump(exclude_none=True)
            self._store_outcome(job_id, lambda: self._failed(job_id, files, reporter, problem))
            self._count_end(job)
        else:
            self._store_outcome(
                job_id, lambda: self._succeeded(job_id, files, reporter, kind, result, target)
            )
            self._count_end(job)

    def _count_end(self, job: JobRow) -> None:
        """Count a job in the metrics in the state that was stored; it may have been queued again."""
        try:
            state = self.queue.state(job.id)
        except (SQLAlchemyError, DatabaseUnavailable):
            return
        if state in ENDED:
            self.metrics.observe_end(job.kind, state, time.time() - (job.started or time.time()))
        else:
            self.metrics.count_retries("service")

    def _requeue(self, job_id: str, reason: str, error: BaseException) -> None:
        """Queue a job again for a reason outside of the job."""
        log.warning("%s waits: %s (%s)", job_id, reason, error)
        self._store_outcome(job_id, lambda: self.queue.release(job_id, reason))

    def _publish_result(self, target: Path, reporter: Reporter) -> None:
        """Publish a result in the store; repeated while the store is unavailable.

        Raises:
            Cancelled: when the job was cancelled in the meantime.
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
            self.queue.release(job_id, "the service was stopped")
        else:
            self.queue.mark_cancelled(job_id)
        if self.queue.state(job_id) in ENDED:
            files.drop_work(job_id)

    def _failed(self, job_id: str, files: TenantFiles, reporter: Reporter, problem: dict[str, Any]) -> None:
        reporter.flush()
        self.queue.fail(job_id, problem)
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
        # A result without a row is one file.
        size = target.stat().st_size if result is None else 0
        if not self.queue.succeed(job_id, result, kind.table, size):
            if self.queue.held_state(job_id) is None:
                # Another service runs it now and writes the same file.
                return
            with suppress(StorageUnavailable):
                # A remaining file is removed as an orphan.
                kind.discard(files, target)
            self.queue.mark_cancelled(job_id)
        files.drop_work(job_id)

    def _store_outcome(self, job_id: str, write_the_end: Callable[[], None]) -> None:
        """Store the outcome of a job; repeated while the database is unavailable.

        After ``REFUSALS`` other errors of the database the job fails.
        """
        refused = 0
        while True:
            try:
                return write_the_end()
            except (DatabaseUnavailable, DatabaseFull):
                if self._leaving.wait(self.idle_s):
                    raise
            except SQLAlchemyError as error:
                refused += 1
                log.exception("the outcome of %s could not be stored", job_id)
                if refused >= REFUSALS:
                    problem = explain(job_id, error).model_dump(exclude_none=True)
                    self.queue.fail(job_id, problem)
                    return None
                if self._leaving.wait(self.idle_s):
                    raise


def _seconds(plan: Plain) -> float | None:
    """Estimated duration of a planned job on idle workers, s."""
    minutes = estimate(plan, ()).minutes
    return None if minutes is None else 60.0 * minutes


def _join(threads: Iterable[threading.Thread], seconds: float) -> None:
    words = "%s did not stop in %g s; its job will be repeated after the next start"
    for thread in threads:
        thread.join(seconds)
        if thread.is_alive():
            log.warning(words, thread.name, seconds)

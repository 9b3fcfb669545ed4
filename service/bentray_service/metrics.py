"""Prometheus metrics of requests, jobs, workers, stored files, threads and the process.

Names start with ``bentray_`` and end with the unit in the plural (``_seconds``, ``_bytes``), counters with
``_total``. No label has values that clients can choose, and each has few: of tenants, those that use most.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cryptography import x509
from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, ProcessCollector
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector
from sqlalchemy.exc import SQLAlchemyError
from starlette.types import Scope

from .backup.archive import newest_backup
from .rows import usage
from .rows.checksums import Checksums
from .rows.keys import Keys
from .rows.tables import STATES
from .web.errors import METHODS
from .web.middleware import route_of

if TYPE_CHECKING:
    from .wiring import AccessParts, BackgroundParts, StoreParts

# From a status poll to a rendered image.
BUCKETS_S = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 60.0)

# Tenants with labels of their own.
TENANTS = 20


class Metrics:
    """The metrics of an application.

    Attributes:
        registry: of all metrics.
        in_flight: requests in progress.
    """

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        labels = ("method", "route")
        self._requests = Counter(
            "bentray_http_requests_total", "Requests answered.", (*labels, "status"), registry=self.registry
        )
        self._seconds = Histogram(
            "bentray_http_request_duration_seconds",
            "Time from the first byte of a request to the last byte of its response.",
            labels,
            buckets=BUCKETS_S,
            registry=self.registry,
        )
        self._received = Counter(
            "bentray_http_received_bytes_total", "Bytes of request bodies.", labels, registry=self.registry
        )
        self.in_flight = Gauge(
            "bentray_http_requests_in_flight", "Requests in progress.", registry=self.registry
        )
        # Memory, processor time and open files of this process; empty except on Linux.
        self.registry.register(_Sentences(ProcessCollector("bentray", registry=None)))

    def watch(self, stores: StoreParts, background: BackgroundParts, access: AccessParts) -> None:
        """Add metrics of an open service, collected on request."""
        self.registry.register(_ServiceCollector(stores, background, access))

    def observe_request(self, scope: Scope, status: int, received: int, seconds: float) -> None:
        """Count a request whose response has ended; ``received``: bytes of its body."""
        method, route = scope["method"] if scope["method"] in METHODS else "other", route_of(scope)
        self._requests.labels(method, route, str(status)).inc()
        self._seconds.labels(method, route).observe(seconds)
        self._received.labels(method, route).inc(received)


class _ServiceCollector(Collector):
    """Collects the metrics of the parts of a service; unavailable ones are omitted."""

    def __init__(self, stores: StoreParts, background: BackgroundParts, access: AccessParts) -> None:
        self._stores, self._background, self._access = stores, background, access

    def describe(self) -> list[Metric]:
        return []

    def collect(self) -> Iterator[Metric]:
        files, settings = self._stores.files, self._access.settings
        yield from self._from_database()
        yield from self._from_cluster()
        yield from self._background.runner.metrics.collect()
        up = float(files.store.fault() is None)
        disk, least = shutil.disk_usage(files.root), settings.min_free_bytes
        threads = self._background.readiness.threads
        alive = {name: float(part.alive()) for name, part in threads.items()}
        yield GaugeMetricFamily("bentray_storage_up", "Whether the store is available.", up)
        yield GaugeMetricFamily("bentray_disk_free_bytes", "Free space in the data folder.", disk.free)
        yield GaugeMetricFamily(
            "bentray_disk_total_bytes", "Size of the disk of the data folder.", disk.total
        )
        yield GaugeMetricFamily("bentray_disk_needed_bytes", "Free space without which no job starts.", least)
        yield _by_label("bentray_threads_up", "Whether all threads of a part are alive.", "part", alive)
        lost = self._access.audit.lost
        yield CounterMetricFamily("bentray_audit_lost_total", "Entries missing from the audit log.", lost)
        newest = newest_backup(files.root)
        if newest is not None:
            words = "End of the newest backup, since 1970 UTC."
            yield GaugeMetricFamily("bentray_backup_timestamp_seconds", words, newest)

    def _from_cluster(self) -> Iterator[Metric]:
        """The metrics of scheduler and workers; workers are added up, since there may be hundreds."""
        compute = self._background.runner.compute
        workers = compute.health()
        memory = [(one.memory_bytes or 0, one.memory_limit_bytes) for one in workers]
        fullest = max((used / limit for used, limit in memory if limit), default=0.0)
        used, limit = sum(used for used, _ in memory), sum(limit for _, limit in memory)
        threads, tasks = sum(one.threads or 0 for one in workers), sum(one.running_tasks for one in workers)
        yield GaugeMetricFamily("bentray_workers", "Connected Dask workers.", len(workers))
        yield GaugeMetricFamily("bentray_workers_memory_bytes", "Memory of all workers.", used)
        yield GaugeMetricFamily("bentray_workers_memory_limit_bytes", "Its limit.", limit)
        words = "Memory of the worker that is nearest to its limit, as a part of it."
        yield GaugeMetricFamily("bentray_workers_fullest_ratio", words, fullest)
        yield GaugeMetricFamily("bentray_workers_threads", "Threads that run tasks.", threads)
        yield GaugeMetricFamily("bentray_workers_running_tasks", "Running tasks.", tasks)
        paused = sum(one.paused for one in workers)
        yield GaugeMetricFamily("bentray_workers_paused", "Workers without free memory.", paused)
        words, lost = "Workers that left, also to be restarted.", compute.lost_workers()
        yield CounterMetricFamily("bentray_workers_lost_total", words, lost)
        load = compute.scheduler_load()
        yield GaugeMetricFamily(
            "bentray_scheduler_up", "Whether the scheduler answers.", float(load is not None)
        )
        if load is not None:
            waiting = load.waiting_tasks
            yield GaugeMetricFamily("bentray_scheduler_tasks", "Tasks that the scheduler holds.", load.tasks)
            yield GaugeMetricFamily(
                "bentray_scheduler_waiting_tasks", "Tasks that no worker can run now.", waiting
            )
            yield GaugeMetricFamily(
                "bentray_scheduler_memory_bytes", "Memory of its process.", load.memory_bytes
            )
        folder = self._access.settings.tls_dir
        if folder is not None and (end := _end_of(folder / "certificate.pem")) is not None:
            words = "End of the certificate of scheduler and workers, since 1970 UTC."
            yield GaugeMetricFamily("bentray_certificate_expiry_timestamp_seconds", words, end)

    def _from_database(self) -> Iterator[Metric]:
        """The metrics of stored jobs, files, tenants and keys."""
        database, queue = self._stores.database, self._background.runner.queue
        in_use, most = database.connections()
        yield GaugeMetricFamily("bentray_database_connections", "Connections to the database in use.", in_use)
        yield GaugeMetricFamily("bentray_database_connections_limit", "Maximum number of these.", most)
        try:
            counts, oldest = queue.load()
            damaged = Checksums(database).count_damaged()
            sent = self._background.webhooks.deliveries.counts()
            queues = queue.longest(TENANTS)
            expiry = Keys(database).next_expiry()
            with database.read() as connection:
                sizes = usage.largest(connection, TENANTS)
        except SQLAlchemyError:
            return
        words = f"Bytes stored and reserved by the {TENANTS} tenants that use most, with their projects."
        yield _by_label("bentray_tenant_used_bytes", words, "tenant", sizes)
        yield GaugeMetricFamily(
            "bentray_tenant_quota_bytes", "Quota of each tenant.", self._access.settings.max_tenant_bytes
        )
        words = f"Unfinished jobs by state, of the {TENANTS} tenants that have most."
        unfinished = GaugeMetricFamily("bentray_tenant_jobs", words, labels=["tenant", "state"])
        for labels, number in queues.items():
            unfinished.add_metric(labels, number)
        yield unfinished
        if expiry is not None:
            words = "When the next key expires, since 1970 UTC."
            yield GaugeMetricFamily("bentray_keys_next_expiry_timestamp_seconds", words, expiry)
        jobs = {state: counts.get(state, 0) for state in STATES}
        yield _by_label("bentray_jobs", "Jobs by state.", "state", jobs)
        age = 0.0 if oldest is None else max(0.0, time.time() - oldest)
        yield GaugeMetricFamily("bentray_jobs_oldest_queued_seconds", "Age of the oldest queued job.", age)
        yield GaugeMetricFamily("bentray_files_damaged", "Stored items known to be damaged.", damaged)
        yield _by_label("bentray_webhooks", "Messages to webhooks by state.", "state", sent)


class _Sentences(Collector):
    """The metrics of another collector, with descriptions that end as ours do."""

    def __init__(self, inner: Collector) -> None:
        self._inner = inner

    def describe(self) -> list[Metric]:
        return []

    def collect(self) -> Iterator[Metric]:
        for one in self._inner.collect():
            one.documentation = one.documentation.rstrip(".") + "."
            yield one


def _end_of(certificate: Path) -> float | None:
    """The end of the validity of a certificate, s since 1970; None if it cannot be read."""
    try:
        return x509.load_pem_x509_certificate(certificate.read_bytes()).not_valid_after_utc.timestamp()
    except (OSError, ValueError):
        return None


def _by_label(name: str, words: str, label: str, values: Mapping[Any, float]) -> GaugeMetricFamily:
    family = GaugeMetricFamily(name, words, labels=[label])
    for text, value in values.items():
        family.add_metric([text], value)
    return family

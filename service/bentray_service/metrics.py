"""Prometheus metrics of requests, jobs, workers, stored files, threads and the process.

Names start with ``bentray_`` and end with the unit in the plural (``_seconds``, ``_bytes``), counters with
``_total``. No label has values that clients can choose.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, ProcessCollector
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector
from sqlalchemy.exc import SQLAlchemyError
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from .backup.archive import newest_backup
from .rows.checksums import Checksums
from .rows.schema import STATES

if TYPE_CHECKING:
    from .wiring import Parts

# From a status poll to a rendered image.
BUCKETS_S = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 60.0)

UNMATCHED = "unmatched"


class Metrics:
    """The metrics of an application.

    Attributes:
        registry: of all metrics.
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
        self._in_flight = Gauge(
            "bentray_http_requests_in_flight", "Requests in progress.", registry=self.registry
        )
        # Memory, processor time and open files of this process; empty except on Linux.
        self.registry.register(_Sentences(ProcessCollector("bentray", registry=None)))

    def watch(self, parts: Parts) -> None:
        """Add metrics of an open service, collected on request."""
        self.registry.register(_ServiceCollector(parts))

    def middleware(self, app: ASGIApp) -> ASGIApp:
        """ASGI middleware that counts and times requests."""

        async def counted(scope: Scope, receive: Receive, send: Send) -> None:
            if scope["type"] != "http":
                await app(scope, receive, send)
                return
            status, received, begun = 500, 0, time.perf_counter()

            async def receive_counted() -> Message:
                nonlocal received
                message = await receive()
                received += len(message.get("body", b""))
                return message

            async def send_seen(message: Message) -> None:
                nonlocal status
                if message["type"] == "http.response.start":
                    status = message["status"]
                await send(message)

            self._in_flight.inc()
            try:
                await app(scope, receive_counted, send_seen)
            finally:
                self._in_flight.dec()
                method, route = _method(scope), _route(scope)
                self._requests.labels(method, route, str(status)).inc()
                self._seconds.labels(method, route).observe(time.perf_counter() - begun)
                self._received.labels(method, route).inc(received)

        return counted


def _method(scope: Scope) -> str:
    known = {"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"}
    return scope["method"] if scope["method"] in known else "other"


def _route(scope: Scope) -> str:
    """The path template of the route, e.g. ``/v1/jobs/{job_id}``."""
    return str(getattr(scope.get("route"), "path", UNMATCHED))


class _ServiceCollector(Collector):
    """Collects the metrics of the parts of a service; unavailable ones are omitted."""

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    def describe(self) -> list[Metric]:
        return []

    def collect(self) -> Iterator[Metric]:
        parts = self._parts
        yield from self._from_database()
        yield _gauge("bentray_workers", "Connected Dask workers.", parts.compute.workers())
        up = float(parts.files.store.fault() is None)
        yield _gauge("bentray_storage_up", "Whether the store is available.", up)
        disk, least = shutil.disk_usage(parts.files.root), parts.settings.min_free_bytes
        yield _gauge("bentray_disk_free_bytes", "Free space in the data folder.", disk.free)
        yield _gauge("bentray_disk_total_bytes", "Size of the disk of the data folder.", disk.total)
        yield _gauge("bentray_disk_needed_bytes", "Free space without which no job starts.", least)
        threads = GaugeMetricFamily(
            "bentray_threads_up", "Whether all threads of a part are alive.", labels=["part"]
        )
        for name, part in parts.threads.items():
            threads.add_metric([name], float(part.alive()))
        yield threads
        lost = CounterMetricFamily("bentray_audit_lost_total", "Entries missing from the audit log.")
        lost.add_metric([], parts.audit.lost)
        yield lost
        newest = newest_backup(parts.files.root)
        if newest is not None:
            yield _gauge(
                "bentray_backup_timestamp_seconds", "End of the newest backup, since 1970 UTC.", newest
            )

    def _from_database(self) -> Iterator[Metric]:
        """The metrics of stored jobs and files."""
        parts = self._parts
        try:
            counts, oldest = parts.queue.load()
            damaged = Checksums(parts.database).count_damaged()
            sent = parts.deliveries.counts()
        except SQLAlchemyError:
            return
        waiting = GaugeMetricFamily("bentray_jobs", "Jobs by state.", labels=["state"])
        for state in STATES:
            waiting.add_metric([state], counts.get(state, 0))
        yield waiting
        age = 0.0 if oldest is None else max(0.0, time.time() - oldest)
        yield _gauge("bentray_jobs_oldest_queued_seconds", "Age of the oldest queued job.", age)
        yield _gauge("bentray_files_damaged", "Stored items known to be damaged.", damaged)
        messages = GaugeMetricFamily("bentray_webhooks", "Messages to webhooks by state.", labels=["state"])
        for state, count in sent.items():
            messages.add_metric([state], count)
        yield messages


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


def _gauge(name: str, words: str, value: float) -> GaugeMetricFamily:
    return GaugeMetricFamily(name, words, value=value)

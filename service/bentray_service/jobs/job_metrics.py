"""Prometheus metrics of ended and repeated jobs of this process; the runner counts, ``/metrics`` collects."""

from __future__ import annotations

from collections.abc import Iterator

from prometheus_client import Counter, Histogram
from prometheus_client.metrics_core import Metric

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

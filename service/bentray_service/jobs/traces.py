"""OpenTelemetry traces: a span of each attempt of a job, below the request that started it.

Spans of requests are FastAPI's, spans of tasks those of ``bentray_workers.cluster.task_retries``. Without the
extra ``otel`` and an OTLP endpoint in the environment, all of them do nothing.
"""

import os
import threading
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

from fastapi.telemetry import TelemetryConfig
from opentelemetry import trace
from opentelemetry.util.types import AnyValue

from bentray_kernels.errors import InvalidInput

from ..rows.tables import JobRow

TRACER = trace.get_tracer("bentray")
ENDPOINTS = ("OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "OTEL_EXPORTER_OTLP_ENDPOINT")
# Requests whose jobs have not begun, of which the spans are remembered.
MOST_ORIGINS = 10_000


def telemetry_from(environment: Mapping[str, str] = os.environ) -> TelemetryConfig:
    """The configuration of FastAPI: traces of requests, exported if the environment names an endpoint.

    Raises:
        InvalidInput: when the extra is missing.
    """
    endpoint = next((name for name in ENDPOINTS if environment.get(name)), None)
    export = endpoint is not None and environment.get("OTEL_SDK_DISABLED", "").lower() != "true"
    if endpoint and export and find_spec("opentelemetry.exporter") is None:
        raise InvalidInput(endpoint, environment[endpoint], "none without the extra bentray[otel]")
    # Requests have Prometheus metrics and lines in the log already.
    return {
        "tracing": export,
        "auto_configure": export,
        "metrics": False,
        "logs": False,
        "operation_spans": False,
        "exclude": _untraced,
    }


def _untraced(scope: Any) -> bool:
    """Probes, scrapes and event streams, which are many or long."""
    path = str(scope.get("path", ""))
    return path.startswith(("/health/", "/static/")) or path == "/metrics" or path.endswith("/events")


class JobTraces:
    """Connects requests with the jobs that they started, within this process."""

    def __init__(self) -> None:
        self._changing = threading.Lock()
        self._origins: OrderedDict[str, trace.SpanContext] = OrderedDict()

    def remember(self, started: str) -> None:
        """Remember the span of the present request for a job or batch that it started."""
        context = trace.get_current_span().get_span_context()
        if not context.is_valid:
            return
        with self._changing:
            self._origins[started] = context
            if len(self._origins) > MOST_ORIGINS:
                self._origins.popitem(last=False)

    @contextmanager
    def attempt(self, job: JobRow) -> Iterator[None]:
        """The span of an attempt; spans of its tasks are below it."""
        with self._changing:
            origin = self._origins.get(job.id) or self._origins.get(job.batch_id or "")
        parent = trace.set_span_in_context(trace.NonRecordingSpan(origin)) if origin else None
        attributes: dict[str, AnyValue] = {"bentray.job": job.id, "bentray.attempt": job.attempts}
        with TRACER.start_as_current_span(f"job {job.kind}", parent, attributes=attributes):
            yield

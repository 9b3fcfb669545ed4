"""Traces: request, job and tasks are one trace; without an endpoint nothing is recorded."""

import pytest
from opentelemetry import trace

from bentray_kernels.errors import InvalidInput
from bentray_kernels.task_graph import Task
from bentray_service.jobs import traces
from bentray_service.rows.tables import JobRow
from bentray_workers.cluster import task_retries
from bentray_workers.cluster.task_retries import Attempts

ENDPOINT = {"OTEL_EXPORTER_OTLP_ENDPOINT": "http://collector:4318"}


def test_it_is_off_without_an_endpoint():
    assert traces.telemetry_from({})["tracing"] is False
    assert traces.telemetry_from({**ENDPOINT, "OTEL_SDK_DISABLED": "true"})["tracing"] is False


def test_a_missing_extra_is_named(monkeypatch):
    monkeypatch.setattr(traces, "find_spec", lambda _name: None)
    with pytest.raises(InvalidInput, match=r"OTEL_EXPORTER_OTLP_ENDPOINT.*bentray\[otel\]"):
        traces.telemetry_from(ENDPOINT)


@pytest.mark.parametrize(
    ("path", "excluded"),
    [
        ("/v1/jobs", False),
        ("/v1/jobs/job-1/events", True),
        ("/health/live", True),
        ("/metrics", True),
        ("/static/x.js", True),
    ],
)
def test_probes_and_streams_are_left_out(path, excluded):
    assert traces.telemetry_from({})["exclude"]({"path": path}) == excluded


def test_request_job_and_tasks_are_one_trace(monkeypatch, tmp_path, cluster):
    exporting = pytest.importorskip("opentelemetry.sdk.trace.export.in_memory_span_exporter")
    from opentelemetry.sdk.trace import TracerProvider
    from opentelemetry.sdk.trace.export import SimpleSpanProcessor

    memory, provider = exporting.InMemorySpanExporter(), TracerProvider()
    provider.add_span_processor(SimpleSpanProcessor(memory))
    tracer = provider.get_tracer("test")
    monkeypatch.setattr(traces, "TRACER", tracer)
    monkeypatch.setattr(task_retries, "TRACER", tracer)
    jobs = traces.JobTraces()
    with tracer.start_as_current_span("POST /v1/jobs"):
        jobs.remember("job-1")
    assert not trace.get_current_span().get_span_context().is_valid
    job = JobRow(id="job-1", batch_id=None, kind="reconstruction", attempts=1)
    with jobs.attempt(job):
        attempts = Attempts(cluster, tmp_path, lambda: {"resources": {}, "workers": None})
        attempts.result(attempts.submit(Task(abs, (-1,), keep_on_worker=True)))
        attempts.submit(Task(abs, (-2,)))
        attempts.end_spans()
    spans = {span.name: span for span in memory.get_finished_spans()}
    request, run = spans["POST /v1/jobs"], spans["job reconstruction"]
    assert [span.name for span in memory.get_finished_spans()].count("task abs") == 2
    assert spans["task abs"].parent.span_id == run.context.span_id
    assert run.parent.span_id == request.context.span_id
    assert len({span.context.trace_id for span in spans.values()}) == 1
    assert run.attributes == {"bentray.job": "job-1", "bentray.attempt": 1}


def test_the_memory_of_requests_is_bounded(monkeypatch):
    monkeypatch.setattr(traces, "MOST_ORIGINS", 2)
    jobs, context = traces.JobTraces(), trace.SpanContext(1, 2, is_remote=False)
    with trace.use_span(trace.NonRecordingSpan(context)):
        for number in range(5):
            jobs.remember(f"job-{number}")
    assert list(jobs._origins) == ["job-3", "job-4"]

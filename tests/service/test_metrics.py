"""Metrics: named by one rule, counted by the route's own words, and true."""

import re
import shutil
import subprocess
import time
from pathlib import Path

import pytest
from prometheus_client.parser import text_string_to_metric_families
from sqlalchemy import text

from bentray_service.backup.archive import NEWEST
from bentray_service.metrics import TENANTS
from bentray_service.rows import usage
from bentray_service.rows.ids import LOCAL, Tenant
from bentray_service.rows.keys import ApiKey, Keys
from bentray_workers.cluster.scheduler_load import SchedulerLoad
from bentray_workers.cluster.worker_health import WorkerHealth

from .conftest import signed

pytestmark = pytest.mark.usefixtures("work")

NAME = re.compile(r"bentray_[a-z]+(_[a-z]+)*")


def read(http):
    answer = http.get("/metrics")
    assert answer.headers["content-type"].startswith("text/plain")
    return {family.name: family for family in text_string_to_metric_families(answer.text)}


def value(http, name, **labels):
    found = [s.value for f in read(http).values() for s in f.samples if s.name == name and s.labels == labels]
    assert len(found) <= 1
    return found[0] if found else 0.0


def test_metric_names_end_in_their_unit(http):
    families = read(http)
    assert len(families) >= 7
    for name, family in families.items():
        assert NAME.fullmatch(name)
        assert family.documentation.endswith(".")
        assert not re.search(r"_(ms|mb|kb|millis|time|size)$", name)
        if family.type == "histogram":
            assert name.endswith("_seconds")


def test_requests_are_counted_by_route_template(http):
    for k in range(5):
        http.get(f"/v1/jobs/job-{k:020d}")
        http.get(f"/nothing/{k}")
        http.request(f"BREW{k}", "/v1/jobs")
    job = {"method": "GET", "route": "/v1/jobs/{job_id}"}
    assert value(http, "bentray_http_requests_total", **job, status="404") == 5
    assert value(http, "bentray_http_request_duration_seconds_count", **job) == 5
    assert value(http, "bentray_http_requests_total", method="GET", route="unmatched", status="404") == 5
    methods = {s.labels["method"] for s in read(http)["bentray_http_requests"].samples}
    assert methods <= {"GET", "other"}


def test_bytes_of_uploads(http, uploaded):
    before = value(http, "bentray_http_received_bytes_total", method="POST", route="/v1/datasets")
    uploaded(http)
    after = value(http, "bentray_http_received_bytes_total", method="POST", route="/v1/datasets")
    assert before == 0.0
    assert after > 1000.0


def test_the_queue_who_waits_and_how_long_it_takes(http, uploaded, submitted, until, work, cluster):
    dataset = uploaded(http)
    work.hold.clear()
    jobs = [submitted(http, dataset)["id"] for _ in range(3)]
    for job in jobs[:2]:
        until(http, job, "running")
    local = {"tenant": "local", "state": "queued"}
    assert value(http, "bentray_jobs", state="running") == 2
    assert value(http, "bentray_jobs", state="queued") == value(http, "bentray_tenant_jobs", **local) == 1
    assert value(http, "bentray_jobs_oldest_queued_seconds") > 0.0
    used, most = (
        value(http, "bentray_tenant_used_bytes", tenant="local"),
        value(http, "bentray_tenant_quota_bytes"),
    )
    assert 0 < used < most
    work.hold.set()
    for job in jobs:
        until(http, job)
    ended = {"kind": "reconstruction", "state": "succeeded"}
    assert value(http, "bentray_jobs", state="succeeded") == 3
    assert value(http, "bentray_job_duration_seconds_count", **ended) == 3
    assert (
        value(http, "bentray_jobs_oldest_queued_seconds") == value(http, "bentray_tenant_jobs", **local) == 0
    )
    assert value(http, "bentray_workers") == 1
    cluster.workers = 3
    assert value(http, "bentray_workers_lost_total") == 0
    cluster.workers = 0
    assert value(http, "bentray_workers") == 0
    assert value(http, "bentray_workers_lost_total") == 3
    assert value(http, "bentray_disk_free_bytes") > 0


def test_what_alarms_read_of_workers_scheduler_disk_and_backup(http, monkeypatch):
    compute, files = http.app.state.background.runner.compute, http.app.state.stores.files
    workers = tuple(
        WorkerHealth(2, memory, limit, None, tasks, paused, opencl=False, compiling=False)
        for memory, limit, tasks, paused in ((30, 100, 1, False), (80, 100, 2, True), (None, 0, 0, False))
    )
    monkeypatch.setattr(compute, "health", lambda: workers)
    monkeypatch.setattr(compute, "scheduler_load", lambda: SchedulerLoad(7, 3, 5))
    assert "bentray_backup_timestamp_seconds" not in read(http)
    (files.root / NEWEST).write_text('{"finished": 1e9}')
    seen = {name: family.samples[0].value for name, family in read(http).items() if family.samples}
    expected = {
        "workers": 3,
        "workers_memory_bytes": 110,
        "workers_memory_limit_bytes": 200,
        "workers_fullest_ratio": 0.8,
        "workers_threads": 6,
        "workers_running_tasks": 3,
        "workers_paused": 1,
        "scheduler_up": 1,
        "scheduler_tasks": 7,
        "scheduler_waiting_tasks": 3,
        "scheduler_memory_bytes": 5,
        "storage_up": 1,
        "disk_total_bytes": shutil.disk_usage(files.root).total,
        "disk_needed_bytes": http.app.state.access.settings.min_free_bytes,
        "backup_timestamp_seconds": 1e9,
    }
    assert {name: seen[f"bentray_{name}"] for name in expected} == expected
    monkeypatch.setattr(compute, "scheduler_load", lambda: None)
    assert value(http, "bentray_scheduler_up") == 0
    assert "bentray_scheduler_tasks" not in read(http)


def test_database_connections_and_the_end_of_keys(http):
    state = http.app.state
    assert 1 <= value(http, "bentray_database_connections_limit") <= 32
    with state.stores.database.read() as connection:
        connection.execute(text("SELECT 1"))
        assert value(http, "bentray_database_connections") == 1
    assert value(http, "bentray_keys_next_expiry_timestamp_seconds") == 0, "no key expires"
    for number, expires in enumerate((9e9, 8e9, 1.0, None)):
        Keys(state.stores.database).add(ApiKey.new(), LOCAL, f"key {number}", ["metrics"], expires)
    http.headers.update(signed(http, scopes=("metrics",)))
    assert value(http, "bentray_keys_next_expiry_timestamp_seconds") == 8e9


def test_only_the_tenants_that_use_most_have_labels(http):
    state = http.app.state
    with state.stores.database.write() as connection:
        for number in range(TENANTS + 5):
            usage.store(connection, Tenant(f"tenant-{number:02d}"), "x", 100 + number)
    found = [s.labels["tenant"] for s in read(http)["bentray_tenant_used_bytes"].samples]
    assert found == [f"tenant-{number:02d}" for number in range(TENANTS + 4, 4, -1)]


def test_the_end_of_the_certificates(start, work, monkeypatch, tmp_path):
    script = Path(__file__).parents[2] / "deploy/certificates.sh"
    subprocess.run([str(script), str(tmp_path), "30"], check=True, capture_output=True)
    monkeypatch.setenv("BENTRAY_TLS_DIR", str(tmp_path))
    end = value(start(), "bentray_certificate_expiry_timestamp_seconds")
    assert end == pytest.approx(time.time() + 30 * 86400, abs=60.0)


def test_metrics_without_the_database(http, monkeypatch):
    from sqlalchemy.exc import OperationalError

    def away():
        raise OperationalError("select", {}, Exception("gone"))

    monkeypatch.setattr(http.app.state.background.runner.queue, "load", away)
    families = read(http)
    assert "bentray_jobs" not in families
    assert "bentray_workers" in families


def test_each_application_has_its_own(start, work):
    one, other = start(), start("other")
    one.get("/health/live")
    labels = {"method": "GET", "route": "/health/live", "status": "200"}
    assert value(one, "bentray_http_requests_total", **labels) == 1
    assert value(other, "bentray_http_requests_total", **labels) == 0


def test_threads_and_damage_are_seen(http, uploaded):
    dataset = uploaded(http)
    assert value(http, "bentray_threads_up", part="housekeeping") == 1
    http.app.state.background.runner.stop()
    assert value(http, "bentray_threads_up", part="runner") == 0
    assert value(http, "bentray_threads_up", part="ingest") == 1
    assert value(http, "bentray_files_damaged") == 0
    path = next(http.app.state.stores.files.root.glob("tenants/local/datasets/*.h5"))
    path.write_bytes(path.read_bytes()[:-1])
    assert http.get(f"/v1/datasets/{dataset}/geometry").status_code == 500
    assert value(http, "bentray_files_damaged") == 1


def test_lost_audit_entries_are_counted(http):
    folder = http.app.state.stores.files.audit
    assert value(http, "bentray_audit_lost_total") == 0
    for path in folder.iterdir():
        path.unlink()
    folder.rmdir()
    http.get("/v1/datasets")
    # The entry of the request for the metrics comes after its answer.
    assert value(http, "bentray_audit_lost_total") == 1

"""Alarms and dashboard: every metric exists, each alarm fires when it should, and the runbook explains it."""

import json
import re
import shutil
import subprocess
import time
from pathlib import Path

import pytest
import yaml
from prometheus_client.parser import text_string_to_metric_families

from bentray_service.backup.back_up import back_up

from .conftest import signed

ROOT = Path(__file__).parents[2]
DEPLOY = ROOT / "deploy"
RULES = yaml.safe_load((DEPLOY / "prometheus/alerts.yml").read_text())["groups"][0]["rules"]
RUNBOOK = ROOT / "docs/how-to/runbook.md"
SELECTOR = re.compile(r"\b(bentray_\w+|up|ALERTS)\b(?:\{([^}]*)\})?")
# Of Prometheus itself.
ITS_OWN = {"up": {"job", "instance"}, "ALERTS": {"alertname", "alertstate"}}

# Series of a healthy service.
HEALTHY = {
    'up{job="bentray"}': "1x170",
    'bentray_threads_up{part="runner"}': "1x170",
    "bentray_workers": "4x170",
    "bentray_storage_up": "1x170",
    "bentray_disk_free_bytes": "50e9x170",
    "bentray_disk_total_bytes": "100e9x170",
    "bentray_disk_needed_bytes": "5e8x170",
    "bentray_files_damaged": "0x170",
    "bentray_jobs_oldest_queued_seconds": "60x170",
    'bentray_jobs{state="running"}': "2x170",
    'bentray_jobs{state="failed"}': "4x170",
    'bentray_jobs{state="succeeded"}': "0+1x170",
    'bentray_http_requests_total{method="GET",route="/",status="200"}': "0+600x170",
    'bentray_http_requests_total{method="GET",route="/",status="500"}': "0+1x170",
    'bentray_http_request_duration_seconds_bucket{method="GET",route="/",le="1.0"}': "0+600x170",
    'bentray_http_request_duration_seconds_bucket{method="GET",route="/",le="10.0"}': "0+601x170",
    'bentray_http_request_duration_seconds_bucket{method="GET",route="/",le="+Inf"}': "0+601x170",
    "bentray_audit_lost_total": "0x170",
    "bentray_backup_timestamp_seconds": "0x170",
    'bentray_webhooks{state="failed"}': "3x170",
    "bentray_process_open_fds": "90x170",
    "bentray_process_max_fds": "1024x170",
    "bentray_workers_lost_total": "0x170",
    'bentray_tenant_used_bytes{tenant="clinic"}': "5e9x170",
    "bentray_tenant_quota_bytes": "100e9x170",
    "bentray_database_connections": "2x170",
    "bentray_database_connections_limit": "15x170",
    "bentray_keys_next_expiry_timestamp_seconds": "9e9x170",
    "bentray_certificate_expiry_timestamp_seconds": "9e9x170",
}
SLOW = 'bentray_http_request_duration_seconds_bucket{method="GET",route="/",le="1.0"}'
FAILED = 'bentray_http_requests_total{method="GET",route="/",status="500"}'
# For each alarm, what differs: two hours of health, as above, then this.
ILL = {
    "BentrayDown": {'up{job="bentray"}': "0x50"},
    "BentrayThreadEnded": {'bentray_threads_up{part="runner"}': "0x50"},
    "BentrayNoWorkers": {"bentray_workers": "0x50"},
    "BentrayFewerWorkers": {"bentray_workers": "3x50"},
    "BentrayStorageDown": {"bentray_storage_up": "0x50"},
    "BentrayDiskFull": {"bentray_disk_free_bytes": "4e8x50", "bentray_disk_total_bytes": "1e9x50"},
    "BentrayDiskFillsUp": {"bentray_disk_free_bytes": "9e9x50"},
    "BentrayDamagedFiles": {"bentray_files_damaged": "1x50"},
    "BentrayQueueStands": {
        "bentray_jobs_oldest_queued_seconds": "700+60x50",
        'bentray_jobs{state="running"}': "0x50",
    },
    "BentrayQueueLong": {"bentray_jobs_oldest_queued_seconds": "14500+60x50"},
    "BentrayJobsFail": {
        'bentray_jobs{state="failed"}': "4+1x50",
        'bentray_jobs{state="succeeded"}': "120x50",
    },
    "BentrayServerErrors": {FAILED: "120+100x50"},
    "BentraySlow": {SLOW: "72000x50"},
    "BentrayAuditLost": {"bentray_audit_lost_total": "1x50"},
    "BentrayBackupOld": {"bentray_backup_timestamp_seconds": "-129600x50"},
    "BentrayNoBackup": {"bentray_backup_timestamp_seconds": "stale _x50"},
    "BentrayWebhooksFail": {'bentray_webhooks{state="failed"}': "4x50"},
    "BentrayFilesOpen": {"bentray_process_open_fds": "900x50"},
    "BentrayWorkersRestart": {"bentray_workers_lost_total": "0+1x50"},
    "BentrayTenantFull": {'bentray_tenant_used_bytes{tenant="clinic"}': "95e9x50"},
    "BentrayDatabaseBusy": {"bentray_database_connections": "15x50"},
    "BentrayKeyExpires": {"bentray_keys_next_expiry_timestamp_seconds": "6e5x50"},
    "BentrayCertificateExpires": {"bentray_certificate_expiry_timestamp_seconds": "1e6x50"},
}


def exported(http):
    """The labels of every sample name."""
    answer, found = http.get("/metrics"), {}
    for family in text_string_to_metric_families(answer.text):
        for sample in family.samples:
            found.setdefault(sample.name, set()).update(sample.labels)
    return found


def selectors():
    """Every metric and its labels, in the alarms and in the dashboard."""
    dashboard = json.loads((DEPLOY / "grafana/dashboard.json").read_text())
    asked = [one["expr"] for panel in dashboard["panels"] for one in panel["targets"]]
    asked += [rule["expr"] for rule in RULES]
    return [
        (name, set(re.findall(r"(\w+)\s*(?:=|!)", labels)))
        for expression in asked
        for name, labels in SELECTOR.findall(expression)
    ]


def test_every_metric_and_label_of_alarms_and_dashboard_exists(
    start, work, uploaded, submitted, until, tmp_path, monkeypatch
):
    subprocess.run([str(DEPLOY / "certificates.sh"), str(tmp_path / "tls")], check=True, capture_output=True)
    monkeypatch.setenv("BENTRAY_TLS_DIR", str(tmp_path / "tls"))
    http = start()
    dataset = uploaded(http)
    until(http, submitted(http, dataset)["id"])
    work.hold.clear()
    submitted(http, dataset)
    back_up(http.app.state.access.settings, tmp_path / "backup")
    http.headers.update(signed(http, scopes=("metrics",), expires=time.time() + 99.0))
    there = exported(http) | ITS_OWN
    work.hold.set()
    assert len(selectors()) > 30
    for name, labels in selectors():
        assert name in there
        # Prometheus adds the instance.
        assert labels - {"instance"} <= there[name], f"{name} has no label {labels - there[name]}"


def test_the_dashboard_shows_the_chosen_services_alone():
    dashboard = json.loads((DEPLOY / "grafana/dashboard.json").read_text())
    variables = {one["name"]: one for one in dashboard["templating"]["list"]}
    assert variables["instance"]["query"]["query"] == 'label_values(up{job="bentray"}, instance)'
    for panel in dashboard["panels"]:
        for target in panel["targets"]:
            for _, labels in SELECTOR.findall(target["expr"]):
                assert 'instance=~"$instance"' in labels, target["expr"]


def test_every_alarm_has_its_entry_in_the_runbook():
    text = RUNBOOK.read_text()
    entries = re.findall(r"^## (Bentray\w+)\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    assert [name for name, _ in entries] == [rule["alert"] for rule in RULES]
    for name, entry in entries:
        for part in ("**Symptom.**", "**Meaning.**", "**What to do.**", "```sh\n"):
            assert part in entry, f"{name} has no {part}"


@pytest.mark.nightly
def test_alarms_fire_when_they_should_and_not_before(tmp_path):
    assert set(ILL) == {rule["alert"] for rule in RULES}
    if shutil.which("promtool") is None:
        pytest.skip("no promtool here, so no alarm was evaluated: apt-get install prometheus")
    shutil.copy(DEPLOY / "prometheus/alerts.yml", tmp_path)
    tests = [_case("healthy", {}, set())]
    tests += [_case(name, changed, {name}) for name, changed in ILL.items()]
    (tmp_path / "test.yml").write_text(yaml.safe_dump({"rule_files": ["alerts.yml"], "tests": tests}))
    done = subprocess.run(
        ["promtool", "test", "rules", "test.yml"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def _case(name, changed, firing):
    """Two hours of health in steps of a minute, then 50 minutes of illness."""
    series = []
    for metric, healthy in HEALTHY.items():
        values = healthy if metric not in changed else f"{healthy.removesuffix('x170')}x119 {changed[metric]}"
        head, brace, rest = metric.partition("{")
        labels = f'{head}{{instance="service"{"," if brace else ""}{rest if brace else "}"}'
        series.append({"series": labels, "values": values})
    fired = "count by (alertname) (ALERTS{alertstate='firing'})"
    checks = [("119m", set()), ("170m", firing)]
    return {
        "name": name,
        "interval": "1m",
        "input_series": series,
        "promql_expr_test": [
            {
                "expr": fired,
                "eval_time": when,
                "exp_samples": [{"labels": f'{{alertname="{one}"}}', "value": 1} for one in sorted(expected)],
            }
            for when, expected in checks
        ],
    }


def test_the_scrape_file_names_the_alarms():
    scrape = yaml.safe_load((DEPLOY / "prometheus/prometheus.yml").read_text())
    assert scrape["rule_files"] == ["alerts.yml"]
    assert [one["job_name"] for one in scrape["scrape_configs"]] == ["bentray"]

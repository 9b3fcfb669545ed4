"""The audit log: reads of every authenticated caller; truncated lines are skipped with a warning."""

import json
import logging
from datetime import UTC, datetime

import pytest

from bentray_service.access.audit import Audit, entries
from bentray_service.rows.ids import Tenant
from bentray_service.rows.keys import ApiKey, Keys

ENTRY = {"method": "GET", "route": "/v1/datasets/{dataset_id}", "ids": ["ds-1"], "tenant": "acme"}


def told(http):
    return list(entries(http.app.state.stores.files.audit))


def test_a_file_a_day_only_appended_to_and_closed_to_others(tmp_path):
    days = [datetime(2026, 11, day, 12, tzinfo=UTC) for day in (21, 21, 22)]
    audit = Audit(tmp_path, lambda: days.pop(0))
    for _ in range(3):
        audit.append(ENTRY)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["2026-11-21.jsonl", "2026-11-22.jsonl"]
    assert all(path.stat().st_mode & 0o077 == 0 for path in tmp_path.iterdir())
    assert [entry["time"][:10] for entry in entries(tmp_path)] == ["2026-11-21", "2026-11-21", "2026-11-22"]


def test_truncated_line_is_skipped_with_a_warning(tmp_path, caplog):
    audit = Audit(tmp_path)
    audit.append(ENTRY)
    path = next(tmp_path.iterdir())
    path.write_bytes(path.read_bytes() + b'{"time": "2026\xff\n')
    audit.append(ENTRY)
    assert len(list(entries(tmp_path))) == 2
    assert f"{path.name}:2 is incomplete" in caplog.text


def test_entries_that_cannot_be_stored_are_logged(tmp_path, caplog):
    Audit(tmp_path / "gone").append(ENTRY)
    assert '"ids": ["ds-1"]' in caplog.text
    assert caplog.records[-1].levelno == logging.ERROR


@pytest.fixture
def key(start):
    """A service, and the headers of a caller of acme."""
    http, token = start(), ApiKey.new()
    Keys(http.app.state.stores.database).add(token, Tenant("acme"), "one", ("read", "write"))
    return http, {"Authorization": f"Bearer {token.shown()}"}, token


def test_reads_and_writes_are_audited_with_ids(key, scan, monkeypatch):
    http, auth, token = key
    http.app.state.access.sign_in._no_keys_until = 0.0
    content, media = scan().read_bytes(), {"Content-Type": "application/x-hdf5"}
    made = http.post("/v1/datasets", content=content, headers={**auth, **media, "X-Request-ID": "from-me"})
    dataset = made.json()["id"]
    assert made.headers["X-Request-ID"] == "from-me"
    seen = http.get(f"/v1/datasets/{dataset}", headers=auth)
    http.get(f"/v1/datasets/ds-{'0' * 20}?token=secret", headers=auth)
    http.get("/v1/jobs", headers=auth)
    http.get(f"/v1/datasets/{dataset}")
    found = told(http)
    brief = [(one["method"], one["route"], one["ids"], one["status"]) for one in found]
    assert brief == [
        ("POST", "/v1/datasets", [dataset], 201),
        ("GET", "/v1/datasets/{dataset_id}", [dataset], 200),
        ("GET", "/v1/datasets/{dataset_id}", [f"ds-{'0' * 20}"], 404),
    ]
    assert found[0]["request"] == "from-me"
    assert (found[0]["received"], found[1]["sent"]) == (len(content), len(seen.content))
    assert {(one["tenant"], one["how"], one["who"]) for one in found} == {("acme", "key", token.id)}
    assert "secret" not in json.dumps(found)
    assert token.shown() not in json.dumps(found)


def test_at_an_open_door_too(http):
    http.get("/v1/volumes")
    http.get("/health/live")
    assert [(one["tenant"], one["how"], one["route"]) for one in told(http)] == [
        ("local", "open", "/v1/volumes")
    ]

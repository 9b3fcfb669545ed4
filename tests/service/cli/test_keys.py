"""`bentray keys`: a key is shown once, works in a service that runs, and ends when it is revoked."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from bentray_service.files.data_folder import GUARDED
from bentray_service.rows.keys import ApiKey

from .conftest import Run


def made(bentray: Run, data: Path, *words: object) -> dict[str, Any]:
    result = bentray("keys", "create", "--name", "one", "--data", data, "--json", *words)
    found: dict[str, Any] = json.loads(result.stdout)
    return found


def test_made_listed_and_revoked(bentray: Run, tmp_path: Path) -> None:
    key = made(bentray, tmp_path, "--tenant", "clinic", "--expires", "90d", "--scopes", "read")
    assert ApiKey.from_text(key["key"]) is not None
    assert (key["tenant"], key["scopes"], key["state"]) == ("clinic", ["read"], "valid")
    made(bentray, tmp_path)
    listed = bentray("keys", "list", "--data", tmp_path, "--tenant", "clinic", "--json")
    assert [one["id"] for one in json.loads(listed.stdout)] == [key["id"]]
    assert key["key"].rpartition("_")[2] not in listed.stdout
    table = bentray("keys", "list", "--data", tmp_path).stdout
    assert "clinic" in table
    assert "never" in table
    revoked = bentray("keys", "revoke", key["id"], "--data", tmp_path)
    assert revoked.stdout == f"{key['id']} of clinic revoked\n"
    listed = bentray("keys", "list", "--data", tmp_path, "--tenant", "clinic", "--json")
    assert json.loads(listed.stdout)[0]["state"] == "revoked"


def test_a_lost_database_is_not_replaced_by_a_key(bentray: Run, tmp_path: Path) -> None:
    made(bentray, tmp_path)
    assert "delete this file" in (tmp_path / GUARDED).read_text()
    (tmp_path / "bentray.sqlite").unlink()
    for command in (("keys", "create", "--name", "two"), ("keys", "list"), ("projects", "list"), ("verify",)):
        assert "bentray restore" in bentray(*command, "--data", tmp_path, code=2).stderr, command
    assert not (tmp_path / "bentray.sqlite").exists()


@pytest.mark.parametrize("tenant", ["user-" + "0" * 40, "project-0123456789abcdef0123"])
def test_the_tenant_of_a_user_or_project_has_no_keys(bentray: Run, tmp_path: Path, tenant: str) -> None:
    refused = bentray("keys", "create", "--name", "one", "--data", tmp_path, "--tenant", tenant, code=2)
    assert refused.stderr.count("\n") == 1
    assert "BENTRAY_OIDC_TENANTS" in refused.stderr
    assert not (tmp_path / GUARDED).exists()


def test_only_the_key_is_on_stdout(bentray: Run, tmp_path: Path) -> None:
    result = bentray("keys", "create", "--name", "one", "--data", tmp_path)
    assert ApiKey.from_text(result.stdout.removesuffix("\n")) is not None
    assert "not shown again" in result.stderr


def test_new_key_is_valid_in_a_running_service(
    bentray: Run, start: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bentray_service.access.sign_in.NO_KEYS_S", 0.0)
    http, data = start(), tmp_path / "data"
    assert http.get("/v1/access").json()["how"] == "open"
    key = made(bentray, data, "--tenant", "clinic")
    auth = {"Authorization": f"Bearer {key['key']}"}
    assert http.get("/v1/access").status_code == 401
    seen = http.get("/v1/access", headers=auth).json()
    assert (seen["tenant"], seen["who"], seen["bytes_stored"]) == ("clinic", key["id"], 0)
    assert seen["requests_per_minute"] == 1200
    assert http.get("/v1/datasets", headers=auth).status_code == 200
    bentray("keys", "revoke", key["id"], "--data", data)
    assert http.get("/v1/datasets", headers=auth).status_code == 401
    told = bentray("audit", "--data", data, "--tenant", "clinic", "--json")
    assert [(one["route"], one["who"]) for one in json.loads(told.stdout)] == [("/v1/datasets", key["id"])]
    assert json.loads(bentray("audit", "--data", data, "--since", "2999-01-01", "--json").stdout) == []
    assert "/v1/datasets" in bentray("audit", "--data", data, "--last", 1).stdout


def test_audit_of_an_empty_folder(bentray: Run, tmp_path: Path) -> None:
    for words, field in (((tmp_path / "gone",), "data_dir"), ((tmp_path, "--since", "today"), "since")):
        refused = bentray("audit", "--data", *words, code=2)
        assert refused.stderr.startswith(f"bentray: {field}: found ")
        made(bentray, tmp_path)
    assert json.loads(bentray("audit", "--data", tmp_path, "--json").stdout) == []

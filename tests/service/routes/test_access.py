"""GET of /v1/access/storage and /v1/access/keys: of the own tenant only, and never a secret."""

import time

from bentray_service.rows.ids import Tenant
from bentray_service.rows.keys import ApiKey, Keys

from ..conftest import HDF5, signed


def test_storage_by_kind_is_that_of_the_tenant(http, scan):
    mine, theirs = signed(http, "acme"), signed(http, "other")
    for headers in (mine, mine, theirs):
        answer = http.post("/v1/datasets", content=scan().read_bytes(), headers={**HDF5, **headers})
        assert answer.status_code == 201
    found = http.get("/v1/access/storage", headers=mine).json()
    whole = http.get("/v1/access", headers=mine).json()
    assert [(one["kind"], one["items"], one["reserved"]) for one in found["storage"]] == [("scans", 2, 0)]
    assert found["storage"][0]["stored"] == whole["bytes_stored"] > 0
    assert found["bytes_most"] == whole["bytes_most"]
    assert http.get("/v1/access/storage", headers=theirs).json()["storage"][0]["items"] == 1


def test_keys_are_listed_without_secrets(http):
    store, token = Keys(http.app.state.stores.database), ApiKey.new()
    store.add(token, Tenant("acme"), "scanner", ("read", "write"), time.time() + 3600.0)
    store.revoke(store.add(ApiKey.new(), Tenant("acme"), "old", ("read",)).id)
    theirs = signed(http, "other")["Authorization"].removeprefix("Bearer ")
    answer = http.get("/v1/access/keys", headers={"Authorization": f"Bearer {token.shown()}"})
    scanner, old = answer.json()["keys"]
    assert set(scanner) == {"id", "name", "scopes", "created", "expires", "revoked", "used"}
    assert (scanner["id"], scanner["name"], scanner["scopes"]) == (token.id, "scanner", ["read", "write"])
    assert scanner["revoked"] is None
    assert scanner["used"] is not None
    assert scanner["expires"] > scanner["created"]
    assert (old["name"], old["used"], old["expires"]) == ("old", None, None)
    assert old["revoked"] is not None
    for one in (token, ApiKey.from_text(theirs)):
        assert one.shown() not in answer.text
        assert one.digest() not in answer.text
    assert "other" not in answer.text


def test_without_keys_there_are_none(http):
    assert http.get("/v1/access/keys").json() == {"keys": []}

"""Keys: one form for owners, a digest in place of the secret in rows, and an end that holds at once."""

import time
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import select

from bentray_kernels.errors import InvalidInput
from bentray_service.rows.ids import LOCAL, Tenant
from bentray_service.rows.keys import USED_S, ApiKey, Keys
from bentray_service.rows.tables import KeyRow

ACME = Tenant("acme")


@pytest.fixture
def keys(database):
    return Keys(database)


def test_the_secret_is_nowhere(database, keys):
    token = ApiKey.new()
    assert not keys.any()
    keys.add(token, ACME, "one", ("read",))
    assert keys.any()
    with database.read() as connection:
        stored = str(connection.execute(select(KeyRow.__table__)).all())
    assert token.shown().rpartition("_")[2] not in stored
    assert keys.owner(token).tenant == ACME


def test_another_secret_under_the_same_id_is_none(keys):
    token = ApiKey.new()
    keys.add(token, ACME, "one", ("read",))
    assert keys.owner(ApiKey(token.id, ApiKey.new().shown()[-40:])) is None
    assert keys.owner(ApiKey.new()) is None
    with pytest.raises(InvalidInput, match="which exists"):
        keys.add(token, ACME, "again", ("read",))


def test_it_ends_when_it_expires_or_is_revoked(keys, monkeypatch):
    soon, never = ApiKey.new(), ApiKey.new()
    now = time.time()
    keys.add(soon, ACME, "soon", ("read",), now + 100.0)
    keys.add(never, LOCAL, "never", ("read",))
    assert [row.name for row in keys.all()] == ["soon", "never"]
    assert [row.name for row in keys.all(LOCAL)] == ["never"]
    monkeypatch.setattr("bentray_service.rows.keys.time", SimpleNamespace(time=lambda: now + 101.0))
    assert keys.owner(soon) is None
    assert keys.owner(never) is not None
    first = keys.revoke(never.id).revoked
    monkeypatch.setattr("bentray_service.rows.keys.time", SimpleNamespace(time=lambda: now + 200.0))
    assert keys.revoke(never.id).revoked == first
    assert keys.owner(never) is None
    with pytest.raises(InvalidInput, match="bentray keys list"):
        keys.revoke("0" * 12)


def test_its_last_use_is_known_to_the_minute(keys, monkeypatch):
    token, now = ApiKey.new(), time.time()
    keys.add(token, ACME, "one", ("read",))
    for later, expected in ((0.0, 0.0), (USED_S - 1.0, 0.0), (USED_S + 1.0, USED_S + 1.0)):
        monkeypatch.setattr("bentray_service.rows.keys.time", SimpleNamespace(time=lambda at=now + later: at))
        keys.owner(token)
        assert keys.all()[0].used == pytest.approx(now + expected, abs=1e-3)


def test_there_and_back():
    token = ApiKey.new()
    assert ApiKey.from_text(token.shown()) == token
    assert ApiKey.new().shown() != token.shown()
    secret = token.shown().rpartition("_")[2]
    assert len(secret) == 40
    assert secret not in f"{token} {token!r} {token.digest()}"


@given(st.text(max_size=80))
def test_rejects_invalid_keys(text):
    assert ApiKey.from_text(text) is None
    assert ApiKey.from_text(ApiKey.new().shown() + text[:1]) is None or not text


@pytest.mark.parametrize("spoil", [str.upper, lambda t: f"{t}\n", lambda t: t[:-1], lambda t: f" {t}"])
def test_a_slip_is_rejected_and_not_repeated(spoil):
    spoiled = spoil(ApiKey.new().shown())
    assert ApiKey.from_text(spoiled) is None
    with pytest.raises(InvalidInput) as refusal:
        ApiKey.given("key", spoiled)
    assert spoiled[-20:-2] not in str(refusal.value)

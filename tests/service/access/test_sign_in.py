"""Sign-in: open on loopback until the first key; then keys, and users named by a trusted proxy."""

import pytest
from starlette.datastructures import Headers

from bentray_kernels.errors import InvalidInput
from bentray_service.access.sign_in import SignIn
from bentray_service.errors import Forbidden, NotAuthenticated, RateLimited
from bentray_service.rows.accounts import Accounts
from bentray_service.rows.database import open_database
from bentray_service.rows.ids import LOCAL, Tenant
from bentray_service.rows.keys import ApiKey, Keys
from bentray_service.settings import ServiceSettings

NEAR, FAR = "127.0.0.1", "192.0.2.7"
PROXIED = {"trusted_proxies": f"{FAR},10.0.0.0/8"}


@pytest.fixture
def keys(tmp_path):
    database = open_database(f"sqlite:///{tmp_path / 'a.sqlite'}")
    yield Keys(database)
    database.close()


@pytest.fixture
def sign_in(keys, tmp_path):
    database = keys._database
    return lambda **settings: SignIn(
        ServiceSettings(data_dir=tmp_path, **settings), database, Accounts(database)
    )


def bearer(token):
    return Headers({"Authorization": f"Bearer {token.shown()}"})


def test_without_keys_everyone_on_this_machine_is_local(sign_in):
    caller = sign_in().caller(Headers({"host": "127.0.0.1:8000"}), NEAR)
    assert (caller.tenant, caller.how) == (LOCAL, "open")
    assert caller.scopes == {"read", "write", "metrics"}


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.1", "nowhere.invalid"])
def test_remote_clients_need_keys(sign_in, keys, host):
    with pytest.raises(InvalidInput, match=f"host: found {host}.*bentray keys create"):
        sign_in(host=host)
    sign_in(host=host, **PROXIED)
    # What a proxy forwards comes from elsewhere, though it listens on this machine.
    with pytest.raises(InvalidInput, match=r"found 127\.0\.0\.1 behind a proxy.*bentray keys create"):
        sign_in(behind_proxy="127.0.0.1")
    keys.add(ApiKey.new(), LOCAL, "one", ("read",))
    sign_in(host=host)


@pytest.mark.parametrize(
    "headers",
    [
        {"host": "evil.example:8000"},
        {"host": "localhost", "origin": "https://evil.example"},
        {"origin": "null"},
        {"host": "localhost", "x-forwarded-for": "192.0.2.1"},
        {"host": "localhost", "x-forwarded-for": "192.0.2.1, 127.0.0.1"},
        {"host": "localhost", "x-forwarded-for": "unknown"},
    ],
)
def test_cross_origin_requests_are_rejected(sign_in, headers):
    with pytest.raises(Forbidden):
        sign_in().caller(Headers(headers), NEAR)


@pytest.mark.parametrize("host", ["localhost", "LOCALHOST:80", "127.0.0.1", "127.8.9.1:1", "[::1]:8000"])
def test_names_of_this_machine(sign_in, host):
    headers = {"host": host, "origin": f"http://{host}", "x-forwarded-for": "127.0.0.1, ::1"}
    assert sign_in().caller(Headers(headers), NEAR).how == "open"


def test_first_key_closes_the_service(sign_in, keys, monkeypatch):
    monkeypatch.setattr("bentray_service.access.sign_in.NO_KEYS_S", 0.0)
    found, token = sign_in(), ApiKey.new()
    assert found.open()
    keys.add(token, Tenant("acme"), "one", ("read",))
    with pytest.raises(NotAuthenticated):
        found.caller(Headers({"host": "localhost"}), NEAR)
    caller = found.caller(bearer(token), FAR)
    assert (caller.tenant, caller.how, caller.who, caller.scopes) == ("acme", "key", token.id, {"read"})
    keys.revoke(token.id)
    for _ in range(2):
        with pytest.raises(NotAuthenticated, match="unknown, revoked or expired"):
            found.caller(bearer(token), FAR)
        with pytest.raises(NotAuthenticated):
            found.caller(Headers({"host": "localhost"}), NEAR)


def test_a_refusal_does_not_repeat_the_secret(sign_in, keys):
    keys.add(ApiKey.new(), LOCAL, "one", ("read",))
    wrong = ApiKey.new()
    for given in (wrong.shown(), wrong.shown()[:-1]):
        with pytest.raises(NotAuthenticated) as refusal:
            sign_in().caller(Headers({"Authorization": f"Bearer {given}"}), NEAR)
        assert given[-30:] not in str(refusal.value)


def test_user_header_is_accepted_only_from_trusted_proxies(sign_in):
    found, named = sign_in(**PROXIED), Headers({"X-Forwarded-User": "alice@example.org"})
    for address in (FAR, "10.1.2.3", "::ffff:10.1.2.3"):
        caller = found.caller(named, address)
        assert (caller.how, caller.who) == ("proxy", "alice@example.org")
        assert caller.tenant == found.caller(named, FAR).tenant != "alice@example.org"
        assert "metrics" not in caller.scopes
    for address in (NEAR, "192.0.2.8", "", "testclient"):
        with pytest.raises(NotAuthenticated):
            found.caller(named, address)


def test_a_user_is_never_the_tenant_of_a_key(sign_in, keys):
    token = ApiKey.new()
    keys.add(token, Tenant("acme"), "one", ("read",))
    found = sign_in(**PROXIED)
    assert found.caller(bearer(token), FAR).tenant == "acme"
    tenants = set()
    for user in (b"acme", b"local", b"ACME", b"acm\xc3\xa0", b"acm\xc3", b"acme\xa0", b"acme\x85"):
        tenants.add(found.caller(Headers(raw=[(b"x-forwarded-user", user)]), FAR).tenant)
    assert len(tenants - {"acme", LOCAL}) == 7


@pytest.mark.parametrize("users", [[], [""], ["  "], ["alice", "mallory"], ["a" * 201]])
def test_proxy_must_name_exactly_one_user(sign_in, users):
    raw = [(b"x-forwarded-user", user.encode()) for user in users]
    with pytest.raises(NotAuthenticated):
        sign_in(**PROXIED).caller(Headers(raw=raw), FAR)


def test_a_key_comes_through_a_proxy_too_and_another_bearer_is_the_proxys_own(sign_in, keys):
    found, token = sign_in(**PROXIED), ApiKey.new()
    keys.add(token, Tenant("acme"), "one", ("read",))
    assert found.caller(bearer(token), FAR).tenant == "acme"
    oidc = Headers({"Authorization": "Bearer eyJhbGciOi", "X-Forwarded-User": "alice"})
    assert found.caller(oidc, FAR).who == "alice"
    with pytest.raises(NotAuthenticated):
        found.caller(
            Headers({"Authorization": f"Bearer {ApiKey.new().shown()}", "X-Forwarded-User": "alice"}), FAR
        )


@pytest.mark.parametrize("proxies", ["proxy.example", "10.0.0.1/8", "10.0.0.0/33"])
def test_proxies_that_are_no_addresses(sign_in, proxies):
    with pytest.raises(InvalidInput, match="BENTRAY_TRUSTED_PROXIES"):
        sign_in(trusted_proxies=proxies)


def test_rates_are_of_a_tenant_and_not_at_an_open_door(sign_in, keys):
    found, callers = sign_in(requests_per_minute=2, renders_per_minute=1), []
    anyone = found.caller(Headers({}), NEAR)
    for _ in range(9):
        found.check(anyone, "GET", "/v1/jobs")
    for tenant in ("acme", "acme", "other"):
        token = ApiKey.new()
        keys.add(token, Tenant(tenant), "one", ("read",))
        callers.append(sign_in().caller(bearer(token), NEAR))
    found.check(callers[0], "GET", "/v1/jobs")
    found.check(callers[1], "GET", "/v1/jobs")
    with pytest.raises(RateLimited) as refusal:
        found.check(callers[0], "GET", "/v1/jobs")
    assert 0.0 < refusal.value.wait_s <= 30.0
    found.check(callers[2], "GET", "/v1/jobs")
    found.check_render(callers[0])
    with pytest.raises(RateLimited, match="renders"):
        found.check_render(callers[1])


def test_the_first_key_is_taken_once(sign_in, keys, tmp_path):
    token, path = ApiKey.new(), tmp_path / "key"
    path.write_text(token.shown() + "\n")
    for _ in range(2):
        found = sign_in(host="0.0.0.0", first_key_file=path)
        assert found.caller(bearer(token), FAR).scopes == {"read", "write", "metrics"}
    keys.revoke(token.id)
    with pytest.raises(NotAuthenticated):
        sign_in(host="0.0.0.0", first_key_file=path).caller(bearer(token), FAR)


@pytest.mark.parametrize("content", [None, b"", b"bentray_0_1", b"\xff\xfe"])
def test_a_first_key_that_is_none(sign_in, tmp_path, content):
    if content is not None:
        (tmp_path / "key").write_bytes(content)
    with pytest.raises(InvalidInput, match="BENTRAY_FIRST_KEY_FILE"):
        sign_in(first_key_file=tmp_path / "key")

"""Sign-in at a real OpenID provider: the way there and back, sessions, and responses that lie."""

import json
import time
from contextlib import contextmanager
from urllib.parse import parse_qs, urlencode, urlsplit

import pytest
from sqlalchemy import text

from bentray_kernels.errors import InvalidInput
from bentray_service.access import openid
from bentray_service.access.audit import entries
from bentray_service.app import create_app
from bentray_service.settings import ServiceSettings

from ..conftest import FakeCluster, TestClient
from .forged_tokens import (
    ACCEPTED,
    EXPIRED,
    FOREIGN,
    FORGED,
    MALFORMED,
    TOO_LARGE,
    another_key,
    coded,
    compact,
    edit,
    head,
)
from .openid import providing

# Of the provider, which uses names that Authlib will remove.
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")

USERS = {
    "alice": {"groups": ["/lab", "/all"], "roles": {"bentray": ["writer"]}, "email": "a@lab.example"},
    "bob": {"groups": ["/clinic"], "roles": {"bentray": ["viewer"]}},
    "mallory": {"groups": ["/elsewhere"]},
}
MAPPED = {
    "oidc_tenant_claim": "groups",
    "oidc_tenants": json.dumps({"/lab": "lab", "/clinic": "clinic"}),
    "oidc_role_claim": "roles.bentray",
    "oidc_roles": json.dumps({"writer": "read,write", "viewer": "read"}),
}
HOME = "http://localhost"
OWN = {"Origin": HOME}


@pytest.fixture(scope="module")
def provider():
    with providing(USERS) as made:
        yield made


@pytest.fixture(autouse=True)
def honest(provider):
    yield
    provider.tamper, provider.down, provider.keys = None, False, []
    provider.document, provider.user_info = {}, {}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("sessions")


@contextmanager
def started(folder, provider, **settings):
    secret = folder / "secret"
    secret.write_text("s3cret\n")
    given = {"public_url": HOME, "oidc_issuer": provider.issuer, "oidc_client_id": "bentray"}
    given |= {"oidc_client_secret_file": secret, "oidc_name": "the hospital", **MAPPED, **settings}
    app = create_app(ServiceSettings(data_dir=folder / "data", **given), FakeCluster())
    with TestClient(app, base_url=HOME, follow_redirects=False, raise_server_exceptions=False) as http:
        yield http


@pytest.fixture(scope="module")
def app(folder, provider):
    with started(folder, provider) as http:
        yield http


@pytest.fixture
def http(app, monkeypatch):
    """A browser without cookies."""
    app.cookies.clear()
    app.app.state.access.sign_in._sign_ins._buckets.clear()
    monkeypatch.setattr(openid, "ROTATION_S", 0.0)
    return app


def back(http, provider, user="alice", address="#/"):
    """Sign in at the provider; the address with which the browser comes back."""
    answer = http.get("/sign-in", params={"address": address})
    assert answer.status_code == 303, answer.text
    return provider.authorize(answer.headers["location"], user)


def signed_in(http, provider, user="alice", **how):
    answer = http.get(back(http, provider, user, **how))
    assert answer.status_code == 303, answer.text
    return answer


def refused(answer, status, *words):
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"].startswith("text/html")
    for word in words:
        assert word in answer.text
    assert "bentray=" not in answer.headers.get("set-cookie", "")


def test_the_way_to_the_provider_and_back(http, provider, folder):
    assert http.get("/v1/access").status_code == 401
    assert http.get("/sign-in/provider").json() == {"name": "the hospital"}
    asked = http.get("/sign-in", params={"address": "#/jobs?state=failed"})
    query = parse_qs(urlsplit(asked.headers["location"]).query)
    assert query["response_type"] == ["code"]
    assert query["redirect_uri"] == [f"{HOME}/sign-in/callback"]
    assert len(query["state"][0]) == len(query["nonce"][0]) == len(query["code_challenge"][0]) == 43
    assert len({query[name][0] for name in ("state", "nonce", "code_challenge")}) == 3
    answer = http.get(provider.authorize(asked.headers["location"], "alice"))
    assert (answer.status_code, answer.headers["location"]) == (303, f"{HOME}/#/jobs?state=failed")
    access = http.get("/v1/access").json()
    assert (access["tenant"], access["how"], access["who"]) == ("lab", "session", "alice")
    assert access["scopes"] == ["read", "write"]
    assert http.post("/v1/plans", json={}, headers=OWN).status_code == 422
    logged = [entry for entry in entries(folder / "data" / "audit") if entry["route"] == "/sign-in/callback"]
    assert (logged[-1]["tenant"], logged[-1]["how"], logged[-1]["who"]) == ("lab", "session", "alice")


def test_cookies_are_closed_to_scripts_and_other_sites(http, provider):
    cookies = signed_in(http, provider).headers.get_list("set-cookie")
    session = next(cookie for cookie in cookies if cookie.startswith("bentray="))
    assert {"Path=/", "HttpOnly", "SameSite=Strict", "Max-Age=43200"} <= set(session.split("; "))
    assert any(cookie.startswith("bentray-sign-in=;") and "Max-Age=0" in cookie for cookie in cookies)
    begun = http.get("/sign-in").headers["set-cookie"]
    assert {"HttpOnly", "SameSite=Lax", "Max-Age=600"} <= set(begun.split("; "))


def test_behind_tls_cookies_are_secure_and_of_this_host(tmp_path, provider):
    with started(tmp_path, provider, public_url="https://bentray.example.org") as http:
        answer = http.get("/sign-in")
        assert (
            "redirect_uri=https%3A%2F%2Fbentray.example.org%2Fsign-in%2Fcallback"
            in answer.headers["location"]
        )
        assert answer.headers["set-cookie"].startswith("__Host-bentray-sign-in=")
        assert answer.headers["set-cookie"].endswith("; Secure")


def test_changes_need_the_origin_of_the_page(http, provider):
    signed_in(http, provider)
    for headers in (
        {},
        {"Origin": "null"},
        {"Origin": "http://evil.example"},
        {"Origin": "http://localhost:81"},
    ):
        answer = http.post("/v1/plans", json={}, headers=headers)
        assert (answer.status_code, answer.json()["field"]) == (403, "Origin")
        assert http.post("/sign-out", headers=headers).status_code == 403
    assert http.get("/v1/access").status_code == 200


def test_roles_are_scopes(http, provider):
    signed_in(http, provider, "bob")
    assert http.get("/v1/access").json()["scopes"] == ["read"]
    answer = http.post("/v1/plans", json={}, headers=OWN)
    assert (answer.status_code, answer.json()["field"]) == (403, "scope")
    refused(http.get(back(http, provider, "mallory")), 403, "groups", "/elsewhere", "a group that may use")


def test_sign_out_ends_the_session_here_and_there(http, provider):
    signed_in(http, provider)
    cookie = http.cookies["bentray"]
    answer = http.post("/sign-out", headers=OWN)
    assert answer.json()["address"].startswith(f"{provider.issuer}/oauth2/end_session?client_id=bentray")
    assert "post_logout_redirect_uri=http%3A%2F%2Flocalhost%2F" in answer.json()["address"]
    assert "bentray" not in http.cookies
    http.cookies.set("bentray", cookie)
    assert http.get("/v1/access").status_code == 401


def test_a_sign_in_ends_the_session_before(http, provider):
    signed_in(http, provider)
    before = http.cookies["bentray"]
    signed_in(http, provider, "bob")
    assert http.get("/v1/access").json()["who"] == "bob"
    http.cookies.clear()
    http.cookies.set("bentray", before)
    assert http.get("/v1/access").status_code == 401


def test_sessions_expire_and_end_their_streams(http, provider):
    signed_in(http, provider)
    database = http.app.state.stores.database
    with http.stream("GET", "/v1/events", params={"seconds": 300}) as stream:
        assert stream.status_code == 200
        begun = time.monotonic()
        with database.write() as connection:
            connection.execute(text("UPDATE sessions SET expires = 1.0"))
        list(stream.iter_bytes())
        assert time.monotonic() - begun < 200.0
    assert http.get("/v1/access").status_code == 401


@pytest.mark.parametrize(
    "address", ["https://evil.example", "//evil.example", "/\\evil", "#/\r\nX: y", "#/<script>"]
)
def test_no_open_redirect(http, provider, address):
    assert signed_in(http, provider, address=address).headers["location"] == f"{HOME}/#/"


def test_a_response_counts_once_and_in_its_browser(http, provider):
    address = back(http, provider)
    cookie = http.cookies["bentray-sign-in"]
    http.cookies.clear()
    refused(http.get(address), 401, "of another browser")
    http.cookies.set("bentray-sign-in", cookie)
    # The attempt has used it up.
    refused(http.get(address), 401, "used")
    http.cookies.clear()
    address = back(http, provider)
    cookie = http.cookies["bentray-sign-in"]
    assert http.get(address).status_code == 303
    http.cookies.set("bentray-sign-in", cookie)
    refused(http.get(address), 401, "used")


def test_a_pending_sign_in_expires(http, provider):
    address = back(http, provider)
    with http.app.state.stores.database.write() as connection:
        connection.execute(text("UPDATE pending_sign_ins SET expires = 1.0"))
    refused(http.get(address), 401, "expired")


@pytest.mark.parametrize("change", [{"state": "x"}, {"iss": "http://evil.example"}, {"code": "other"}])
def test_a_changed_response_is_refused(http, provider, change):
    parts = urlsplit(back(http, provider))
    query = {name: values[0] for name, values in parse_qs(parts.query).items()}
    refused(http.get(f"{parts.path}?{urlencode({**query, **change})}"), 401, next(iter(change)))


def test_a_code_of_another_sign_in_fails_pkce(http, provider):
    stolen = parse_qs(urlsplit(back(http, provider)).query)["code"][0]
    parts = urlsplit(back(http, provider))
    state = parse_qs(parts.query)["state"][0]
    refused(http.get(f"{parts.path}?{urlencode({'code': stolen, 'state': state})}"), 401, "does not accept")


def test_a_user_may_decline(http, provider):
    refused(http.get(back(http, provider, user=None)), 401, "access_denied", "Sign in again")


LIES = FORGED | EXPIRED | FOREIGN | MALFORMED


@pytest.mark.parametrize("name", LIES)
def test_id_tokens_that_lie(http, provider, name):
    provider.tamper = LIES[name]
    refused(http.get(back(http, provider)), 401, "sign-in did not succeed")
    assert http.get("/v1/access").status_code == 401


@pytest.mark.parametrize("name", ACCEPTED)
def test_id_tokens_that_do_not(http, provider, name):
    provider.tamper = ACCEPTED[name]
    signed_in(http, provider)
    assert http.get("/v1/access").json()["who"] == "alice"


@pytest.mark.parametrize(
    "wrong", [{"use": "enc"}, {"key_ops": ["encrypt"]}, {"key_ops": ["wrapKey"]}, {"alg": "RSA-OAEP"}]
)
def test_keys_of_another_use_do_not_sign(http, provider, wrong):
    published = {**another_key().as_dict(private=False), **wrong}
    provider.keys = [published]
    provider.tamper = lambda claims, header, key: compact({**header, "kid": "another"}, claims, another_key())
    refused(http.get(back(http, provider)), 401, "ID token")
    provider.keys = [{"kty": "oct", "k": coded(b"known to all" * 4), "kid": "another"}]
    provider.tamper = lambda claims, header, key: compact(
        {"alg": "HS256", "kid": "another"}, claims, key, b"known to all" * 4
    )
    refused(http.get(back(http, provider)), 401, "ID token")


def test_a_token_without_end(http, provider):
    provider.tamper = TOO_LARGE
    refused(http.get(back(http, provider)), 503, "more than 1048576 bytes")


def test_a_token_of_before_does_not_count(http, provider):
    kept = []
    provider.tamper = lambda claims, header, key: kept.append(compact(header, claims, key))
    signed_in(http, provider)
    http.cookies.clear()
    provider.tamper = lambda claims, header, key: kept[0]
    refused(http.get(back(http, provider)), 401, "nonce")


def test_an_address_and_its_verification_come_from_one_source(tmp_path, provider):
    provider.user_info = {"email": "a@lab.example", "email_verified": True}
    with started(tmp_path, provider, oidc_user_claim="email") as http:
        for claims, status in (
            ({"email": "a@lab.example"}, 303),
            ({"email": "a@lab.example", "email_verified": True}, 303),
            ({"email": "a@lab.example", "email_verified": "true"}, 403),
            ({"email": "a@lab.example", "email_verified": False}, 403),
            # What is verified is the address in the user info.
            ({"email": "boss@lab.example"}, 303),
        ):
            http.cookies.clear()
            provider.tamper = edit(**claims)
            assert http.get(back(http, provider)).status_code == status, claims
            if status == 303:
                assert http.get("/v1/access").json()["who"] == "a@lab.example"


def test_keys_rotate(http, provider, monkeypatch):
    signed_in(http, provider)
    provider.rotate()
    signed_in(http, provider)
    # Invented keys do not make the service ask without end.
    monkeypatch.setattr(openid, "ROTATION_S", 30.0)
    provider.tamper = head(kid="invented")
    before = provider.requests.count("/jwks")
    for _ in range(3):
        refused(http.get(back(http, provider)), 401, "ID token")
    assert provider.requests.count("/jwks") == before


def test_claims_that_only_the_user_info_has(http, provider):
    provider.tamper = edit(groups=None)
    signed_in(http, provider)
    assert http.get("/v1/access").json()["tenant"] == "lab"
    provider.user_info = {"sub": "bob"}
    refused(http.get(back(http, provider)), 401, "another user")


def test_a_provider_that_is_away(tmp_path, provider):
    with started(tmp_path, provider) as http:
        provider.down = True
        answer = http.get("/sign-in")
        assert (answer.status_code, answer.json()["field"]) == (503, "OpenID provider")
        assert "Retry-After" in answer.headers
        provider.down, provider.document = False, {"issuer": "http://evil.example"}
        assert http.get("/sign-in").status_code == 503
        provider.document = {"token_endpoint": "http://evil.example/token"}
        assert "token_endpoint" in http.get("/sign-in").json()["detail"]
        provider.document = {}
        address = back(http, provider)
        provider.down = True
        refused(http.get(address), 503, "status 503")


def test_sign_ins_of_one_address_are_limited(http, monkeypatch):
    monkeypatch.setattr(http.app.state.access.sign_in._sign_ins, "_clock", lambda: 0.0)
    answers = [http.get("/sign-in").status_code for _ in range(61)]
    assert set(answers[:-1]) == {303}
    assert answers[-1] == 429


def test_without_a_provider_there_is_none(start):
    http = start()
    assert http.get("/sign-in/provider").json() == {"name": None}
    assert http.get("/sign-in").json()["title"] == "No sign-in"


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"public_url": None}, "BENTRAY_PUBLIC_URL"),
        ({"public_url": "http://bentray.example.org"}, "BENTRAY_PUBLIC_URL"),
        ({"oidc_issuer": "http://id.example.org"}, "BENTRAY_OIDC_ISSUER"),
        ({"oidc_client_id": None}, "BENTRAY_OIDC_CLIENT_ID"),
        ({"oidc_client_secret_file": "/nowhere"}, "BENTRAY_OIDC_CLIENT_SECRET_FILE"),
        ({"oidc_tenant_claim": None}, "BENTRAY_OIDC_TENANT_CLAIM"),
        ({"oidc_role_claim": None}, "BENTRAY_OIDC_ROLE_CLAIM"),
        ({"oidc_tenants": '{"/lab": "../lab"}'}, "BENTRAY_OIDC_TENANTS"),
        ({"oidc_roles": '{"writer": "everything"}'}, "BENTRAY_OIDC_ROLES"),
    ],
)
def test_settings_that_do_not_fit(tmp_path, provider, change, field):
    with pytest.raises(InvalidInput, match=f"^{field}:"), started(tmp_path, provider, **change):
        pass


def test_tables_are_json_in_the_environment(monkeypatch):
    monkeypatch.setenv("BENTRAY_OIDC_TENANTS", '{"cn=lab,ou=groups": "lab"}')
    assert ServiceSettings.load().oidc_tenants == {"cn=lab,ou=groups": "lab"}
    monkeypatch.setenv("BENTRAY_OIDC_TENANTS", "lab")
    with pytest.raises(InvalidInput, match="BENTRAY_OIDC_TENANTS"):
        ServiceSettings.load()

"""Proxies and certificates of the environment: which request goes where, and what is said when it cannot."""

import socket
import threading
from contextlib import contextmanager

import anyio
import httpx
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_service.access.openid import Provider
from bentray_service.client import AsyncClient, Client, ClientError
from bentray_service.errors import ProviderUnavailable
from bentray_service.settings import ServiceSettings
from bentray_service.web.outbound import certificates, proxy_for
from bentray_service.webhooks.receiver import post

FAR = "http://usct.example.invalid:8000"
P = "http://proxy:3128"


@pytest.fixture(autouse=True)
def environment(monkeypatch):
    """Set the variables of a test; all others of this kind are away."""
    for kind in ("http", "https", "all", "no"):
        monkeypatch.delenv(f"{kind}_proxy", raising=False)
        monkeypatch.delenv(f"{kind}_PROXY".upper(), raising=False)
    for name in ("SSL_CERT_FILE", "SSL_CERT_DIR", "REQUEST_METHOD"):
        monkeypatch.delenv(name, raising=False)
    return lambda **variables: [monkeypatch.setenv(name, value) for name, value in variables.items()]


@contextmanager
def listening(answer):
    """A server on loopback that keeps the first bytes of each connection; yields its port and them."""
    seen = []
    server = socket.create_server(("127.0.0.1", 0))

    def accept():
        while True:
            try:
                peer, _ = server.accept()
            except OSError:
                return
            seen.append(peer.recv(300))
            peer.sendall(answer)
            peer.close()

    thread = threading.Thread(target=accept, daemon=True)
    thread.start()
    yield server.getsockname()[1], seen
    server.shutdown(socket.SHUT_RDWR)
    server.close()
    thread.join(5.0)


@pytest.mark.parametrize(
    ("variables", "url", "used"),
    [
        ({"http_proxy": P}, "http://far/", P),
        ({"HTTP_PROXY": P}, "http://far/", P),
        ({"http_proxy": P}, "https://far/", None),
        ({"HTTPS_PROXY": P, "ALL_PROXY": "http://other"}, "https://far/", P),
        ({"ALL_PROXY": P}, "https://far/", P),
        # The lower-case name takes precedence, also if it is empty.
        ({"https_proxy": P, "HTTPS_PROXY": "http://other"}, "https://far/", P),
        ({"https_proxy": "", "HTTPS_PROXY": P}, "https://far/", None),
        ({"HTTPS_PROXY": ""}, "https://far/", None),
        ({"HTTPS_PROXY": "proxy:3128"}, "https://far/", P),
        ({"HTTPS_PROXY": f" {P} "}, "https://far/", P),
        # The header Proxy of a request to a CGI script is this variable there.
        ({"HTTP_PROXY": P, "REQUEST_METHOD": "GET"}, "http://far/", None),
        *(
            ({"ALL_PROXY": P}, f"http://{host}:8000/", None)
            for host in ("127.0.0.1", "127.9.9.9", "127.1", "[::1]", "[::ffff:127.0.0.1]", "localhost")
        ),
        *(
            ({"ALL_PROXY": P}, f"http://{host}:8000/", None)
            for host in ("LOCALHOST.", "usct.localhost", "0.0.0.0", "[::]")
        ),
        ({"ALL_PROXY": P}, "http://localhost.example.org/", P),
    ],
)
def test_proxy_of_an_address(environment, variables, url, used):
    environment(**variables)
    proxy = proxy_for(httpx.URL(url))
    assert (proxy and str(proxy.url)) == used


@pytest.mark.parametrize(
    ("exceptions", "direct", "through"),
    [
        ("*", "far.example.org", None),
        ("example.org", "example.org far.example.org FAR.Example.ORG far.example.org.", "notexample.org"),
        (".example.org", "example.org far.example.org", "example.com"),
        ("*.example.org", "far.example.org", "far.example.com"),
        ("10.0.0.0/8", "10.1.2.3", "11.1.2.3"),
        ("10.0.0.0/8", "[::ffff:10.1.2.3]", "ten.example.org"),
        ("10.0.0.9/8", "10.1.2.3", "11.0.0.9"),
        ("10.*", "10.1.2.3", "11.1.2.3"),
        ("fd00::/8", "[fd12::1]", "[fe00::1]"),
        ("192.168.7.7", "192.168.7.7", "192.168.7.8"),
        ("[2001:db8::7]", "[2001:db8::7]", "[2001:db8::8]"),
        ("2001:DB8:0::7", "[2001:db8::7]", "[2001:db8::8]"),
        ("far.example.org:80", "far.example.org", "far.example.org:8000"),
        ("[2001:db8::7]:8000", "[2001:db8::7]:8000", "[2001:db8::7]"),
        ("one.org, two.org three.org,", "one.org two.org three.org", "four.org"),
        ("", None, "far.example.org"),
    ],
)
def test_exceptions(environment, exceptions, direct, through):
    environment(ALL_PROXY=P, NO_PROXY=exceptions)
    for host in (direct or "").split():
        assert proxy_for(httpx.URL(f"http://{host}/")) is None
    for host in (through or "").split():
        assert proxy_for(httpx.URL(f"http://{host}/")).variable == "ALL_PROXY"


@pytest.mark.parametrize(
    ("variables", "named", "value"),
    [
        ({"HTTP_PROXY": "socks4://proxy:1080"}, "HTTP_PROXY", "socks4://proxy:1080"),
        ({"all_proxy": "socks://proxy:1080"}, "all_proxy", "socks://proxy:1080"),
        ({"http_proxy": "http://"}, "http_proxy", "http://"),
        ({"http_proxy": "http://proxy:99999"}, "http_proxy", "http://proxy:99999"),
        ({"http_proxy": "ftp://me:secret@proxy"}, "http_proxy", "'proxy'"),
        ({"http_proxy": P, "NO_PROXY": "10.0.0.0/99"}, "NO_PROXY", "10.0.0.0/99"),
        ({"http_proxy": P, "no_proxy": "http://far"}, "no_proxy", "http://far"),
    ],
)
def test_what_cannot_be_understood_is_named(environment, variables, named, value):
    environment(**variables)
    with pytest.raises(InvalidInput) as refused, Client(FAR) as client:
        client.jobs()
    assert refused.value.field == named
    assert value in refused.value.value
    assert "secret" not in str(refused.value)
    # A service of this machine needs none of them.
    with pytest.raises(ClientError, match="no answer"), Client("http://127.0.0.1:9") as client:
        client.jobs()


REFUSAL = b"HTTP/1.1 502 Bad Gateway\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"


@pytest.mark.parametrize(
    ("scheme", "variable", "kind", "answer", "seen"),
    [
        ("http", "HTTP_PROXY", "http", REFUSAL, b"GET http://usct.example.invalid:8000/v1/jobs"),
        ("https", "HTTPS_PROXY", "http", REFUSAL, b"CONNECT usct.example.invalid:8000"),
        # SOCKS 5: one method, no authentication; nothing acceptable.
        ("http", "ALL_PROXY", "socks5", b"\x05\xff", b"\x05\x01\x00"),
        ("https", "all_proxy", "socks5h", b"\x05\xff", b"\x05\x01\x00"),
    ],
)
def test_client_uses_the_proxy_and_names_it(environment, scheme, variable, kind, answer, seen):
    url = FAR.replace("http", scheme)

    async def ask():
        async with AsyncClient(url) as client:
            await client.jobs()

    with listening(answer) as (port, connections):
        environment(**{variable: f"{kind}://me:secret@127.0.0.1:{port}"})
        if kind != "http":
            environment(**{variable: f"{kind}://127.0.0.1:{port}"})
        with pytest.raises(ClientError) as plain, Client(url) as client:
            client.jobs()
        with pytest.raises(ClientError) as with_await:
            anyio.run(ask)
    assert [connection.startswith(seen) for connection in connections] == [True, True]
    for error in (plain, with_await):
        assert f"through the proxy {kind}://127.0.0.1:{port} ({variable})" in str(error.value)
        assert "secret" not in str(error.value)


def test_a_proxy_that_is_away_is_named(environment):
    environment(ALL_PROXY="http://127.0.0.1:9")
    words = r"through the proxy http://127.0.0.1:9 \(ALL_PROXY\): .*refused$"
    with pytest.raises(ClientError, match=words), Client(FAR) as client:
        client.jobs()


@pytest.fixture
def bad_files(tmp_path):
    (tmp_path / "text.pem").write_text("no certificate\n")
    return {"away": str(tmp_path / "away.pem"), "text": str(tmp_path / "text.pem"), "folder": str(tmp_path)}


@pytest.mark.parametrize(
    ("variable", "which", "reason"),
    [
        ("SSL_CERT_FILE", "away", "No such file"),
        ("SSL_CERT_FILE", "text", "no certificate in it"),
        ("SSL_CERT_FILE", "folder", "Is a directory"),
        ("SSL_CERT_DIR", "away", "no such folder"),
    ],
)
def test_certificates_that_are_away_are_named(environment, bad_files, variable, which, reason):
    environment(**{variable: bad_files[which]})
    with pytest.raises(InvalidInput, match=reason) as refused, Client("https://127.0.0.1:9") as client:
        client.jobs()
    assert (refused.value.field, bad_files[which] in refused.value.value) == (variable, True)
    # Without TLS nobody needs them.
    with pytest.raises(ClientError, match="no answer"), Client("http://127.0.0.1:9") as client:
        client.jobs()
    issuer = {"oidc_issuer": "https://127.0.0.1:9", "oidc_client_id": "bentray"}
    with pytest.raises(InvalidInput, match=variable):
        Provider(ServiceSettings.load(**issuer))


def test_usual_certificates():
    assert certificates().cert_store_stats()["x509_ca"] > 50


def provider(issuer):
    return Provider(ServiceSettings.load(oidc_issuer=issuer, oidc_client_id="bentray"))


def test_sign_in_uses_the_proxy_and_names_it_to_the_operator(environment, caplog):
    with listening(REFUSAL) as (port, connections):
        environment(https_proxy=f"http://127.0.0.1:{port}")
        with pytest.raises(ProviderUnavailable) as unavailable:
            provider("https://id.example.invalid").logout_url("/")
    assert connections[0].startswith(b"CONNECT id.example.invalid:443")
    assert f"through the proxy http://127.0.0.1:{port} (https_proxy): 502" in caplog.text
    assert str(port) not in str(unavailable.value)
    environment(https_proxy="socks4://proxy")
    with pytest.raises(InvalidInput, match="https_proxy: found"):
        provider("https://id.example.invalid")


def test_webhooks_do_not_use_the_proxy_and_say_so(environment, monkeypatch, bad_files):
    def away(*_, **__):
        return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", ("203.0.113.7", 443))]

    def connect(*_):
        raise OSError(101, "Network is unreachable")

    monkeypatch.setattr("bentray_service.webhooks.receiver._is_permitted", lambda *_: True)
    monkeypatch.setattr(socket, "getaddrinfo", away)
    monkeypatch.setattr(socket.socket, "connect", connect)
    with listening(REFUSAL) as (port, connections):
        environment(HTTPS_PROXY=f"http://127.0.0.1:{port}")
        outcome = post("https://hooks.example.org/", {}, b"{}", ())
    assert outcome.error == "no answer: Network is unreachable (webhooks do not use HTTPS_PROXY)"
    assert connections == []
    monkeypatch.setattr(socket.socket, "connect", lambda *_: None)
    environment(SSL_CERT_FILE=bad_files["away"])
    outcome = post("https://hooks.example.org/", {}, b"{}", ())
    assert outcome.error == "no answer: this service cannot use its SSL_CERT_FILE"

"""Which addresses webhooks may reach, and what a request to one does."""

import datetime as dt
import ipaddress
import socket
import ssl
from ipaddress import ip_network

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec

from bentray_kernels.errors import InvalidInput
from bentray_service.webhooks import receiver as module
from bentray_service.webhooks.receiver import check_url, post

from .local_receiver import Receiver

LOOPBACK = (ip_network("127.0.0.0/8"),)


@pytest.mark.parametrize(
    "url",
    [
        *("https://127.0.0.1/", "https://localhost.:0/", "https://10.1.2.3/x", "https://192.168.0.1/"),
        *("https://172.16.9.9/", "https://169.254.169.254/latest/meta-data", "https://100.64.0.1/"),
        *("https://0.0.0.0/", "https://255.255.255.255/", "https://224.0.0.1/", "https://198.18.0.1/"),
        *(
            "https://[::1]/",
            "https://[::]/",
            "https://[fe80::1]/",
            "https://[fc00::1]/",
            "https://[ff02::1]/",
        ),
        *("https://[::ffff:127.0.0.1]/", "https://[64:ff9b::10.0.0.1]/", "https://[2002:7f00:1::1]/"),
        # The registries of special-purpose addresses, also what is in the last 32 bits of NAT64.
        *("https://192.0.0.9/", "https://192.0.0.192/", "https://192.0.2.1/", "https://192.31.196.1/"),
        *("https://192.52.193.1/", "https://192.88.99.1/", "https://192.175.48.1/", "https://240.0.0.1/"),
        *("https://198.51.100.1/", "https://203.0.113.1/", "https://168.63.129.16/"),
        *(
            "https://[3fff::1]/",
            "https://[2620:4f:8000::1]/",
            "https://[5f00::1]/",
            "https://[100:0:0:1::1]/",
        ),
        *("https://[2001::1]/", "https://[2001:1::1]/", "https://[2001:4:112::1]/", "https://[2001:20::1]/"),
        *("https://[2002:5db8:d822::1]/", "https://[64:ff9b::c058:6301]/", "https://[64:ff9b:1::1]/"),
        *("https://[::127.0.0.1]/", "https://[2001:db8::1]/", "https://[fec0::1]/", "https://[100::1]/"),
        *(
            "http://example.org/",
            "http://93.184.216.34/",
            "ftp://example.org/",
            "https:///path",
            "example.org",
        ),
        *("https://user@example.org/", "https://user:word@example.org/", "https://example.org/#part"),
        *("https://example.org:70000/", "https://exa mple.org/", "https://example.org/\r\nHost: other", ""),
        *(
            "https://[::1",
            "https://example.org/" + "a" * 2000,
            "https://bücher.example/",
            "file:///etc/passwd",
        ),
    ],
)
def test_refused_addresses(url):
    with pytest.raises(InvalidInput, match=r"^webhook: "):
        check_url(url, ())


@pytest.mark.parametrize(
    "url",
    [
        *("https://example.org/hook", "https://example.org:8443/a?b=c&d", "https://93.184.216.34/"),
        *("https://[2606:2800:220:1::1]:443/x", "https://[64:ff9b::5db8:d822]/"),
    ],
)
def test_accepted_addresses(url):
    check_url(url, ())


def test_networks_permit_more():
    check_url("http://127.0.0.1:8080/", LOOPBACK)
    check_url("https://[::ffff:127.0.0.1]/", LOOPBACK)
    for url in ("http://10.0.0.1/", "https://10.0.0.1/", "http://93.184.216.34/"):
        with pytest.raises(InvalidInput):
            check_url(url, LOOPBACK)


def test_a_message_arrives_as_it_is(receiver):
    outcome = post(receiver.url, {"webhook-id": "msg-1"}, b'{"a":1}', LOOPBACK)
    assert (outcome.status, outcome.error) == (200, "")
    headers, body = receiver.messages[0]
    assert body == b'{"a":1}'
    assert headers["webhook-id"] == "msg-1"
    assert headers["host"] == f"127.0.0.1:{receiver.port}"


def test_redirects_are_not_followed(receiver):
    other = Receiver()
    for status in (301, 302, 303, 307, 308):
        receiver.answers, receiver.location = [status], other.url
        outcome = post(receiver.url, {}, b"{}", LOOPBACK)
        assert (outcome.status, outcome.error) == (status, "redirects are not followed")
    assert other.messages == []
    other.close()


def resolving(monkeypatch, *answers):
    """The name service gives these addresses, one list after another; returns the names asked for."""
    asked, left = [], list(answers)

    def resolve(host, port, **how):
        asked.append(host)
        result = left.pop(0)
        kinds = {4: socket.AF_INET, 6: socket.AF_INET6}
        return [
            (kinds[ipaddress.ip_address(address).version], socket.SOCK_STREAM, 6, "", (address, port))
            for address in result
        ]

    monkeypatch.setattr(socket, "getaddrinfo", resolve)
    return asked


def test_a_name_of_the_inner_network_is_refused_without_showing_it(receiver, monkeypatch):
    for address in ("127.0.0.1", "10.0.0.1", "169.254.169.254", "::1", "fe80::1"):
        resolving(monkeypatch, [address])
        outcome = post(f"https://public.example:{receiver.port}/", {}, b"{}", ())
        assert outcome.status is None
        assert "without a permitted address" in outcome.error
        assert address not in outcome.error
    assert receiver.messages == []


def test_a_name_that_changes_is_resolved_once(receiver, monkeypatch):
    """DNS rebinding: the second answer would be an address that is not permitted."""
    asked = resolving(monkeypatch, ["10.9.9.9", "127.0.0.1"], ["10.9.9.9"])
    outcome = post(f"http://rebound.example:{receiver.port}/x", {}, b"{}", LOOPBACK)
    assert (outcome.status, outcome.error) == (200, "")
    assert asked == ["rebound.example"]
    assert receiver.messages[0][0]["host"] == f"rebound.example:{receiver.port}"


def test_unknown_name_and_closed_port(receiver, monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as closed:
        port = closed.getsockname()[1]
    assert post(f"http://127.0.0.1:{port}/", {}, b"{}", LOOPBACK).error == "no answer: Connection refused"

    def unknown(*_, **__):
        raise socket.gaierror(-2, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", unknown)
    assert "not known" in post("https://nobody.example/", {}, b"{}", ()).error


ENDLESS = {
    "silent": [],
    "a reason for ever": [b"HTTP/1.1 200 O", b"K"],
    "silent after the status": [b"HTTP/1.1 200 OK\r\n", b""],
    "headers for ever": [b"HTTP/1.1 200 OK\r\n", b"A: b\r\n"],
    "a header for ever": [b"HTTP/1.1 200 OK\r\nA: ", b"b"],
    "interim responses for ever": [b"HTTP/1.1 103 Early Hints\r\n\r\n"],
}


@pytest.mark.parametrize("pieces", ENDLESS.values(), ids=ENDLESS)
def test_a_receiver_without_end_fails_in_time(receiver, pieces, monkeypatch):
    """The last piece is repeated. A closed connection would be taken for the end of the headers."""
    monkeypatch.setattr(module, "EXCHANGE_S", 0.3)
    if not pieces:
        receiver.hold.clear()
    receiver.raw, receiver.pause_s = pieces, 0.02
    outcome = post(receiver.url, {}, b"{}", LOOPBACK)
    assert (outcome.status, outcome.error) == (None, "no answer within 0.3 s")
    assert 0.2 < outcome.seconds < 5.0


@pytest.mark.parametrize(
    ("pieces", "error"),
    [
        ([b"HTTP/1.1 200 OK\r\nA: b\r\n", None], "no answer: the connection was closed"),
        ([b"HTTP/1.1 200 OK\r\n", b"A: " + b"b" * 10000], "no answer: more than 65536 bytes of headers"),
        ([b"220 mail.example ready\r\n\r\n", None], "no answer: no response of HTTP"),
        ([b"HTTP/1.1 100 Continue\r\n\r\nHTTP/1.1 204 No Content\r\n\r\n", None], ""),
    ],
)
def test_an_answer_is_a_whole_response(receiver, pieces, error):
    receiver.raw = pieces
    assert post(receiver.url, {}, b"{}", LOOPBACK).error == error


def test_certificates_are_checked_for_the_name(monkeypatch, tmp_path):
    certificate, key = _certificate(tmp_path, "hook.example")
    serving = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    serving.load_cert_chain(certificate, key)
    receiver = Receiver(serving)
    trusting = ssl.create_default_context(cafile=certificate)
    for name, context, expected in (
        ("hook.example", trusting, ""),
        ("other.example", trusting, "the certificate is not valid: Hostname mismatch"),
        ("hook.example", ssl.create_default_context(), "the certificate is not valid: self-signed"),
    ):
        monkeypatch.setattr(module, "certificates", lambda context=context: context)
        with monkeypatch.context() as names:
            resolving(names, ["127.0.0.1"])
            outcome = post(f"https://{name}:{receiver.port}/", {}, b"{}", LOOPBACK)
        assert outcome.error.startswith(expected)
        assert (outcome.error == "") == (expected == "")
    assert len(receiver.messages) == 1
    receiver.close()


def _certificate(folder, name):
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
    now = dt.datetime.now(dt.UTC)
    made = (
        x509.CertificateBuilder(subject, subject, key.public_key(), x509.random_serial_number())
        .not_valid_before(now - dt.timedelta(days=1))
        .not_valid_after(now + dt.timedelta(days=1))
        .add_extension(x509.SubjectAlternativeName([x509.DNSName(name)]), critical=False)
        .add_extension(x509.BasicConstraints(ca=True, path_length=None), critical=True)
        .sign(key, hashes.SHA256())
    )
    (folder / "certificate.pem").write_bytes(made.public_bytes(serialization.Encoding.PEM))
    kinds = serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    (folder / "key.pem").write_bytes(key.private_bytes(*kinds))
    return str(folder / "certificate.pem"), str(folder / "key.pem")

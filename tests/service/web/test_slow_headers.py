"""Request headers: bounded in time and size; running responses continue; no request smuggling."""

import asyncio
import json
import time

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_service.web import slow_headers
from bentray_service.web.errors import problem_response

from .speaking import connected, read_answer, read_to_end, served

REQUEST = b"GET / HTTP/1.1\r\nHost: here\r\n\r\n"


@pytest.fixture
def server(monkeypatch, request):
    """Waits for a head for 0.3 s or the marked time, and answers 0.3 s after that."""
    head_s = getattr(request, "param", 0.3)
    monkeypatch.setattr(slow_headers, "HEAD_S", head_s)

    async def app(scope, receive, send):
        await asyncio.sleep(head_s + 0.3)
        await send({"type": "http.response.start", "status": 204, "headers": []})
        await send({"type": "http.response.body"})

    with served(app) as found:
        yield found


@pytest.fixture
def telling():
    """Answers with what it was asked, once it has all of it."""

    async def app(scope, receive, send):
        body, more = b"", True
        while more:
            try:
                message = await receive()
            except InvalidInput as error:
                await problem_response(error, scope["path"])(scope, receive, send)
                return
            body, more = body + message["body"], message["more_body"]
        names = [name.decode() for name, _ in scope["headers"]]
        told = json.dumps([scope["method"], scope["path"], names, body.decode()]).encode()
        length = str(len(told)).encode()
        await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", length)]})
        await send({"type": "http.response.body", "body": told})

    with served(app) as found:
        yield found


def told(connection):
    status, body = read_answer(connection)
    return status, json.loads(body)


@pytest.mark.parametrize("sent", [b"", b"GET", REQUEST[:-2]])
def test_a_head_that_does_not_come_is_not_waited_for(server, sent):
    with connected(server) as connection:
        connection.sendall(sent)
        assert connection.recv(100) == b""


# Long enough for this process to send its next request, on a machine under load.
@pytest.mark.parametrize("server", [1.0], indirect=True)
def test_timeout_applies_to_headers_only(server):
    with connected(server) as connection:
        for _ in range(2):
            connection.sendall(REQUEST)
            assert connection.recv(1000).startswith(b"HTTP/1.1 204")
        connection.sendall(REQUEST[:10])
        assert connection.recv(100) == b""


def test_a_head_in_parts_is_one(telling):
    with connected(telling) as connection:
        for part in (REQUEST[:7], REQUEST[7:20], REQUEST[20:]):
            connection.sendall(part)
            time.sleep(0.02)
        assert told(connection) == (200, ["GET", "/", ["host"], ""])


@pytest.mark.parametrize(
    ("sent", "status", "slug"),
    [
        (b"GET / HTTP/1.1\r\nHost: here\r\nA: " + 150_000 * b"a", 431, "head-too-large"),
        (b"GET /" + 200_000 * b"a", 431, "head-too-large"),
        (b"GET / HTTP/1.1\r\nHost: here\r\n" + 8_000 * b"A: b\r\n" + b"\r\n", 200, None),
        (b"GET / HTTP/1.1\r\nHost: here\r\n" + 20_000 * b"A: b\r\n" + b"\r\n", 431, "head-too-large"),
        (b"GET / HTTP/1.1\r\n\r\n", 400, "malformed-request"),
        (b"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n", 400, "malformed-request"),
        (b"GET / HTTP/1.1\r\nHost : a\r\n\r\n", 400, "malformed-request"),
        (b"\x16\x03\x01\x02\x00", 400, "malformed-request"),
        (b"CONNECT here:443 HTTP/1.1\r\nHost: here\r\n\r\n", 501, "unknown-method"),
        (b"BREW /pot HTTP/1.1\r\nHost: here\r\n\r\n", 501, "unknown-method"),
        (b"get / HTTP/1.1\r\nHost: here\r\n\r\n", 501, "unknown-method"),
        (b"PLAY / HTTP/1.1\r\nHost: here\r\n\r\n", 501, "unknown-method"),
        (b"BREW /pot\r\n\r\n", 400, "malformed-request"),
        (b"GE\x00T / HTTP/1.1\r\nHost: here\r\n\r\n", 400, "malformed-request"),
        (REQUEST[:-2] + b"Content-Length: 1\r\nTransfer-Encoding: chunked\r\n\r\n", 400, "malformed-request"),
    ],
)
def test_invalid_headers_get_a_problem_response(telling, sent, status, slug):
    with connected(telling) as connection:
        connection.sendall(sent)
        found, body = told(connection)
        assert found == status
        if slug is not None:
            assert body["type"] == f"/problems/{slug}"
            assert read_to_end(connection) == b""


def test_a_body_that_looks_like_a_request_is_a_body(telling):
    with connected(telling) as connection:
        connection.sendall(REQUEST.replace(b"GET", b"POST")[:-2] + b"Transfer-Encoding: chunked\r\n\r\n")
        time.sleep(0.05)
        connection.sendall(b"BREW /pot HTTP/1.1\r\n\r\n")
        # It is no chunk; the request is being answered and finds its body broken off.
        assert b" 501 " not in read_to_end(connection)


def test_what_follows_a_body_is_no_header(telling):
    # A proxy strips its own headers from the head, not from here.
    chunked = b"POST / HTTP/1.1\r\nHost: here\r\nTransfer-Encoding: chunked\r\n\r\n1\r\nx\r\n0\r\n"
    with connected(telling) as connection:
        connection.sendall(chunked + b"X-Forwarded-User: root\r\n\r\n")
        assert told(connection) == (200, ["POST", "/", ["host", "transfer-encoding"], "x"])
        connection.sendall(chunked + 30_000 * b"A: b\r\n" + b"\r\n")
        assert told(connection)[0] == 431


@pytest.mark.parametrize("length", [b"Content-Length: 16", b"Transfer-Encoding: chunked"])
def test_a_wish_for_another_protocol_hides_no_request(telling, length):
    # As curl --http2 sends it. A body that counts as the next request would be one that nobody checked.
    head = b"POST /one HTTP/1.1\r\nHost: here\r\nConnection: keep-alive, Upgrade\r\nUpgrade: h2c\r\n" + length
    body = b"GET /two HTTP/1.1\r\n"[:16]
    with connected(telling) as connection:
        if b"chunked" in length:
            connection.sendall(head + b"\r\n\r\n10\r\n" + body + b"\r\n0\r\n\r\n")
        else:
            connection.sendall(head + b"\r\n\r\n" + body)
        status, (method, path, names, text) = told(connection)
        assert (status, method, path, text) == (200, "POST", "/one", body.decode())
        assert "upgrade" not in names
        connection.sendall(REQUEST)
        assert told(connection) == (200, ["GET", "/", ["host"], ""])


def test_requests_at_once_are_answered_in_turn_and_bounded(telling):
    with connected(telling) as connection:
        connection.sendall(4 * REQUEST + REQUEST[:-2] + b"Connection: close\r\n\r\n")
        assert read_to_end(connection).count(b"HTTP/1.1 200") == 5
    with connected(telling) as connection:
        connection.sendall(3000 * REQUEST)
        answers = read_to_end(connection).count(b"HTTP/1.1 ")
        assert answers <= slow_headers.MAX_PIPELINED + 1


def test_timeout_does_not_write_into_a_response(server):
    with connected(server) as connection:
        connection.sendall(REQUEST + b"no request\r\n\r\n")
        answer = read_to_end(connection)
        assert answer.startswith(b"HTTP/1.1 204")
        assert answer.count(b"HTTP/1.1") == 1

"""An answer to a body that was not read is the last one of its connection, and the client can read it."""

import asyncio
import logging
import threading
import time

import pytest

from bentray_service.web import unread_bodies

from .speaking import connected, read_answer, read_to_end, served

HEAD = b"POST / HTTP/1.1\r\nHost: here\r\nContent-Length: %d\r\n\r\n"


def send_for_long(connection, times, data, *, every):
    for _ in range(times):
        connection.sendall(data)
        time.sleep(every)


@pytest.fixture
def server(monkeypatch):
    """Refuses everything unread."""
    monkeypatch.setattr(unread_bodies, "LINGER_S", 0.5)

    async def app(scope, receive, send):
        headers = [(b"content-length", b"9")]
        await send({"type": "http.response.start", "status": 401, "headers": headers})
        await send({"type": "http.response.body", "body": b"not today"})

    with served(app) as found:
        yield found


def test_slow_body_is_closed(server):
    with connected(server) as connection:
        connection.sendall(HEAD % 1_000_000 + b"x")
        answer = read_to_end(connection)
        assert answer.startswith(b"HTTP/1.1 401")
        assert b"connection: close" in answer
        assert answer.endswith(b"not today")
        with pytest.raises(ConnectionError):
            send_for_long(connection, 1000, b"x", every=0.02)


def test_a_client_that_sends_on_reads_the_answer(server):
    # More than the buffers of both ends hold, sent before a byte is read.
    with connected(server) as connection:
        connection.sendall(HEAD % 6_000_000 + bytes(6_000_000))
        assert read_to_end(connection).endswith(b"not today")


def test_a_client_that_never_ends_is_cut_off(server, monkeypatch):
    monkeypatch.setattr(unread_bodies, "LINGER_S", 60.0)
    with connected(server) as connection:
        connection.sendall(HEAD % 10**12)
        with pytest.raises(ConnectionError):
            send_for_long(connection, 4 * unread_bodies.LINGER_BYTES // 65536, bytes(65536), every=0.0)


def test_received_body_keeps_the_connection(server):
    with connected(server) as connection:
        for _ in range(3):
            connection.sendall(HEAD % 4 + b"body")
            assert read_answer(connection) == (401, b"not today")


def test_a_client_that_left_while_nothing_was_read_is_no_fault(caplog):
    left = threading.Event()

    async def app(scope, receive, send):
        headers = [(b"content-length", b"9")]
        await send({"type": "http.response.start", "status": 401, "headers": headers})
        while not left.is_set():
            await asyncio.sleep(0.01)
        await send({"type": "http.response.body", "body": b"not today"})

    with caplog.at_level(logging.ERROR), served(app) as server:
        with connected(server) as connection:
            # So much that reading is paused, and the end of the connection is not seen.
            connection.sendall(HEAD % 1_000_000 + bytes(200_000))
            assert connection.recv(65536).endswith(b"\r\n\r\n")
        left.set()
        deadline = time.monotonic() + 60.0
        while len(server.connections):
            assert time.monotonic() < deadline
            time.sleep(0.02)
    assert not caplog.records


def test_no_descriptor_stays_behind(server):
    connections = [connected(server) for _ in range(20)]
    for connection in connections:
        connection.sendall(HEAD % 1_000_000 + b"x")
    for connection in connections:
        read_to_end(connection)
    deadline = time.monotonic() + 60.0
    while len(server.connections):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    for connection in connections:
        connection.close()

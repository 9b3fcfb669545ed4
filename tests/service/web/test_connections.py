"""Connections are bounded, of one address and in all; the silent make room, and health is answered."""

import asyncio
import json
import logging
import os
import resource
import socket
import threading
import time
from pathlib import Path

import pytest

from bentray_service.web import descriptors, protocol
from bentray_service.web.addresses import networks
from bentray_service.web.connections import KEPT, MAX_CONNECTIONS, SPARE, ConnectionLimits, Connections
from bentray_service.web.listening import Listening

from .speaking import connected, read_answer, read_to_end, served

HEALTH = b"GET /health/live HTTP/1.1\r\nHost: here\r\n\r\n"
OTHER = b"GET /v1/jobs HTTP/1.1\r\nHost: here\r\n\r\n"


class Fake:
    """A connection that knows whether it was dropped."""

    def __init__(self):
        self.dropped = False

    def drop(self):
        self.dropped = True


def come(connections, address, count):
    found = [Fake() for _ in range(count)]
    for one in found:
        connections.add(one, address)
    return found


def test_longest_idle_connection_of_an_address_is_closed():
    connections = Connections(ConnectionLimits(10, 3, 2))
    first, second, third = come(connections, "192.0.2.1", 3)
    connections.busy(first)
    connections.busy(second)
    connections.idle(first)
    assert not connections.add(Fake(), "192.0.2.1")
    assert [one.dropped for one in (first, second, third)] == [False, False, True]
    assert not connections.add(Fake(), "192.0.2.1")
    assert [one.dropped for one in (first, second)] == [True, False]
    assert len(connections) == 3


def test_address_with_most_connections_loses_one():
    connections = Connections(ConnectionLimits(6, 4, 2))
    honest = come(connections, "192.0.2.1", 2)
    many = come(connections, "192.0.2.2", 4)
    come(connections, "192.0.2.3", 2)
    assert not any(one.dropped for one in honest)
    assert sum(one.dropped for one in many) == 2
    assert len(connections) == 6


def test_where_all_are_at_work_a_new_one_is_spare():
    connections = Connections(ConnectionLimits(3, 3, 2))
    for one in come(connections, "192.0.2.1", 3):
        connections.busy(one)
    spare = [Fake() for _ in range(4)]
    assert all(connections.add(one, f"192.0.2.{n}") for n, one in enumerate(spare))
    # As many as there are kept; the oldest makes room.
    assert [one.dropped for one in spare] == [True, True, False, False]
    assert len(connections) == 5
    for one in spare:
        connections.remove(one)
    assert len(connections) == 3


def test_one_customer_has_many_addresses():
    connections = Connections(ConnectionLimits(100, 3, 2))
    found = [Fake() for _ in range(6)]
    for n, one in enumerate(found):
        connections.add(one, f"2001:db8::{n:x}")
    assert sum(one.dropped for one in found) == 3
    assert not any(one.dropped for one in come(connections, "2001:db8:0:1::1", 3))
    assert not any(one.dropped for one in come(connections, "::ffff:192.0.2.1", 2))
    connections.add(Fake(), "192.0.2.1")
    assert sum(one.dropped for one in come(connections, "192.0.2.1", 1)) == 0


def test_a_trusted_proxy_brings_many():
    connections = Connections(ConnectionLimits(20, 3, 2), networks("10.0.0.0/8"))
    assert not any(one.dropped for one in come(connections, "10.1.2.3", 20))


@pytest.mark.parametrize(
    ("allowed", "in_use", "of_address", "most", "each"),
    [
        (1024, 100, None, (1024 - 100 - KEPT - SPARE) // 2, (1024 - 100 - KEPT - SPARE) // 8),
        (65536, 100, None, MAX_CONNECTIONS, MAX_CONNECTIONS // 4),
        (65536, 100, 7, MAX_CONNECTIONS, 7),
        (512, 600, None, 1, 1),
        (1024, 100, 10_000, 366, 366),
    ],
)
def test_the_limits_follow_from_the_descriptors(allowed, in_use, of_address, most, each):
    assert ConnectionLimits.of(allowed, in_use, of_address) == ConnectionLimits(most, each, SPARE)


def test_the_limit_of_descriptors_is_raised(monkeypatch):
    asked = []
    monkeypatch.setattr(resource, "getrlimit", lambda _: (256, 4096))
    monkeypatch.setattr(resource, "setrlimit", lambda _, pair: asked.append(pair))
    assert descriptors.raise_limit() == 4096
    assert asked == [(4096, 4096)]


def test_too_few_descriptors_are_rejected(monkeypatch):
    monkeypatch.setattr(resource, "getrlimit", lambda _: (256, 256))
    with pytest.raises(descriptors.InvalidInput, match=r"open files: found a limit of 256.*at least 512"):
        descriptors.raise_limit()


class Holding:
    """Answers once it is let go."""

    def __init__(self):
        self.held = threading.Semaphore(0)
        self.go = threading.Event()

    async def __call__(self, scope, receive, send):
        if scope["path"] == "/v1/jobs":
            self.held.release()
            while not self.go.is_set():
                await asyncio.sleep(0.01)
        await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"2")]})
        await send({"type": "http.response.body", "body": b"ok"})


@pytest.fixture
def app():
    found = Holding()
    yield found
    found.go.set()


def test_idle_connections_block_no_client(app):
    with served(app, ConnectionLimits(1000, 8, 4)) as server:
        silent = [connected(server) for _ in range(40)]
        for one in silent[::2]:
            one.sendall(b"GET / HT")
        for _ in range(3):
            with connected(server) as honest:
                honest.sendall(HEALTH)
                assert read_answer(honest) == (200, b"ok")
        assert len(server.connections) <= 8 + 4
        # Closed, not left hanging.
        assert closed(silent[0])
        for one in silent:
            one.close()


def test_health_is_answered_where_all_are_at_work(app):
    with served(app, ConnectionLimits(1000, 3, 4)) as server:
        working = [connected(server) for _ in range(3)]
        for one in working:
            one.sendall(OTHER)
            assert app.held.acquire(timeout=60.0)
        with connected(server) as further:
            further.sendall(HEALTH)
            assert read_to_end(further).endswith(b"ok")
        with connected(server) as further:
            further.sendall(OTHER)
            head, _, body = read_to_end(further).partition(b"\r\n\r\n")
            assert head.startswith(b"HTTP/1.1 503")
            assert b"retry-after: " in head.lower()
            problem = json.loads(body)
            assert problem["type"] == "/problems/too-many-connections"
            assert "more than 3 from your address" in problem["found"]
        app.go.set()
        for one in working:
            assert read_answer(one) == (200, b"ok")
            one.sendall(OTHER)
            assert read_answer(one) == (200, b"ok")
            one.close()


def test_a_client_that_does_not_read_is_cut_off(monkeypatch):
    monkeypatch.setattr(protocol, "ANSWER_S", 0.2)

    async def endless(scope, receive, send):
        await send({"type": "http.response.start", "status": 200, "headers": []})
        while not ended.is_set():
            await send({"type": "http.response.body", "body": bytes(65536), "more_body": True})
            if (await asyncio.wait({watching}, timeout=0))[0]:
                ended.set()

    ended = threading.Event()

    async def app(scope, receive, send):
        nonlocal watching
        watching = asyncio.ensure_future(gone(receive))
        await endless(scope, receive, send)

    watching = None

    async def gone(receive):
        while (await receive())["type"] != "http.disconnect":
            pass

    with served(app) as server, connected(server) as connection:
        connection.sendall(OTHER)
        assert ended.wait(60.0)


def test_answers_in_two_segments_do_not_wait_for_an_acknowledgement():
    with Listening() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen()
        with socket.create_connection(listening.getsockname()), listening.accept()[0] as accepted:
            assert accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


def test_descriptor_shortage_closes_idle_connections(app, monkeypatch, caplog):
    # As many as are open now: the next one that is taken in would be one too many.
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    with served(app) as server, caplog.at_level(logging.ERROR, "bentray.connections"):
        waiting = [connected(server) for _ in range(2)]
        wait_until(lambda: len(server.connections) == 2)
        sockets = [socket.socket() for _ in range(3)]
        highest = max(int(name.name) for name in Path("/proc/self/fd").iterdir())
        fillers = []
        try:
            resource.setrlimit(resource.RLIMIT_NOFILE, (highest + 1, hard))
            while True:
                try:
                    fillers.append(os.open(os.devnull, os.O_RDONLY))
                except OSError:
                    break
            for one in sockets:
                one.settimeout(20.0)
                one.connect(("127.0.0.1", server.port))
                # Closed, and not left in the queue.
                assert closed(one)
        finally:
            for one in fillers:
                os.close(one)
            resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        with connected(server) as again:
            again.sendall(HEALTH)
            assert read_answer(again) == (200, b"ok")
        for one in (*sockets, *waiting):
            one.close()
    told = [
        record.getMessage() for record in caplog.records if "cannot accept connections" in record.getMessage()
    ]
    assert 1 <= len(told) <= 10


def closed(connection):
    try:
        return connection.recv(1) == b""
    except ConnectionResetError:
        return True


def wait_until(happened):
    deadline = time.monotonic() + 60.0
    while not happened():
        assert time.monotonic() < deadline
        time.sleep(0.01)

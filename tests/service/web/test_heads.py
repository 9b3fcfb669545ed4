"""The head of a request comes in time, or the connection is closed; what is being answered goes on."""

import asyncio
import socket
import threading
import time

import pytest
import uvicorn

from bentray_service.web import heads
from bentray_service.web.heads import HeadInTime

REQUEST = b"GET / HTTP/1.1\r\nHost: here\r\n\r\n"


@pytest.fixture
def port(monkeypatch):
    """Of a server that waits for 0.3 s, and answers after 0.8 s."""
    monkeypatch.setattr(heads, "HEAD_S", 0.3)

    async def app(scope, receive, send):
        await asyncio.sleep(0.8)
        await send({"type": "http.response.start", "status": 204, "headers": []})
        await send({"type": "http.response.body"})

    listening = socket.socket()
    listening.bind(("127.0.0.1", 0))
    config = uvicorn.Config(app, http=HeadInTime, lifespan="off", log_config=None, timeout_keep_alive=60)
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
    thread.start()
    while not server.started:
        time.sleep(0.01)
    yield listening.getsockname()[1]
    server.should_exit = True
    thread.join()


@pytest.fixture
def connection(port):
    with socket.create_connection(("127.0.0.1", port), timeout=30.0) as found:
        yield found


@pytest.mark.parametrize("sent", [b"", b"GET", REQUEST[:-2]])
def test_a_head_that_does_not_come_is_not_waited_for(connection, sent):
    connection.sendall(sent)
    assert connection.recv(100) == b""


def test_an_answer_may_take_longer_and_the_next_head_has_its_time_again(connection):
    for _ in range(2):
        connection.sendall(REQUEST)
        assert connection.recv(1000).startswith(b"HTTP/1.1 204")
    connection.sendall(REQUEST[:10])
    assert connection.recv(100) == b""

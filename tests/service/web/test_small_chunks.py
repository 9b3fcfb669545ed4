"""Bodies in tiny chunks: the application is woken seldom, and too many of them are refused."""

import json
import socket
import threading
from contextlib import suppress

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_service.web import small_chunks
from bentray_service.web.errors import problem_response

from .speaking import connected, read_answer, read_to_end, served

HEAD = b"POST / HTTP/1.1\r\nHost: here\r\nTransfer-Encoding: chunked\r\n\r\n"
ONE = b"1\r\nx\r\n"
END = b"0\r\n\r\n"


class Counting:
    """An application that tells how many pieces a body came in, and how many bytes."""

    def __init__(self):
        self.gone = threading.Event()

    async def __call__(self, scope, receive, send):
        pieces, size, more = 0, 0, True
        if scope["path"] == "/early":
            await send({"type": "http.response.start", "status": 200, "headers": []})
        while more:
            try:
                message = await receive()
            except InvalidInput as error:
                await problem_response(error, scope["path"])(scope, receive, send)
                return
            if message["type"] == "http.disconnect":
                self.gone.set()
                return
            pieces, size, more = pieces + 1, size + len(message["body"]), message["more_body"]
        told = json.dumps([pieces, size]).encode()
        headers = [(b"content-length", str(len(told)).encode())]
        await send({"type": "http.response.start", "status": 200, "headers": headers})
        await send({"type": "http.response.body", "body": told})


@pytest.fixture
def app():
    return Counting()


@pytest.fixture
def server(app):
    with served(app) as found:
        yield found


def answer(server, *parts):
    with connected(server) as connection:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for part in parts:
            connection.sendall(part)
        status, body = read_answer(connection)
        return status, json.loads(body)


def test_many_chunks_of_one_byte_are_rejected(server):
    status, problem = answer(server, HEAD, 5000 * ONE)
    assert (status, problem["type"], problem["field"]) == (400, "/problems/tiny-chunks", "body")
    assert problem["found"] == "1025 chunks of 1 bytes on average"
    assert "Content-Length" in problem["accepted"]


def test_that_connection_ends_with_it(server):
    with connected(server) as connection:
        connection.sendall(HEAD + 5000 * ONE)
        answer = read_to_end(connection)
        assert b"connection: close" in answer
        assert answer.count(b"HTTP/1.1") == 1


def test_a_few_are_taken_and_come_together(server):
    assert answer(server, HEAD + 1000 * ONE + END) == (200, [1, 1000])
    # Each part is an event of its own for the server, none for the application.
    status, (pieces, size) = answer(server, HEAD, *(300 * [ONE]), END)
    assert (status, size) == (200, 300)
    assert pieces < 100


def test_any_number_of_large_ones_is_taken(server):
    # One that comes in two parts counts twice.
    length, count = small_chunks.MIN_MEAN_BYTES + 10, 8 * small_chunks.FREE_CHUNKS
    large = b"%x\r\n%b\r\n" % (length, bytes(length))
    status, (_, size) = answer(server, HEAD + count * large + END)
    assert (status, size) == (200, count * length)


def test_a_body_of_known_length_may_come_in_any_pieces(server):
    head = b"POST / HTTP/1.1\r\nHost: here\r\nContent-Length: 3000\r\n\r\n"
    status, (_, size) = answer(server, head, *(3000 * [b"x"]))
    assert (status, size) == (200, 3000)


def test_endless_small_chunks_time_out(server):
    # Less than is worth a waking of its own; it comes though no more does.
    with connected(server) as connection:
        connection.sendall(HEAD + ONE)
        connection.sendall(b"no length\r\n")
        status, body = read_answer(connection)
        assert (status, json.loads(body)["type"]) == (400, "/problems/malformed-request")


def test_small_chunks_during_a_response_close_the_connection(server, app):
    with connected(server) as connection:
        connection.sendall(HEAD.replace(b"POST /", b"POST /early") + 5000 * ONE)
        with suppress(ConnectionResetError):
            read_to_end(connection)
        assert app.gone.wait(60.0)

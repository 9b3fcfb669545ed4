"""nginx with deploy/nginx.conf: hostile connections end there, and nothing is held back or stored."""

import asyncio
import json
import re
import socket
import ssl
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from types import SimpleNamespace

import httpx
import pytest
import uvicorn

from bentray_service.app import create_app
from bentray_service.errors import PROBLEMS
from bentray_service.settings import ServiceSettings
from bentray_service.web.errors import EDGE
from bentray_service.web.server import configuration, listen

from ...edge import CONFIGURATION, SKIPPED, edge, program
from ...raw_http import exchange
from ...waiting import wait_until
from ..conftest import FakeCluster

pytestmark = pytest.mark.skipif(program() is None, reason=SKIPPED)

PATIENCE_S = 60.0
# Seconds and numbers in place of those of the file, so that their end is reached soon.
SHORT = {
    "client_header_timeout": "1s",
    "client_body_timeout": "1s",
    "send_timeout": "1s",
    "lingering_timeout": "100ms",
    "limit_conn": "requests 12",
    "worker_connections": "160",
}
MOST = 12
TUS = {"Tus-Resumable": "1.0.0"}
PIECE = {**TUS, "Content-Type": "application/offset+octet-stream"}
SCAN = {"Content-Type": "application/x-hdf5"}


class Service:
    """The application, beside some addresses that wait, tell and never end."""

    def __init__(self, app):
        self.app = app
        self.go = threading.Event()
        self.held = threading.Semaphore(0)
        self.left = threading.Event()

    async def __call__(self, scope, receive, send):
        answer = {"/hold": self.hold, "/told": self.told, "/endless": self.endless}.get(scope.get("path"))
        await (self.app if answer is None else answer)(scope, receive, send)

    async def hold(self, scope, receive, send):
        """Says of each piece of the body that it came; a first line then, and the last one later."""
        more = True
        while more:
            more = (await receive()).get("more_body", False)
            self.held.release()
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"begun", "more_body": True})
        while not self.go.is_set():
            await asyncio.sleep(0.01)
        await send({"type": "http.response.body", "body": b"end"})

    async def told(self, scope, receive, send):
        while (await receive()).get("more_body"):
            pass
        headers = {name.decode(): value.decode() for name, value in scope["headers"]}
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": json.dumps(headers).encode()})

    async def endless(self, scope, receive, send):
        await send({"type": "http.response.start", "status": 200, "headers": []})
        leaving = asyncio.ensure_future(receive_end(receive))
        while not leaving.done():
            await send({"type": "http.response.body", "body": bytes(65536), "more_body": True})
            await asyncio.sleep(0)
        self.left.set()


async def receive_end(receive):
    while (await receive())["type"] != "http.disconnect":
        pass


@contextmanager
def behind(tmp, **changed):
    """The service with nginx in front."""
    app = create_app(ServiceSettings(data_dir=tmp / "data"), FakeCluster())
    service, listening = Service(app), listen("127.0.0.1", 0)
    server = uvicorn.Server(configuration(service))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]}, daemon=True)
    thread.start()
    try:
        wait_until(lambda: server.started)
        with (
            edge(tmp / "edge", listening.getsockname()[1], **changed) as found,
            httpx.Client(base_url=found.url, timeout=PATIENCE_S) as http,
        ):
            yield SimpleNamespace(edge=found, service=service, http=http, data=tmp / "data", port=found.port)
    finally:
        app.state.leaving.set()
        server.should_exit = True
        thread.join(PATIENCE_S)


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    with behind(tmp_path_factory.mktemp("edge"), **SHORT) as result:
        yield result


@pytest.fixture
def front(shared):
    shared.service.go.clear()
    yield shared
    shared.service.go.set()


def connected(front):
    return socket.create_connection(("127.0.0.1", front.port), timeout=PATIENCE_S)


def read_to_end(connection):
    text = b""
    with suppress(ConnectionError):
        while data := connection.recv(65536):
            text += data
    return text


def problem_in(answer):
    head, _, body = answer.partition(b"\r\n\r\n")
    assert b"application/problem+json" in head, answer[:300]
    return int(head.split()[1]), json.loads(body)


GET = b"GET /health/live HTTP/1.1\r\nHost: here\r\n"
CHUNKED = b"Transfer-Encoding: chunked\r\n\r\n"


@pytest.mark.parametrize("sent", [b"", b"GET", GET])
def test_a_header_that_does_not_come_is_not_waited_for(front, sent):
    with connected(front) as connection:
        connection.sendall(sent)
        read_to_end(connection)


@pytest.mark.parametrize(
    ("sent", "status", "slug"),
    [
        (GET + b"A: " + 60_000 * b"a", 431, "head-too-large"),
        (GET + 20_000 * b"A: b\r\n" + b"\r\n", 431, "head-too-large"),
        (b"GET /" + 60_000 * b"a", 414, "address-too-long"),
        (b"GET / HTTP/1.1\r\n\r\n", 400, "malformed-request"),
        (b"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n", 400, "malformed-request"),
        (GET + b"Content-Length: 1\r\n" + CHUNKED, 400, "malformed-request"),
        (GET + b"Content-Length: -1\r\n\r\n", 400, "malformed-request"),
        (GET + b"Content-Length: 1" + 30 * b"0" + b"\r\n\r\n", 400, "malformed-request"),
        (GET + b"Transfer-Encoding: gzip, chunked\r\n\r\n", 501, None),
        (b"\x16\x03\x01\x02\x00\r\n\r\n", 400, "malformed-request"),
        (b"TRACE / HTTP/1.1\r\nHost: here\r\n\r\n", 405, "method-not-allowed"),
    ],
)
def test_invalid_headers_get_a_problem(front, sent, status, slug):
    with connected(front) as connection:
        connection.sendall(sent)
        answer = read_to_end(connection)
    if slug is None:
        assert answer.startswith(b"HTTP/1.1 %d" % status)
        return
    result, problem = problem_in(answer)
    assert (result, problem["status"], problem["type"]) == (status, status, f"/problems/{slug}")


def test_every_problem_of_the_file_is_known():
    kinds = {(kind.status, kind.slug, kind.title) for kind in (*EDGE, *PROBLEMS)}
    texts = re.findall(r"^ +\d+ '(\{.*\})';$", CONFIGURATION.read_text(), re.M)
    problems = [json.loads(text) for text in texts]
    result = {(entry["status"], entry["type"].rpartition("/")[2], entry["title"]) for entry in problems}
    assert result - kinds == {(405, "method-not-allowed", "Method Not Allowed")}
    assert {(kind.status, kind.slug, kind.title) for kind in EDGE} <= result


def test_slow_bodies_end_and_free_what_they_held(front):
    location = front.http.post("/v1/uploads", headers={**TUS, "Upload-Length": "1000000"}).headers["location"]
    length = "Content-Length: 1000000"
    heads = [
        ["POST /v1/datasets HTTP/1.1", *lines(SCAN), length],
        [f"PATCH {location} HTTP/1.1", *lines(PIECE), "Upload-Offset: 0", length],
        ["POST /v1/jobs HTTP/1.1", "Content-Type: application/json", "Content-Length: 9"],
    ]
    with ThreadPoolExecutor(len(heads)) as pool:
        answers = list(pool.map(lambda head: exchange(front.port, head, b"x", ends=False), heads))
    for statuses, answer in answers:
        assert set(statuses) <= {408}
        assert not statuses or problem_in(answer)[1]["type"] == "/problems/too-slow"
    wait_until(lambda: not list(front.data.glob("tenants/*/incoming/*")))
    # What came is kept, and the upload is free for whoever goes on with it.
    # Until nginx has let go of the other bodies, an answer may be an error without an offset.
    wait_until(lambda: front.http.head(location, headers=TUS).headers.get("upload-offset") == "1")
    more = {"headers": {**PIECE, "Upload-Offset": "1"}, "content": b"more"}
    wait_until(lambda: front.http.patch(location, **more).headers.get("upload-offset") == "5")


def lines(headers):
    return [f"{name}: {value}" for name, value in headers.items()]


def test_tiny_chunks_are_a_body_like_others(front):
    head = ["POST /told HTTP/1.1", "Transfer-Encoding: chunked", "Connection: close"]
    statuses, _ = exchange(front.port, head, 5000 * b"1\r\nx\r\n" + b"0\r\n\r\n", ends=False)
    assert statuses == [200]
    statuses, _ = exchange(front.port, head, 5000 * b"1\r\nx\r\n" + b"no length\r\n", ends=False)
    assert statuses in ([400], [])
    assert front.http.get("/health/live").is_success


@pytest.mark.parametrize("sent", [100, 6_000_000])
def test_body_announced_as_10_tb_is_refused_at_once(front, sent):
    head = ["POST /v1/jobs HTTP/1.1", "Content-Type: application/json", f"Content-Length: {10**13}"]
    statuses, answer = exchange(front.port, head, bytes(sent), ends=False)
    assert statuses == [413]
    assert problem_in(answer)[1]["found"] == f"{10**13} bytes"


def test_a_client_that_does_not_read_is_cut_off(front):
    with connected(front) as connection:
        connection.sendall(b"GET /endless HTTP/1.1\r\nHost: here\r\n\r\n")
        assert front.service.left.wait(PATIENCE_S)


def test_requests_of_one_address_are_limited_and_health_is_answered(front):
    with ExitStack() as stack:
        for _ in range(MOST):
            stack.enter_context(front.http.stream("GET", "/hold"))
            assert front.service.held.acquire(timeout=PATIENCE_S)
        refused = front.http.get("/v1/jobs")
        assert refused.status_code == 503
        assert refused.headers["retry-after"] == "10"
        assert refused.json()["type"] == "/problems/too-many-connections"
        assert front.http.get("/health/live").is_success
        front.service.go.set()
    wait_until(lambda: front.http.get("/v1/jobs").is_success)


def test_idle_connections_make_room(front):
    with ExitStack() as stack:
        # More than nginx may have in all.
        silent = [stack.enter_context(connected(front)) for _ in range(400)]
        for _ in range(3):
            with httpx.Client(base_url=front.edge.url, timeout=PATIENCE_S) as honest:
                assert honest.get("/v1/jobs").is_success
        assert read_to_end(silent[0]) == b""


def test_pieces_pass_at_once_and_nothing_is_stored(front):
    with connected(front) as connection:
        connection.sendall(b"POST /hold HTTP/1.1\r\nHost: here\r\nContent-Length: 8000005\r\n\r\n12345")
        assert front.service.held.acquire(timeout=PATIENCE_S)
        connection.sendall(bytes(8_000_000))
        text = b""
        for awaited in (b"begun", b"end"):
            while awaited not in text:
                text += connection.recv(65536)
            front.service.go.set()
    stored = [path for path in (front.edge.folder / "temporary").rglob("*") if path.is_file()]
    assert [path.name for path in stored] == ["nginx.pid"]


def test_no_client_names_a_user_or_another_address(front):
    claimed = {"X-Forwarded-User": "root", "X-Forwarded-For": "10.0.0.1", "X-Forwarded-Email": "a@b"}
    seen = front.http.post("/told", headers=claimed, content=b"x").json()
    assert {name: seen[name] for name in seen if name.startswith("x-forwarded")} == {
        "x-forwarded-for": "127.0.0.1",
        "x-forwarded-proto": "http",
    }
    # Nor does what follows a body reach the service as a header.
    trailers = CHUNKED + b"1\r\nx\r\n0\r\nX-Forwarded-User: root\r\n\r\n"
    with connected(front) as connection:
        connection.sendall(b"POST /told HTTP/1.1\r\nHost: here\r\nConnection: close\r\n" + trailers)
        assert b"root" not in read_to_end(connection)


@pytest.mark.parametrize(("host", "policy"), [("localhost", None), ("uct.example.org", "max-age=31536000")])
def test_tls(front, host, policy):
    trusted = ssl.create_default_context(cafile=front.edge.folder / "edge-certificate.pem")
    with httpx.Client(verify=trusted) as http:
        answer = http.get(f"https://localhost:{front.edge.tls_port}/told", headers={"Host": host})
    assert answer.json()["x-forwarded-proto"] == "https"
    assert answer.headers.get("strict-transport-security") == policy


def test_sign_ins_of_an_address_are_limited(front):
    result = [front.http.get("/sign-in") for _ in range(40)]
    assert {answer.status_code for answer in result} == {404, 429}
    assert result[-1].json()["type"] == "/problems/too-often"


def test_a_service_that_is_away_is_a_problem_of_its_own(tmp_path):
    with listen("127.0.0.1", 0) as nobody, edge(tmp_path / "edge", nobody.getsockname()[1]) as result:
        answer = httpx.get(f"{result.url}/v1/jobs", timeout=PATIENCE_S)
    assert (answer.status_code, answer.headers["retry-after"]) == (502, "10")
    assert answer.json()["type"] == "/problems/service-away"

"""Slow clients: disconnected with 408, and no other client waits."""

import json
import socket
import time
from contextlib import suppress
from urllib.parse import urlsplit

import httpx
import pytest

from bentray_service.ingest.upload_limits import MAX_PER_ACCOUNT

CLIENTS = 100
PATIENCE_S = 60.0
TUS = {"Tus-Resumable": "1.0.0"}


def drip(url, method, path, headers):
    """A connection that has announced a large body and sent one byte of it."""
    parts = urlsplit(url)
    connection = socket.create_connection((parts.hostname, parts.port), timeout=PATIENCE_S)
    lines = {"Host": parts.netloc, "Content-Length": "1000000", **headers}
    head = "".join(f"{name}: {value}\r\n" for name, value in lines.items())
    connection.sendall(f"{method} {path} HTTP/1.1\r\n{head}\r\nx".encode())
    return connection


def answer_of(connection):
    """Status and problem, read up to the end that the service makes."""
    connection.settimeout(PATIENCE_S)
    text = b""
    while data := connection.recv(65536):
        text += data
    head, _, body = text.partition(b"\r\n\r\n")
    return int(head.split()[1]), json.loads(body)


def one_shots(url, http):
    headers = {"Content-Type": "application/x-hdf5"}
    return [drip(url, "POST", "/v1/datasets", headers) for _ in range(CLIENTS)]


def pieces(url, http):
    headers = {**TUS, "Upload-Length": "1000000"}
    places = [http.post("/v1/uploads", headers=headers).headers["location"] for _ in range(CLIENTS)]
    headers = {**TUS, "Content-Type": "application/offset+octet-stream", "Upload-Offset": "0"}
    return [drip(url, "PATCH", place, headers) for place in places]


@pytest.mark.parametrize("begin", [one_shots, pieces])
def test_a_hundred_of_them(serve, tmp_path, begin):
    url = serve(upload_patience_s=2.0)
    with httpx.Client(base_url=url, timeout=PATIENCE_S) as http:
        connections = begin(url, http)
        until = time.monotonic() + 1.0
        while time.monotonic() < until:
            for connection in connections[::10]:
                # One that was refused at once may be closed by now.
                with suppress(ConnectionError):
                    connection.sendall(b"x")
            assert http.get("/health/live").json() == {"status": "alive"}
            time.sleep(0.05)
        refused = 0
        for connection in connections:
            status, problem = answer_of(connection)
            connection.close()
            if status == 429:
                assert problem["field"] == "uploads"
                refused += 1
                continue
            assert (status, problem["type"], problem["field"]) == (408, "/problems/too-slow", "body")
            assert "BENTRAY_UPLOAD_PATIENCE_S" in problem["accepted"]
        # In one request a tenant sends so many at a time; pieces are short requests, of any number.
        assert refused == (CLIENTS - MAX_PER_ACCOUNT if begin is one_shots else 0)
        assert http.get("/health/live").is_success
        if begin is pieces:
            # What came is kept, and the upload is free for whoever goes on with it.
            places = [path.name for path in tmp_path.glob("served/tenants/*/uploads/*")]
            assert len(places) == CLIENTS
            head = http.head(f"/v1/uploads/{places[0]}", headers=TUS)
            at = head.headers["upload-offset"]
            assert 1 <= int(at) < 1000
            headers = {**TUS, "Content-Type": "application/offset+octet-stream", "Upload-Offset": at}
            more = http.patch(f"/v1/uploads/{places[0]}", headers=headers, content=b"more")
            assert more.headers["upload-offset"] == str(int(at) + 4)
    assert not list(tmp_path.glob("served/tenants/*/incoming/*"))


def test_small_bodies_are_hurried_too(serve):
    url = serve(upload_patience_s=0.2)
    connection = drip(url, "POST", "/v1/jobs", {"Content-Type": "application/json", "Content-Length": "9"})
    assert answer_of(connection)[0] == 408
    connection.close()

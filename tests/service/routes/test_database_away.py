"""While the database is away every response is 503 with Retry-After, and then requests succeed again."""

import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import httpx
import pytest

from bentray_service.access import sign_in
from bentray_service.rows import database
from bentray_service.rows.ids import LOCAL
from bentray_service.rows.keys import ApiKey, Keys

from ..held_database import held

HDF5 = {"Content-Type": "application/x-hdf5"}
JOB = {"kind": "simulation", "settings": {"nodes": 16, "elements": 16}}
FIELD = "/v1/volumes/vol-00000000000000000000"


@contextmanager
def killed(server):
    server.kill()
    try:
        yield
    finally:
        server.start()


def is_away(answer):
    assert answer.status_code == 503, answer.text
    assert answer.json()["type"] == "/problems/database-away", answer.text
    assert int(answer.headers["retry-after"]) > 0


@pytest.mark.parametrize("keyed", [True, False], ids=["with a key", "open"])
def test_every_route_while_postgresql_is_dead(start, scan, postgresql_server, keyed, monkeypatch):
    monkeypatch.setattr(sign_in, "NO_KEYS_S", 0.0)
    address = postgresql_server.new_database()
    http = start(database_url=address)
    if keyed:
        # The door needs the database, too.
        token = ApiKey.new()
        Keys(http.app.state.stores.database).add(token, LOCAL, "", ("read", "write"))
        http.headers["Authorization"] = f"Bearer {token.shown()}"
    content = scan().read_bytes()
    dataset = http.post("/v1/datasets", content=content, headers=HDF5).json()["id"]
    with killed(postgresql_server):
        for method, path, sent in (
            ("GET", "/v1/jobs", {}),
            ("GET", f"/v1/datasets/{dataset}/file", {}),
            ("GET", f"{FIELD}/slice.png", {}),
            ("POST", "/v1/jobs", {"json": JOB}),
            ("POST", "/v1/datasets", {"content": content, "headers": HDF5}),
            ("POST", "/v1/uploads", {"headers": {"Tus-Resumable": "1.0.0", "Upload-Length": "9"}}),
            ("DELETE", f"/v1/datasets/{dataset}", {}),
        ):
            is_away(http.request(method, path, **sent))
        assert http.get("/health/live").status_code == 200
        ready = http.get("/health/ready")
        assert (ready.status_code, ready.json()["field"]) == (503, "database")
    for path in ("/v1/jobs", "/v1/access", f"/v1/datasets/{dataset}/file", "/health/ready"):
        assert http.get(path).status_code == 200
    assert http.post("/v1/jobs", json=JOB).status_code == 202
    postgresql_server.drop(address)


def test_forty_submissions_while_it_is_held(serve, tmp_path, monkeypatch):
    monkeypatch.setattr(database, "BUSY_SECONDS", 1.0)
    address = serve()
    with httpx.Client(base_url=address, timeout=60.0, limits=httpx.Limits(max_connections=50)) as http:
        with held(tmp_path / "served" / "bentray.sqlite"), ThreadPoolExecutor(41) as pool:
            asked = [pool.submit(http.post, "/v1/jobs", json=JOB) for _ in range(40)]
            lived = []
            while not all(one.done() for one in asked):
                begun = time.monotonic()
                assert http.get("/health/live").status_code == 200
                lived.append(time.monotonic() - begun)
                time.sleep(0.05)
            for one in asked:
                is_away(one.result())
        assert len(lived) > 1
        assert http.post("/v1/jobs", json=JOB).status_code == 202

"""A full disk and a database that is away: refused as such, without partial files; then all goes on."""

import io
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import httpx
import numpy as np
import pytest
import trimesh
from typer.testing import CliRunner

from bentray_service.access import sign_in
from bentray_service.cli import app as cli
from bentray_service.rows import database
from bentray_service.rows.ids import LOCAL
from bentray_service.rows.keys import ApiKey, Keys

from ...small_disk import fill
from ..conftest import STREAM
from ..held_database import held
from ..tus_records import TUS

JOB = {"kind": "simulation", "settings": {"nodes": 16, "elements": 16}}


# The database needs a few pages for a row, files more.
LEFT_BYTES = (0, 4096, 16384, 65536, 150_000)


def requests(scan):
    values, mesh = io.BytesIO(), trimesh.creation.icosphere(subdivisions=4).export(file_type="ply")
    np.save(values, np.random.default_rng(0).integers(0, 255, (60, 60, 60), dtype=np.uint8))
    yield "POST", "/v1/meshes", {"content": mesh, "headers": STREAM}
    yield "POST", "/v1/volumes", {"content": values.getvalue(), "headers": STREAM}
    yield "POST", "/v1/datasets", {"content": scan().read_bytes(), "headers": STREAM}
    yield "POST", "/v1/uploads", {"headers": {**TUS, "Upload-Length": "200000"}}
    yield "POST", "/v1/jobs", {"json": JOB}


@pytest.mark.parametrize("left", LEFT_BYTES)
def test_every_write_says_so(start, small_disk, scan, left):
    http = start(str(small_disk / "data"), min_free_bytes=0)
    volume = next(request for request in requests(scan) if request[1] == "/v1/volumes")
    made = http.request(volume[0], volume[1], **volume[2]).json()
    before = sorted(path.name for path in small_disk.glob("data/tenants/*/*/*"))
    fill(small_disk, left)
    for method, path, sent in requests(scan):
        answer = http.request(method, path, **sent)
        assert answer.status_code in (201, 202, 507), (path, answer.text)
        if answer.status_code == 507:
            assert answer.json()["type"] in ("/problems/storage-full",), answer.text
        if left == 0:
            assert answer.status_code == 507, path
    answer = http.get(made["links"]["self"] + "/data?format=nifti")
    assert answer.status_code in (200, 507), answer.text
    if left == 0:
        assert sorted(path.name for path in small_disk.glob("data/tenants/*/*/*")) == before
    (small_disk / "filler").unlink()
    for method, path, sent in requests(scan):
        assert http.request(method, path, **sent).status_code in (201, 202)
    assert http.delete(made["links"]["self"]).status_code == 204


def new_key(folder):
    return CliRunner().invoke(cli, ["keys", "create", "--name", "x", "--data", str(folder / "data")])


@pytest.mark.parametrize("left", [0, 4096, 20_000, 40_000])
@pytest.mark.parametrize("first", [True, False])
def test_a_command_on_a_full_disk_ends_with_one_line(small_disk, left, first):
    if not first:
        assert new_key(small_disk).exit_code == 0
    fill(small_disk, left)
    ended = new_key(small_disk)
    assert ended.exit_code in (0, 1, 2), ended.output
    if ended.exit_code:
        assert ended.output.count("\n") == 1, ended.output
        assert "bentray: database" in ended.output or "data" in ended.output
    (small_disk / "filler").unlink()
    assert new_key(small_disk).exit_code == 0


HDF5 = {"Content-Type": "application/x-hdf5"}


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
            ("POST", "/v1/uploads", {"headers": {**TUS, "Upload-Length": "9"}}),
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

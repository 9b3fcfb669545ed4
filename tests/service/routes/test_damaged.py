"""Bytes that changed on the disk are a named error, not a wrong picture; deletion is none."""

import os
from concurrent.futures import ThreadPoolExecutor

import httpx
import numpy as np
import pytest

from ..conftest import STREAM, created, npy


def packed(side=12):
    return npy(np.random.default_rng(0).integers(0, 255, (side, side, side), dtype=np.uint8))


def flip(path):
    """A bit in the middle, as a disk does it: without a new age."""
    before, content = path.stat(), bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


@pytest.fixture
def spoiled(start):
    """A service that finds a volume changed under its feet, and the volume."""
    first = start()
    volume = first.post("/v1/volumes", content=packed(), headers=STREAM).json()["id"]
    tag = first.get(f"/v1/volumes/{volume}/data").headers["etag"]
    (path,) = first.app.state.stores.files.root.glob("tenants/*/volumes/*.h5")
    first.__exit__(None, None, None)
    flip(path)
    return start(), volume, tag


@pytest.mark.parametrize("asked", ["data", "data?format=npy", "slice.png", "refraction.png"])
def test_it_is_named(spoiled, asked):
    http, volume, tag = spoiled
    for headers in ({}, {"If-None-Match": tag}, {"Range": "bytes=0-9", "If-Range": tag}):
        if headers and asked != "data":
            continue
        answer = http.get(f"/v1/volumes/{volume}/{asked}", headers=headers)
        assert (answer.status_code, answer.json()["type"]) == (500, "/problems/stored-data-damaged")
        assert volume in answer.json()["found"]
        assert "etag" not in answer.headers


def test_so_it_is_to_a_job(spoiled, until):
    http, volume, _ = spoiled
    asked = {"kind": "refraction", "volume": volume, "settings": {"frames": 2, "width": 64, "height": 64}}
    done = until(http, created(http.post("/v1/jobs", json=asked), 202)["id"])
    assert (done["state"], done["error"]["type"]) == ("failed", "/problems/stored-data-damaged")
    assert volume in done["error"]["detail"]


def test_it_can_be_deleted(spoiled):
    http, volume, _ = spoiled
    assert http.delete(f"/v1/volumes/{volume}").status_code == 204


def test_a_download_goes_on_while_its_volume_is_deleted(serve):
    with httpx.Client(base_url=serve(), timeout=60.0) as http:
        sent = packed(200)
        volume = http.post("/v1/volumes", content=sent, headers=STREAM).json()["id"]
        with http.stream("GET", f"/v1/volumes/{volume}/data") as answer:
            pieces = answer.iter_raw(65536)
            come = len(next(pieces))
            assert http.delete(f"/v1/volumes/{volume}").status_code == 204
            come += sum(map(len, pieces))
            assert come == int(answer.headers["content-length"])
        assert http.get(f"/v1/volumes/{volume}/data").status_code == 404


def test_readers_during_a_deletion_get_410(http):
    with ThreadPoolExecutor(6) as pool:
        for _ in range(8):
            volume = http.post("/v1/volumes", content=packed(), headers=STREAM).json()["id"]
            places = ("data", "data?format=npy", "slice.png", "data?format=nifti", "slice.png?axis=x")
            asked = [pool.submit(http.get, f"/v1/volumes/{volume}/{place}") for place in places]
            asked.append(pool.submit(http.delete, f"/v1/volumes/{volume}"))
            result = [request.result().status_code for request in asked]
            assert set(result) <= {200, 204, 404}, result
    root = http.app.state.stores.files.root
    assert [path.name for path in root.glob("tenants/**/*") if path.is_file()] == []

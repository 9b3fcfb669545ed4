"""A full disk: every write is answered 507 and leaves no partial file."""

import io

import numpy as np
import pytest
import trimesh
from typer.testing import CliRunner

from bentray_service.cli import app as cli

from ...small_disk import fill

STREAM = {"Content-Type": "application/octet-stream"}
TUS = {"Tus-Resumable": "1.0.0"}
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

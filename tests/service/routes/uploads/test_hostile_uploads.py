"""Hostile files over HTTP: one problem response each, the same process, no files left."""

import os
from concurrent.futures import ThreadPoolExecutor

import psutil
import pytest

from bentray_workers.files.dataset import write_dataset

from ....effort import effort
from ....workers.files.datasets import small
from ...conftest import STREAM
from ...ingest import hostile_datasets, hostile_meshes, hostile_volumes
from ...ingest.damage import damaged

pytestmark = pytest.mark.ingest_process

# Resident memory that the service may gain while it refuses some dozens of files.
MAX_GROWTH = 100 * 2**20

# Each starts a process; tests/service/ingest reads all kinds without the service.
SCANS = (
    "external link",
    "16 GiB of zeros",
    *effort((), ("external storage", "virtual", "records", "terabytes", "zstandard")),
)
VOLUMES = ("pickled objects", "a bomb", *effort((), ("a file beside it", "absurd sizes", "absurd dims")))
MESHES = ("a buffer in a file", "a deep scene", *effort((), ("billions of binary vertices", "a long chunk")))


@pytest.fixture
def hostile(tmp_path):
    """(path of the route, content) of each."""
    write_dataset(tmp_path / "sound.h5", small())
    sound = (tmp_path / "sound.h5").read_bytes()
    scans = hostile_datasets.files(sound, tmp_path, SCANS)
    result = [("/v1/datasets", path.read_bytes()) for path in scans.values()]
    result += [
        ("/v1/datasets", content)
        for _, content in damaged(sound, flips=0, cuts=effort(1, 4), losses=effort(1, 3), seed=2)
    ]
    result += [("/v1/volumes", hostile_volumes.REFUSED[name][0]) for name in VOLUMES]
    return result + [("/v1/meshes", hostile_meshes.REFUSED[name][0]) for name in MESHES]


@pytest.mark.slow
def test_nothing_is_left_of_a_hostile_file(start, hostile):
    http = start(ingest_seconds=60.0)
    here = psutil.Process(os.getpid())
    before, children = here.memory_info().rss, set(here.children())
    with ThreadPoolExecutor(2) as pool:
        answers = list(pool.map(lambda one: http.post(one[0], content=one[1], headers=STREAM), hostile))
    assert len(answers) >= effort(7, 20)
    for answer in answers:
        body = answer.json()
        assert answer.status_code in (413, 415, 422), body
        assert answer.headers["content-type"] == "application/problem+json"
        assert body["field"]
        assert body["found"]
        assert body["accepted"]
    assert http.get("/health/live").status_code == 200
    assert here.memory_info().rss - before < MAX_GROWTH
    assert set(here.children()) <= children
    root = http.app.state.stores.files.root
    # The audit tells of the requests; it holds nothing of the files.
    left = {path.name for path in root.rglob("*") if path.is_file() and path.parent.name != "audit"}
    assert left <= {
        "service.lock",
        "database.json",
        *(f"bentray.sqlite{more}" for more in ("", "-wal", "-shm")),
    }
    assert http.get("/v1/datasets").json() == {"datasets": [], "next": None}
    assert http.get("/v1/volumes").json() == {"volumes": []}
    assert http.get("/v1/meshes").json() == {"meshes": []}

"""Storage quota over HTTP: reserved before anything is received, made or run."""

import gzip
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import nibabel
import numpy as np
import pytest

from bentray_service.errors import DatabaseUnavailable
from bentray_service.files.disk import bytes_in
from bentray_service.rows.ids import LOCAL, new_id

from ..conftest import STREAM, created, npy
from ..tus_records import PIECE, TUS, settled

HDF5 = {"Content-Type": "application/x-hdf5"}
QUOTA_BYTES = 2_000_000


def used(http):
    found = http.get("/v1/access").json()
    return found["bytes_stored"], found["bytes_reserved"]


def kept(http):
    return bytes_in(http.app.state.stores.files.of(LOCAL).root)


def refused(answer):
    assert answer.status_code == 507, answer.text
    found = answer.json()
    assert found["type"] == "/problems/quota-used-up"
    assert "BENTRAY_MAX_TENANT_BYTES" in found["accepted"]
    return found["found"]


def packed_zeros(count):
    """A volume of so many bytes that packs a thousandfold."""
    shape = (100, 100, count // 10_000)
    return gzip.compress(nibabel.Nifti1Image(np.zeros(shape, np.uint8), np.eye(4)).to_bytes())


def volume(http, values):
    return created(http.post("/v1/volumes", content=npy(values), headers=STREAM))["id"]


def test_rejected_and_deleted_objects_release_quota(start, scan, uploaded):
    content = scan().read_bytes()
    http = start(max_tenant_bytes=int(1.5 * len(content)))
    dataset = uploaded(http)
    stored = kept(http)
    assert used(http) == (stored, 0)

    def in_pieces():
        yield content

    for body in (content, in_pieces()):
        said = refused(http.post("/v1/datasets", content=body, headers=HDF5))
        assert said.startswith(f"{stored} bytes stored, ")
        assert used(http) == (stored, 0)
    refused(http.post("/v1/uploads", headers={**TUS, "Upload-Length": str(len(content))}))
    assert kept(http) == stored
    assert len(http.get("/v1/datasets").json()["datasets"]) == 1
    assert http.delete(f"/v1/datasets/{dataset}").status_code == 204
    assert used(http) == (0, 0)
    uploaded(http)


def test_uploads_in_pieces_begun_at_once_do_not_come_together_beyond_it(start):
    http, begin = start(max_tenant_bytes=QUOTA_BYTES), Barrier(8)

    def ask(_):
        begin.wait()
        return http.post("/v1/uploads", headers={**TUS, "Upload-Length": str(QUOTA_BYTES // 3)}).status_code

    with ThreadPoolExecutor(8) as pool:
        told = list(pool.map(ask, range(8)))
    assert sorted(told) == [201] * 3 + [507] * 5
    assert used(http) == (0, QUOTA_BYTES // 3 * 3)


@pytest.mark.ingest_process
@pytest.mark.parametrize("in_pieces", [False, True])
def test_compressed_volume_reserves_its_stored_size(start, in_pieces):
    http, content = start(max_tenant_bytes=QUOTA_BYTES), packed_zeros(11_000_000)
    assert len(content) < QUOTA_BYTES / 50
    if not in_pieces:
        said = refused(http.post("/v1/volumes", content=content, headers=STREAM))
    else:
        kind = {"Upload-Metadata": "kind dm9sdW1l", "Upload-Length": str(len(content))}
        place = http.post("/v1/uploads", headers={**TUS, **kind}).headers["location"]
        assert http.patch(place, content=content, headers={**PIECE, "Upload-Offset": "0"}).status_code == 204
        problem = settled(http, place)["problem"]
        assert (problem["status"], problem["type"]) == (507, "/problems/quota-used-up")
        said = problem["found"]
    assert said == "0 bytes stored, 0 reserved, 11000000 more requested"
    assert used(http) == (0, 0)
    assert kept(http) == 0
    assert http.get("/v1/volumes").json() == {"volumes": []}


def test_exports_count(start):
    http = start(max_tenant_bytes=QUOTA_BYTES)
    name = volume(http, np.zeros((64, 64, 64), np.float32))
    place = f"/v1/volumes/{name}/data"
    told = {kind: http.get(place, params={"format": kind}).status_code for kind in ("npy", "nifti", "mat")}
    # A mesh of bytes is written as numbers of eight at worst: that is what is reserved meanwhile.
    assert told == {"npy": 507, "nifti": 507, "mat": 507}
    http = start("larger", max_tenant_bytes=2 * QUOTA_BYTES)
    name = volume(http, np.zeros((64, 64, 64), np.float32))
    place = f"/v1/volumes/{name}/data"
    told = [http.get(place, params={"format": kind}) for kind in ("npy", "npy", "nifti", "metaimage")]
    assert [one.status_code for one in told] == [200, 200, 507, 507]
    assert used(http) == (kept(http), 0)
    assert http.delete(f"/v1/volumes/{name}").status_code == 204
    assert used(http) == (0, 0)


def test_jobs_reserve_quota_for_their_results(start, uploaded, submitted, work, until):
    """Of many that are submitted while the first runs, none goes beyond it; at its end it counts as it is."""
    http = start(max_tenant_bytes=QUOTA_BYTES)
    dataset = uploaded(http)
    stored, _ = used(http)
    work.hold.clear()
    job = submitted(http, dataset, nodes=64)
    assert job["plan"]["stored_bytes"] >= 4 * 64 * 64 * 8
    assert used(http) == (stored, job["plan"]["stored_bytes"])
    asked = {
        "kind": "reconstruction",
        "dataset": dataset,
        "settings": {"method": "sart", "nodes": 200, "iterations": 1},
    }
    refused(http.post("/v1/jobs", json=asked))
    work.hold.set()
    until(http, job["id"])
    assert used(http) == (kept(http), 0)


def test_geometry_fields_reserve_their_tables(start):
    http = start(max_tenant_bytes=3_000_000)
    corners = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n"
    answer = http.post("/v1/meshes", content=f"OFF\n4 4 0\n{corners}".encode(), headers=STREAM)
    # They stay queued.
    http.app.state.background.runner.stop()
    asked = {"kind": "geometry-field", "mesh": answer.json()["id"]}
    small = {"samples": 8, "inner_samples": 4, "image_size": 33}
    told = [http.post("/v1/jobs", json={**asked, "settings": {**small, "divisions": k}}) for k in range(1, 9)]
    assert [one.status_code for one in told] == [202, 202, *[507] * 6]
    # Each has two tables of 36 n⁴ entries of 4 bytes, whatever the mesh.
    assert 2 * 8 * 36 * 8**4 < used(http)[1] < 3_000_000
    assert http.post(told[0].json()["links"]["cancel"]).status_code == 202
    assert http.post("/v1/jobs", json={**asked, "settings": small}).status_code == 202


def test_reservations_of_a_killed_service_are_released_at_start(start):
    http = start(max_tenant_bytes=QUOTA_BYTES)
    http.app.state.stores.quota.resize(LOCAL, new_id("dataset"), QUOTA_BYTES)
    assert used(http) == (0, QUOTA_BYTES)
    http.__exit__()
    assert used(start(max_tenant_bytes=QUOTA_BYTES)) == (0, 0)


def test_a_reservation_is_released_later_if_the_database_is_away(http, monkeypatch, caplog):
    """An expected state: one line in the log, without a traceback."""
    quota = http.app.state.stores.quota
    with monkeypatch.context() as away:

        def refuse():
            raise DatabaseUnavailable("away")

        away.setattr(quota._database, "write", refuse)
        quota.release(LOCAL, "vol-1.npy")
    (record,) = [one for one in caplog.records if "released later" in one.getMessage()]
    assert record.exc_info is None
    assert quota._ended
    quota.renew()
    assert not quota._ended

"""What a tenant may store: refused before it is received, and what of others is there does not count."""

import pytest

from bentray_service.access.quota import check_room
from bentray_service.refusals import QuotaUsedUp
from bentray_service.storage.files import Files
from bentray_service.storage.tenants import LOCAL, Tenant

HDF5 = {"Content-Type": "application/x-hdf5"}


def test_to_the_last_byte(tmp_path):
    files = Files(tmp_path)
    mine = files.of(LOCAL)
    (files.of(Tenant("other")).root / "volumes" / "x").write_bytes(bytes(5000))
    (mine.root / "fields" / "deep").mkdir()
    (mine.root / "fields" / "deep" / "x").write_bytes(bytes(900))
    check_room(mine, 1000, 100)
    with pytest.raises(QuotaUsedUp, match="900 bytes stored, 101 more"):
        check_room(mine, 1000, 101)


def test_uploads_and_jobs_beyond_it_are_refused_and_leave_nothing(
    start, scan, uploaded, submitted, until, work
):
    content = scan().read_bytes()
    http = start(max_tenant_bytes=int(1.5 * len(content)))
    dataset = uploaded(http)
    files = http.app.state.parts.files.of(LOCAL)

    def in_pieces():
        yield content

    for body in (content, in_pieces()):
        answer = http.post("/v1/datasets", content=body, headers=HDF5)
        assert (answer.status_code, answer.json()["type"]) == (507, "/problems/quota-used-up")
        assert "BENTRAY_MAX_TENANT_BYTES" in answer.json()["accepted"]
    tus = {"Tus-Resumable": "1.0.0", "Upload-Length": str(len(content))}
    assert http.post("/v1/uploads", headers=tus).status_code == 507
    assert not list((files.root / "incoming").iterdir())
    assert len(http.get("/v1/datasets").json()["datasets"]) == 1
    submitted(http, dataset)
    (files.root / "exports" / "filler").write_bytes(bytes(len(content)))
    answer = http.post("/v1/jobs", json={"kind": "reconstruction", "dataset": dataset})
    assert answer.status_code == 507

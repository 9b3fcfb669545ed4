"""/v1/uploads: every part of tus 1.0, and the fate of received bytes."""

import base64
import hashlib
import os
import time
from email.utils import parsedate_to_datetime

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sqlalchemy import update

from bentray_service.ingest.upload_ingest import UploadLimits
from bentray_service.rows.tables import ExpiredRow, UploadRow

from ...conftest import NoProjects, npy
from ...tus_records import PIECE, TUS, settled


def metadata(**said):
    return ",".join(f"{name} {base64.b64encode(text.encode()).decode()}" for name, text in said.items())


def begin(http, length, **said):
    headers = {**TUS, "Upload-Length": str(length), **({"Upload-Metadata": metadata(**said)} if said else {})}
    answer = http.post("/v1/uploads", headers=headers)
    assert answer.status_code == 201, answer.text
    return answer.headers["location"]


def piece(http, location, offset, content, **headers):
    return http.patch(location, headers={**PIECE, "Upload-Offset": str(offset), **headers}, content=content)


def offset(http, location):
    return int(http.head(location, headers=TUS).headers["upload-offset"])


def problem(answer, status):
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.headers["tus-resumable"] == "1.0.0"
    return answer.json()


def left_in(http):
    root = http.app.state.stores.files.root
    return sorted(path.name for name in ("uploads", "incoming") for path in root.glob(f"tenants/*/{name}/*"))


def test_options_lists_supported_extensions(start):
    answer = start(max_upload_bytes=12345).options("/v1/uploads")
    assert answer.status_code == 204
    assert answer.headers["tus-version"] == answer.headers["tus-resumable"] == "1.0.0"
    assert answer.headers["tus-extension"] == "creation,checksum,expiration,termination"
    assert answer.headers["tus-max-size"] == "12345"
    assert answer.headers["tus-checksum-algorithm"] == "sha256,sha1,md5"


def test_a_scan_in_pieces_becomes_a_dataset(http, scan, submitted, until, work):
    content = scan().read_bytes()
    location = begin(http, len(content), filename="scan.h5", odd="ü")
    assert http.get(location).json()["state"] == "receiving"
    at = 0
    for end in (1000, 1001, 5000, len(content)):
        answer = piece(http, location, at, content[at:end])
        assert (answer.status_code, answer.headers["upload-offset"]) == (204, str(end))
        at = end
    record = settled(http, location)
    assert (record["state"], record["offset"], record["problem"]) == ("done", len(content), None)
    dataset = http.get(record["links"]["result"]).json()
    assert dataset["id"] == record["result"]
    assert dataset["title"] == "Sixteen elements"
    assert (dataset["bytes"], dataset["sha256"]) == (len(content), hashlib.sha256(content).hexdigest())
    head = http.head(location, headers=TUS)
    assert head.headers["bentray-result"] == f"/v1/datasets/{dataset['id']}"
    assert (head.headers["upload-offset"], head.headers["upload-length"]) == (str(len(content)),) * 2
    assert head.headers["upload-metadata"] == metadata(filename="scan.h5", odd="ü")
    assert head.headers["cache-control"] == "no-store"
    assert left_in(http) == []
    # The dataset can be reconstructed, and outlives its upload.
    assert http.delete(location, headers=TUS).status_code == 204
    assert until(http, submitted(http, dataset["id"])["id"])["state"] == "succeeded"


def test_volumes_and_meshes_too(http):
    def sent(content, **said):
        location = begin(http, len(content), **said)
        piece(http, location, 0, content)
        return http.get(settled(http, location)["links"]["result"]).json()

    values = npy(np.arange(60.0).reshape(3, 4, 5))
    volume = sent(values, kind="volume", title="A head", spacing_m="0.002")
    assert (volume["title"], volume["spacing_m"]) == ("A head", [0.002] * 3)
    tetra = b"OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n"
    mesh = sent(tetra, kind="mesh", filename=r"C:\meshes\Tetra")
    assert (mesh["title"], mesh["vertices"], mesh["faces"]) == ("Tetra", 4, 4)


def test_rejects_unreadable_uploads_with_a_problem(start, scan):
    def spoil(file):
        file["geometry/element_position_m"][5] = np.nan

    http, content = start(), scan(spoil).read_bytes()
    location = begin(http, len(content))
    piece(http, location, 0, content)
    record = settled(http, location)
    assert (record["state"], record["result"]) == ("refused", None)
    assert record["problem"]["field"] == "geometry/element_position_m"
    assert record["problem"]["instance"] == location
    assert http.get("/v1/datasets").json() == {"datasets": [], "next": None}
    assert left_in(http) == []


@given(cuts=st.lists(st.integers(0, 6000), max_size=6), wrong=st.integers(1, 5000))
@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_chunk_offset_must_match(start, cuts, wrong):
    http = start(folder=f"data-{time.monotonic_ns()}")
    content, at = os.urandom(6001), 0
    location = begin(http, len(content))
    for end in sorted(cuts):
        body = problem(piece(http, location, at + wrong, content[at:end]), 409)
        assert (body["type"], body["field"], body["found"]) == (
            "/problems/wrong-offset",
            "Upload-Offset",
            str(at + wrong),
        )
        assert piece(http, location, at, content[at:end]).status_code == 204
        at = end
        assert offset(http, location) == at
    files = http.app.state.stores.files
    stored = next(files.root.glob("tenants/*/uploads/*"), None)
    assert (b"" if stored is None else stored.read_bytes()) == content[:at]


@pytest.mark.parametrize("algorithm", ["sha256", "sha1", "md5"])
def test_checksums(http, algorithm):
    location = begin(http, 100)
    digest = base64.b64encode(hashlib.new(algorithm, b"right").digest()).decode()
    header = {"Upload-Checksum": f"{algorithm} {digest}"}
    body = problem(piece(http, location, 0, b"wrong", **header), 460)
    # tests/service/schema_checks.py names the field too.
    assert (body["type"], body["field"]) == ("/problems/wrong-checksum", "body")
    assert offset(http, location) == 0
    assert piece(http, location, 0, b"right", **header).status_code == 204
    assert offset(http, location) == 5
    body = problem(piece(http, location, 5, b"x", **{"Upload-Checksum": "crc32 AAAA"}), 400)
    assert (body["field"], body["accepted"]) == ("Upload-Checksum", "sha256 or sha1 or md5")


def test_protocol_version_header_is_required(http):
    location = begin(http, 10)
    for answer in (
        http.post("/v1/uploads", headers={"Tus-Resumable": "0.2.2", "Upload-Length": "9"}),
        http.head(location, headers={"Tus-Resumable": "2.0.0"}),
        http.delete(location, headers={"Tus-Resumable": "2.0.0"}),
        piece(http, location, 0, b"x", **{"Tus-Resumable": "2.0.0"}),
    ):
        assert (answer.status_code, answer.headers["tus-version"]) == (412, "1.0.0")
    body = problem(http.patch(location, headers={**TUS, "Upload-Offset": "0"}, content=b"x"), 415)
    assert body["accepted"] == "application/offset+octet-stream"
    assert http.get(location).json()["offset"] == 0


@pytest.mark.parametrize("length", ["", "0", "-1", "many", str(2**64)])
def test_a_length_must_be_given(start, length):
    body = problem(start().post("/v1/uploads", headers={**TUS, "Upload-Length": length}), 422)
    assert body["field"] == "upload-length"


def test_oversize_is_rejected_at_creation(start, monkeypatch):
    http = start(max_upload_bytes=1000)
    body = problem(http.post("/v1/uploads", headers={**TUS, "Upload-Length": "1001"}), 413)
    assert "1000" in body["accepted"]
    http = start("another", max_upload_bytes=2**60)
    body = problem(http.post("/v1/uploads", headers={**TUS, "Upload-Length": str(2**59)}), 507)
    assert "free" in body["accepted"]


def test_chunk_beyond_the_length_is_rejected(http):
    location = begin(http, 10)
    assert piece(http, location, 0, b"1234").status_code == 204
    problem(piece(http, location, 4, b"5678901"), 413)
    assert offset(http, location) == 4
    problem(piece(http, location, 4, iter([b"567", b"8901"])), 413)
    assert offset(http, location) in (4, 7)


@pytest.mark.parametrize(
    ("said", "field"),
    [
        ("kind c29tZXRoaW5n", "Upload-Metadata kind"),
        ("kind !", "Upload-Metadata"),
        ("title /w==", "Upload-Metadata"),
        ("kind dm9sdW1l,spacing_m eA==", "spacing_m"),
        ("kind dm9sdW1l,shape MS41", "shape"),
    ],
)
def test_wrong_metadata_is_named(start, said, field):
    headers = {**TUS, "Upload-Length": "9", "Upload-Metadata": said}
    assert problem(start().post("/v1/uploads", headers=headers), 422)["field"] == field


def test_termination_removes_the_upload(http):
    location = begin(http, 10)
    piece(http, location, 0, b"123")
    assert len(left_in(http)) == 1
    assert http.delete(location, headers=TUS).status_code == 204
    assert left_in(http) == []
    for answer in (
        http.get(location),
        http.head(location, headers=TUS),
        http.delete(location, headers=TUS),
        piece(http, location, 3, b"4"),
    ):
        assert answer.status_code == 404
    location = begin(http, 10)
    assert http.post(location, headers={**TUS, "X-HTTP-Method-Override": "DELETE"}).status_code == 204
    assert http.get(location).status_code == 404


def test_expired_uploads_are_swept(start):
    http = start(upload_keep_s=1000.0)
    state = http.app.state
    old, young, held = (begin(http, 10) for _ in range(3))
    for place in (old, young, held):
        answer = piece(http, place, 0, b"123")
        left = parsedate_to_datetime(answer.headers["upload-expires"]).timestamp() - time.time()
        assert 900 < left <= 1001
    with state.stores.database.write() as connection:
        connection.execute(
            update(UploadRow)
            .where(UploadRow.id.in_([old.rpartition("/")[2], held.rpartition("/")[2]]))
            .values(expires=time.time() - 1)
        )
    state.background.housekeeper.sweep()
    assert http.get(old).status_code == 200, "it is marked first: the clock may be wrong"
    with state.stores.database.write() as connection:
        connection.execute(update(ExpiredRow).values(noticed_s=-1001.0))
    with state.background.ingest.locks(held.rpartition("/")[2]):
        state.background.housekeeper.sweep()
    assert [http.get(place).status_code for place in (old, young, held)] == [404, 200, 200]
    assert len(left_in(http)) == 2


def test_one_writer_at_a_time(http):
    location = begin(http, 10)
    with http.app.state.background.ingest.locks(location.rpartition("/")[2]):
        assert problem(piece(http, location, 0, b"x"), 423)["type"] == "/problems/locked"
        problem(http.delete(location, headers=TUS), 423)
        assert offset(http, location) == 0
    assert piece(http, location, 0, b"x").status_code == 204


@pytest.mark.parametrize("upload", ["up-" + "0" * 20, "nonsense", "..%2f..%2fetc%2fpasswd", "ds-" + "0" * 20])
def test_unknown_and_hostile_ids(http, upload):
    assert http.head(f"/v1/uploads/{upload}", headers=TUS).status_code == 404
    problem(http.get(f"/v1/uploads/{upload}"), 404)
    problem(piece(http, f"/v1/uploads/{upload}", 0, b"x"), 404)


def test_upload_resumes_after_a_restart(start, scan):
    content = scan().read_bytes()
    http = start()
    location = begin(http, len(content))
    piece(http, location, 0, content[:3000])
    http.__exit__()
    http = start()
    assert offset(http, location) == 3000
    piece(http, location, 3000, content[3000:])
    assert settled(http, location)["state"] == "done"


@pytest.mark.parametrize("state", ["receiving", "reading"])
def test_complete_uploads_are_ingested_at_the_next_start(start, scan, state):
    """Death after the last byte, before that was stored; and while it was read, with half a file left."""
    content = scan().read_bytes()
    http = start()
    location = begin(http, len(content))
    row = http.app.state.background.ingest.uploads.in_state("receiving")[0]
    files = http.app.state.stores.files.of("local")
    http.app.state.background.ingest.stop()
    files.upload(row.id).write_bytes(content)
    files.candidate(row.result_id).write_bytes(content[:500])
    if state == "reading":
        http.app.state.background.ingest.uploads.change(row.id, state="reading")
    http.__exit__()
    http = start()
    assert settled(http, location)["result"] == row.result_id
    assert http.get(f"/v1/datasets/{row.result_id}").json()["elements"] == 16
    assert left_in(http) == []


def test_stored_uploads_are_not_ingested_twice(start, scan):
    content = scan().read_bytes()
    http = start()
    location = begin(http, len(content))
    piece(http, location, 0, content)
    done = settled(http, location)
    upload = location.rpartition("/")[2]
    http.__exit__()
    http = start()
    http.app.state.background.ingest.uploads.change(upload, state="reading")
    http.app.state.background.ingest.notify()
    assert settled(http, location)["result"] == done["result"]
    assert len(http.get("/v1/datasets").json()["datasets"]) == 1


def test_unverified_bytes_are_dropped_after_a_kill(start):
    http = start()
    location = begin(http, 100)
    piece(http, location, 0, b"verified")
    stored = http.app.state.stores.files.of("local").upload(location.rpartition("/")[2])
    http.__exit__()
    # As a kill within a piece with a checksum leaves it.
    stored.write_bytes(b"verified" + b"not verified")
    stored.with_name(f"{stored.name}.unverified").write_text("8")
    http = start()
    assert offset(http, location) == 8
    assert stored.read_bytes() == b"verified"
    assert piece(http, location, 8, b" piece").headers["upload-offset"] == "14"
    assert left_in(http) == [stored.name]


def test_uploads_are_begun_no_faster_than_allowed(http):
    http.app.state.background.ingest.upload_limits = UploadLimits(NoProjects(), begun_per_minute=2)
    answers = [http.post("/v1/uploads", headers={**TUS, "Upload-Length": "9"}) for _ in range(3)]
    assert [answer.status_code for answer in answers] == [201, 201, 429]
    assert problem(answers[2], 429)["field"] == "uploads"
    assert 1 <= int(answers[2].headers["retry-after"]) <= 30

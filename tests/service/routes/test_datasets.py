"""/v1/datasets: accepted and rejected uploads, downloads, search and deletion."""

import hashlib
from itertools import chain

import h5py
import numpy as np
import pytest
from sqlalchemy import insert

from bentray_service.rows.ids import LOCAL
from bentray_service.rows.tables import DatasetRow
from bentray_workers.files.dataset import read_dataset

from ..conftest import HDF5, refused


def upload(http, content, headers=HDF5):
    return http.post("/v1/datasets", content=content, headers=headers)


@pytest.mark.parametrize(
    ("disposition", "title"),
    [
        ('attachment; filename="/scans/left breast.h5"', "left breast.h5"),
        ("filename=left.h5", "left.h5"),
        ("attachment; filename*=UTF-8''linke%20Br%C3%BCste.h5", "linke Brüste.h5"),
        ('attachment; filename="linke Brüste.h5"'.encode(), "linke Brüste.h5"),
        ("attachment; filename*=idna''%ff", ""),
        (";;=", ""),
    ],
)
def test_the_title_of_a_file_without_one_is_its_name(start, scan, disposition, title):
    http, headers = start(), {"Content-Disposition": disposition, "Content-Type": "application/x-hdf5"}
    untitled = scan(lambda file: file.attrs.pop("title")).read_bytes()
    assert http.post("/v1/datasets", content=untitled, headers=headers).json()["title"] == title
    if title == "left.h5":
        own = http.post("/v1/datasets", content=scan().read_bytes(), headers=headers)
        assert own.json()["title"] == "Sixteen elements"


def test_upload_answers_with_the_record_and_keeps_the_canonical_file(http, scan):
    content = scan().read_bytes()
    answer = upload(http, content)
    body = answer.json()
    assert answer.status_code == 201
    assert answer.headers["location"] == f"/v1/datasets/{body['id']}" == body["links"]["self"]
    assert body["title"] == "Sixteen elements"
    assert (body["elements"], body["ntx"], body["nrx"], body["slices"]) == (16, 16, 16, 1)
    assert (body["has_traces"], body["has_travel_times"], body["has_truth"]) == (False, True, False)
    assert (body["bytes"], body["sha256"]) == (len(content), hashlib.sha256(content).hexdigest())
    assert http.get(answer.headers["location"]).json() == body
    assert http.get("/v1/datasets").json() == {"datasets": [body], "next": None}
    root = http.app.state.stores.files.of(LOCAL).root
    assert [path.name for path in (root / "datasets").iterdir()] == [f"{body['id']}.h5"]
    assert not list((root / "incoming").iterdir())
    assert h5py.is_hdf5(root / "datasets" / f"{body['id']}.h5")


def test_dataset_download_can_be_resumed(http, scan, tmp_path):
    dataset = upload(http, scan().read_bytes()).json()
    here = dataset["links"]["file"]
    whole = http.get(here)
    assert (whole.status_code, whole.headers["content-type"]) == (200, "application/x-hdf5")
    assert f'filename="{dataset["id"]}.h5"' in whole.headers["content-disposition"]
    (tmp_path / "back.h5").write_bytes(whole.content)
    found, sent = read_dataset(tmp_path / "back.h5"), read_dataset(scan())
    np.testing.assert_array_equal(found.delta_tof_s, sent.delta_tof_s)
    np.testing.assert_array_equal(found.element_position_m, sent.element_position_m)
    rest = http.get(here, headers={"Range": "bytes=1000-", "If-Range": whole.headers["etag"]})
    assert (rest.status_code, rest.content) == (206, whole.content[1000:])
    assert http.get(here, headers={"If-None-Match": whole.headers["etag"]}).status_code == 304
    assert http.head(here).headers["content-length"] == str(len(whole.content))
    assert http.delete(dataset["links"]["self"]).status_code == 204
    refused(http.get(here), "dataset", status=404)


def nan_position(file):
    file["geometry/element_position_m"][5] = np.nan


def negative_speed(file):
    file["water"].attrs["sound_speed_mps"] = -1500.0


@pytest.mark.parametrize(
    ("content", "field", "kind"),
    [
        (nan_position, "geometry/element_position_m", "invalid-input"),
        (negative_speed, "water@sound_speed_mps", "invalid-input"),
        (b"P5 2 2 255 this is a picture", "file", "invalid-input"),
        (b"", "body", "empty-body"),
        (iter([]), "body", "empty-body"),
    ],
)
def test_bad_contents_are_named(http, scan, content, field, kind):
    body = refused(upload(http, scan(content).read_bytes() if callable(content) else content), field)
    assert body["type"] == f"/problems/{kind}"
    assert field != "file" or "HDF5" in body["detail"]
    assert http.get("/v1/datasets").json() == {"datasets": [], "next": None}
    root = http.app.state.stores.files.of(LOCAL).root
    assert not list((root / "incoming").iterdir())
    assert not list((root / "datasets").iterdir())


FORM = {"Content-Type": "application/x-www-form-urlencoded"}


# A page of another site can send a form, or a body without a type, and its browser does not ask before.
@pytest.mark.parametrize(
    ("headers", "taken"),
    [
        ({}, True),
        (FORM, True),
        ({"Content-Type": "Application/Octet-Stream; charset=binary"}, True),
        ({"Content-Type": "image/png"}, False),
        ({"Origin": "http://localhost:3000"}, False),
        ({"Origin": "http://localhost:3000", **FORM}, False),
    ],
)
def test_a_file_needs_no_media_type_but_a_wrong_one_is_told_the_right(http, scan, headers, taken):
    answer = upload(http, scan().read_bytes(), headers)
    if taken:
        assert answer.status_code == 201, answer.text
    else:
        problem = refused(answer, "Content-Type", status=415)
        assert problem["accepted"] == "application/x-hdf5 or application/octet-stream"


def chunks():
    for _ in range(100):
        yield b"\0" * 1000


@pytest.mark.parametrize("content", [b"\0" * 100_000, chunks()], ids=["announced", "while reading"])
def test_too_large(start, content):
    http = start(max_upload_bytes=50_000)
    assert refused(upload(http, content), "body", "50000", status=413)["type"] == "/problems/too-large"
    assert not list((http.app.state.stores.files.of(LOCAL).root / "incoming").iterdir())


def test_a_file_larger_than_a_batch_arrives_whole(start, scan):
    def pad(file):
        file["padding"] = np.random.default_rng(0).integers(0, 256, 9_000_000, dtype=np.uint8)

    content = scan(pad).read_bytes()
    answer = upload(start(), content)
    assert answer.status_code == 201
    assert answer.json()["sha256"] == hashlib.sha256(content).hexdigest()


def test_a_thousand_scans_are_searched_and_read_in_pages(http, uploaded):
    stored = http.app.state.stores.datasets
    first = uploaded(http)
    row = {name: value for name, value in stored.get(LOCAL, first).values().items() if name != "number"}
    copies = [
        {**row, "id": f"ds-{k:020x}", "name": f"Visit {k}", "notes": "100 %" if k == 700 else "left_side"}
        for k in range(1000)
    ]
    other = {**row, "id": "ds-" + "f" * 20, "name": "Visit 999 of another", "tenant": "other"}
    with stored._database.write() as connection:
        connection.execute(insert(DatasetRow), [*copies, other])

    def pages(address):
        while address:
            page = http.get(address).json()
            yield [one["id"] for one in page["datasets"]]
            address = page["next"]

    found = list(pages("/v1/datasets?limit=400"))
    assert [len(page) for page in found] == [400, 400, 201]
    assert [*chain(*found)] == [one["id"] for one in reversed(copies)] + [first]
    visits = list(pages("/v1/datasets?text=vISIT 99&limit=4"))
    assert [*chain(*visits)] == [f"ds-{k:020x}" for k in (*range(999, 989, -1), 99)]
    assert [len(page) for page in visits] == [4, 4, 3]
    # By notes, by the title of the file and by the id; no character is a pattern.
    assert list(pages("/v1/datasets?text=100 %25")) == [[f"ds-{700:020x}"]]
    assert list(pages("/v1/datasets?text=left%25side")) == [[]]
    assert len(http.get("/v1/datasets?text=sixteen&limit=1000").json()["datasets"]) == 1000
    assert list(pages(f"/v1/datasets?text={first}")) == [[first]]
    assert http.get("/v1/datasets?before=ds-00000000000000000bad").status_code == 404


def test_a_scan_and_its_result_are_gone(http, uploaded, submitted, until, work):
    dataset = uploaded(http)
    done = until(http, submitted(http, dataset)["id"])
    http.get(done["links"]["data"], params={"format": "npy"})
    assert http.delete(f"/v1/datasets/{dataset}").status_code == 204
    for place in (f"/v1/datasets/{dataset}", done["links"]["self"], done["links"]["volume"]):
        assert http.get(place).status_code == 404
    root = http.app.state.stores.files.root
    assert [path.name for path in root.glob("tenants/**/*") if path.is_file()] == []


def test_while_a_job_needs_it_it_stays(http, running, until):
    job = running(http)
    answer = http.delete(f"/v1/datasets/{job['dataset']}")
    assert (answer.status_code, answer.json()["type"]) == (409, "/problems/in-use")
    assert job["id"] in answer.json()["found"]
    http.post(f"/v1/jobs/{job['id']}/cancel")
    until(http, job["id"], "cancelled")
    assert http.delete(f"/v1/datasets/{job['dataset']}").status_code == 204

"""/v1/volumes: uploads, metadata, pictures and files."""

import gzip
import hashlib
import io

import h5py
import nibabel
import numpy as np
import pytest

from bentray_service.rows.ids import LOCAL

from ..conftest import STREAM, npy, refused

pytestmark = pytest.mark.usefixtures("work")


@pytest.fixture
def job(http, uploaded, submitted, until):
    return until(http, submitted(http, uploaded(http))["id"])


@pytest.fixture
def here(job):
    return f"/v1/volumes/{job['volume']}"


def test_metadata(http, job, here):
    body = http.get(here).json()
    assert (body["job"], body["dataset"]) == (job["id"], job["dataset"])
    assert (body["axes"], body["shape"], body["spacing_m"]) == ("x,y", [16, 16], [1e-3, 1e-3])
    assert body["bytes"] > 0


def test_picture_is_drawn_in_the_render_lane(http, here, cluster):
    answer = http.get(f"{here}/slice.png", params={"low": 1490, "high": 1550, "colormap": "magma"})
    assert answer.headers["content-type"] == "image/png"
    assert answer.content.startswith(b"\x89PNG")
    how = cluster.submitted[-1]
    assert how["resources"] == {"render": 1}
    assert (how["low"], how["high"], how["colormap"], how["quantity"]) == (1490, 1550, "magma", "speed")


@pytest.mark.parametrize(
    ("query", "field"),
    [
        ("index=1", "index"),
        ("quantity=attenuation", "quantity"),
        ("quantity=value", "quantity"),
        ("low=1600&high=1500", "low"),
    ],
)
def test_wrong_picture(http, here, query, field):
    refused(http.get(f"{here}/slice.png?{query}"), field)


def test_files(http, job, here):
    answer = http.get(f"{here}/data")
    assert answer.headers["content-disposition"] == f'attachment; filename="{job["volume"]}.h5"'
    with h5py.File(io.BytesIO(answer.content)) as file:
        values = file["speed_mps"][()]
    # Made, and kept.
    for _ in range(2):
        answer = http.get(f"{here}/data?format=npy")
        assert answer.headers["content-disposition"] == f'attachment; filename="{job["volume"]}-speed.npy"'
        np.testing.assert_array_equal(np.load(io.BytesIO(answer.content)), values)
        answer = http.get(f"{here}/data?format=nifti")
        assert answer.headers["content-disposition"] == f'attachment; filename="{job["volume"]}-speed.nii"'
        image = nibabel.Nifti1Image.from_bytes(answer.content)
        np.testing.assert_array_equal(image.get_fdata(), values)
        np.testing.assert_allclose(np.diag(image.affine)[:2], 1.0)


@pytest.mark.parametrize(("form", "ends"), [("nifti", "-values.nii"), ("hdf5", ".h5")])
def test_an_uploaded_volume_comes_back_and_goes_in_again(http, form, ends):
    first = send(http, npy(RAMP), "?title=once&spacing_m=0.001,0.002,0.003").json()
    answer = http.get(f"{first['links']['data']}?format={form}")
    assert answer.headers["content-disposition"].endswith(f'"{first["id"]}{ends}"')
    second = send(http, answer.content).json()
    kept = ("title", "shape", "value_range")
    assert [second[name] for name in kept] == [first[name] for name in kept]
    np.testing.assert_allclose(second["spacing_m"], first["spacing_m"], rtol=1e-6)
    np.testing.assert_allclose(second["origin_m"], first["origin_m"], atol=1e-9)


def test_wrong_format(http, here):
    forms = "'hdf5', 'npy', 'nifti', 'nrrd', 'metaimage', 'mat', 'vti', 'ome-zarr', 'dicom' or 'h5'"
    assert refused(http.get(f"{here}/data?format=jpeg"), "format")["accepted"] == forms


RAMP = np.arange(60, dtype=np.uint8).reshape(3, 4, 5)


def send(http, content, query="", headers=STREAM):
    return http.post(f"/v1/volumes{query}", content=content, headers=headers)


def test_an_uploaded_volume_is_stored(http):
    answer = send(http, npy(RAMP), "?title=A%20head%00&spacing_m=0.001,0.002,0.003")
    body = answer.json()
    assert answer.status_code == 201, body
    assert answer.headers["location"] == f"/v1/volumes/{body['id']}" == body["links"]["self"]
    assert (body["source"], body["title"], body["axes"]) == ("upload", "A head", "x,y,z")
    assert (body["shape"], body["spacing_m"], body["origin_m"]) == ([3, 4, 5], [1e-3, 2e-3, 3e-3], [0, 0, 0])
    assert (body["value_range"], body["unit"], body["speed_range_mps"]) == ([0, 59], "", None)
    assert (body["job"], body["dataset"], body["provenance"]) == (None, None, {})
    assert (body["bytes"], body["sha256"]) == (len(npy(RAMP)), hashlib.sha256(npy(RAMP)).hexdigest())
    assert http.get(answer.headers["location"]).json() == body
    root = http.app.state.stores.files.of(LOCAL).root
    assert [path.name for path in (root / "volumes").iterdir()] == [f"{body['id']}.h5"]
    assert not list((root / "incoming").iterdir())


def test_raw_bytes(http):
    body = send(http, RAMP.tobytes(order="F"), "?shape=3,4,5&dtype=uint8").json()
    answer = http.get(f"{body['links']['data']}?format=npy")
    assert answer.headers["content-disposition"].endswith(f'"{body["id"]}-values.npy"')
    np.testing.assert_array_equal(np.load(io.BytesIO(answer.content)), RAMP)
    with h5py.File(io.BytesIO(http.get(body["links"]["data"]).content)) as file:
        np.testing.assert_array_equal(file["values"], RAMP)


def test_both_kinds_are_listed_newest_first(http, job):
    made = [send(http, npy(RAMP)).json()["id"] for _ in range(2)]
    listed = http.get("/v1/volumes").json()["volumes"]
    assert [one["id"] for one in listed] == [made[1], made[0], job["volume"]]
    assert [one["source"] for one in listed] == ["upload", "upload", "reconstruction"]
    assert (listed[2]["title"], listed[2]["unit"]) == ("Sixteen elements", "m/s")
    assert listed[2]["value_range"] == listed[2]["speed_range_mps"] == [1500.0, 1540.0]
    assert [one["id"] for one in http.get("/v1/volumes?limit=1").json()["volumes"]] == [made[1]]


def test_slice_of_an_upload(http, cluster):
    body = send(http, npy(RAMP)).json()
    answer = http.get(body["links"]["image"], params={"index": 4, "quantity": "value", "high": 70})
    assert answer.content.startswith(b"\x89PNG")
    assert (cluster.submitted[-1]["index"], cluster.submitted[-1]["resources"]) == (4, {"render": 1})
    refused(http.get(f"{body['links']['image']}?low=99"), "low")


def test_rejected_volume_leaves_no_files(http):
    for content, query, field in (
        (b"no volume", "", "file"),
        (npy(np.full((2, 2, 2), np.nan)), "", "values"),
        (300 * gzip.compress(bytes(1_000_000)), "", "file"),
        (RAMP.tobytes(), "?shape=3,4,5", "dtype"),
        (RAMP.tobytes(), "?shape=wide&dtype=uint8", "shape"),
        (npy(RAMP), "?spacing_m=1,x,1", "spacing_m"),
        (npy(RAMP), "?spacing_m=nan", "spacing_m"),
        (npy(RAMP), f"?title={'x' * 201}", "title"),
        (b"", "", "body"),
    ):
        refused(send(http, content, query), field)
    assert http.get("/v1/volumes").json() == {"volumes": []}
    root = http.app.state.stores.files.of(LOCAL).root
    assert not list((root / "incoming").iterdir())
    assert not list((root / "volumes").iterdir())


def test_a_volume_of_the_wrong_media_type_or_size(start):
    http = start(max_upload_bytes=50)
    assert send(http, npy(RAMP)).status_code == 413
    assert send(http, b"x", headers={"Content-Type": "image/png"}).status_code == 415

"""/v1/volumes: metadata, pictures and files of a result."""

import io

import h5py
import numpy as np
import pytest


@pytest.fixture
def http(start, work):
    return start()


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


def test_a_known_picture_is_not_drawn_again(http, here, cluster):
    tag = http.get(f"{here}/slice.png").headers["etag"]
    drawn = len(cluster.submitted)
    again = http.get(f"{here}/slice.png", headers={"If-None-Match": tag})
    assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", tag)
    assert len(cluster.submitted) == drawn
    assert http.get(f"{here}/slice.png?low=1400", headers={"If-None-Match": tag}).status_code == 200


@pytest.mark.parametrize(
    ("query", "field"),
    [
        ("index=1", "index"),
        ("index=-1", "index"),
        ("quantity=colour", "quantity"),
        ("quantity=attenuation", "quantity"),
        ("quantity=recovery", "quantity"),
        ("colormap=nosuch", "colormap"),
        ("low=nan", "low"),
        ("low=1600&high=1500", "low"),
        ("high=bright", "high"),
    ],
)
def test_wrong_picture(http, here, query, field):
    answer = http.get(f"{here}/slice.png?{query}")
    assert answer.status_code == 422
    assert field in answer.json()["field"]
    assert answer.json()["accepted"]


def test_hdf5(http, job, here):
    answer = http.get(f"{here}/data")
    assert answer.headers["content-disposition"] == f'attachment; filename="{job["volume"]}.h5"'
    with h5py.File(io.BytesIO(answer.content)) as file:
        assert file["speed_mps"].shape[:2] == (16, 16)


def test_npy(http, job, here):
    for _ in range(2):
        answer = http.get(f"{here}/data?format=npy")
        assert answer.headers["content-disposition"] == f'attachment; filename="{job["volume"]}-speed.npy"'
        assert np.load(io.BytesIO(answer.content)).shape == (16, 16)


def test_wrong_format(http, here):
    body = http.get(f"{here}/data?format=jpeg").json()
    assert (body["status"], body["field"], body["accepted"]) == (422, "format", "'hdf5' or 'npy'")


@pytest.mark.parametrize("volume", ["vol-" + "0" * 20, "nonsense", "..%2f..%2fetc"])
@pytest.mark.parametrize("part", ["", "/slice.png", "/data"])
def test_unknown_volume(http, volume, part):
    assert http.get(f"/v1/volumes/{volume}{part}").status_code == 404

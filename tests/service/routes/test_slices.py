"""/v1/volumes/{id}/slice.png: any axis and size; invalid requests are rejected before rendering."""

import io

import numpy as np
import pytest
from PIL import Image

STREAM = {"Content-Type": "application/octet-stream"}


@pytest.fixture
def here(http):
    """The picture of an uploaded volume."""
    buffer = io.BytesIO()
    np.save(buffer, np.arange(60, dtype=np.uint8).reshape(3, 4, 5))
    return http.post("/v1/volumes", content=buffer.getvalue(), headers=STREAM).json()["links"]["image"]


def test_every_axis_has_its_slices(http, here):
    sizes = {}
    for axis, last in (("x", 2), ("y", 3), ("z", 4)):
        asked = {"axis": axis, "index": last, "frame": False}
        answer = http.get(here, params=asked)
        assert answer.status_code == 200
        sizes[axis] = Image.open(io.BytesIO(answer.content)).size
        refused = http.get(here, params={**asked, "index": last + 1}).json()
        assert (refused["status"], refused["field"], refused["accepted"]) == (422, "index", f"0 to {last}")
    assert sizes == {"x": (4, 5), "y": (3, 5), "z": (3, 4)}


def test_every_parameter_changes_picture_and_etag(http, here):
    asked = [
        {},
        {"axis": "x"},
        {"size": 300},
        {"interpolation": "cubic"},
        {"scale_bar": True},
        {"colour_bar": False},
        {"frame": False},
    ]
    answers = [http.get(here, params=request) for request in asked]
    assert len({answer.content for answer in answers}) == len(asked)
    assert len({answer.headers["etag"] for answer in answers}) == len(asked)


@pytest.mark.parametrize(
    ("query", "field"),
    [
        ("size=100", "size"),
    ],
)
def test_refusals_need_no_worker(http, here, cluster, query, field):
    answer = http.get(f"{here}?{query}")
    assert (answer.status_code, answer.json()["field"]) == (422, field)
    assert not cluster.submitted

"""/v1/volumes/{id}/data: every format, and downloads that break off and go on."""

import io

import h5py
import numpy as np
import pytest
from scipy.io import loadmat

STREAM = {"Content-Type": "application/octet-stream"}
FORMATS = {"hdf5": "h5", "nifti": "nii", "metaimage": "mha", "mat": "mat", "npy": "npy"}


@pytest.fixture
def http(start, work):
    return start()


@pytest.fixture
def result(http, uploaded, submitted, until):
    """The data of a reconstruction."""
    return f"/v1/volumes/{until(http, submitted(http, uploaded(http))['id'])['volume']}/data"


@pytest.fixture
def upload(http):
    """The data of an uploaded volume."""
    buffer = io.BytesIO()
    np.save(buffer, np.arange(60, dtype=np.uint8).reshape(3, 4, 5))
    answer = http.post("/v1/volumes?title=A%20head", content=buffer.getvalue(), headers=STREAM)
    return answer.json()["links"]["data"]


def test_a_reconstruction_for_matlab(http, result):
    found = loadmat(io.BytesIO(http.get(f"{result}?format=mat").content))
    with h5py.File(io.BytesIO(http.get(result).content)) as file:
        for name in ("speed_mps", "coverage_m"):
            np.testing.assert_array_equal(found[name], file[name][()])
    np.testing.assert_allclose(found["spacing_m"], [[1e-3, 1e-3]])
    assert found["axes"].item() == "x,y"


def test_an_upload_for_matlab_and_itk(http, upload):
    found = loadmat(io.BytesIO(http.get(f"{upload}?format=mat").content))
    np.testing.assert_array_equal(found["values"].ravel(), np.arange(60))
    assert found["title"].item() == "A head"
    header, _, values = http.get(f"{upload}?format=metaimage").content.partition(b"ElementDataFile = LOCAL\n")
    assert b"DimSize = 3 4 5\n" in header
    np.testing.assert_array_equal(
        np.frombuffer(values, np.uint8).reshape((3, 4, 5), order="F").ravel(), np.arange(60)
    )


@pytest.mark.parametrize("kind", ["result", "upload"])
@pytest.mark.parametrize("asked", FORMATS)
def test_a_broken_download_goes_on(http, request, kind, asked):
    here = f"{request.getfixturevalue(kind)}?format={asked}"
    whole = http.get(here)
    assert whole.status_code == 200
    assert whole.headers["accept-ranges"] == "bytes"
    assert whole.headers["content-disposition"].endswith(f'.{FORMATS[asked]}"')
    tag = whole.headers["etag"]
    assert tag.startswith('"')
    rest = http.get(here, headers={"Range": "bytes=100-", "If-Range": tag})
    size = len(whole.content)
    assert (rest.status_code, rest.headers["etag"]) == (206, tag)
    assert rest.headers["content-range"] == f"bytes 100-{size - 1}/{size}"
    assert rest.content == whole.content[100:]
    head = http.head(here)
    assert (head.headers["etag"], head.headers["content-length"]) == (tag, str(size))
    known = http.get(here, headers={"If-None-Match": tag})
    assert (known.status_code, known.content, known.headers["etag"]) == (304, b"", tag)


def test_formats_have_tags_of_their_own(http, result):
    assert len({http.head(f"{result}?format={name}").headers["etag"] for name in FORMATS}) == len(FORMATS)


@pytest.mark.parametrize(
    ("part", "found"), [("bytes=0-0", slice(0, 1)), ("bytes=5-8", slice(5, 9)), ("bytes=-7", slice(-7, None))]
)
def test_parts(http, upload, part, found):
    whole = http.get(upload).content
    answer = http.get(upload, headers={"Range": part})
    assert (answer.status_code, answer.content) == (206, whole[found])


@pytest.mark.parametrize(
    "headers",
    [
        {"Range": "bytes=5-8", "If-Range": '"another"'},
        {"Range": "bytes=9999999-", "If-Range": '"another"'},
        {"Range": "bytes=5-8", "If-Range": "Sun, 06 Nov 1994 08:49:37 GMT"},
        {"Range": "bytes=0-1,4-5"},
        {"Range": "bytes=8-5"},
        {"Range": "bytes=-"},
        {"Range": "bytes=x"},
        {"Range": "pages=1-2"},
    ],
)
def test_what_is_no_part_of_this_file_is_answered_with_the_whole(http, upload, headers):
    answer = http.get(upload, headers=headers)
    assert (answer.status_code, answer.content) == (200, http.get(upload).content)


@pytest.mark.parametrize("part", ["bytes=99999999-", "bytes=-0", f"bytes={10**400}-"])
def test_a_part_beyond_the_end_is_refused(http, upload, part):
    size = len(http.get(upload).content)
    answer = http.get(upload, headers={"Range": part})
    body = answer.json()
    assert (answer.status_code, body["type"], body["field"]) == (416, "/problems/no-such-part", "Range")
    assert answer.headers["content-range"] == f"bytes */{size}"

"""/v1/volumes/{id}/data: every format, and resumed downloads."""

import io
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import h5py
import numpy as np
import pytest
from scipy.io import loadmat

from bentray_service.rows.ages import StoredItem
from bentray_service.rows.ids import LOCAL, new_id
from bentray_workers.files.export.registry import FORMATS
from bentray_workers.files.volume import Volume, write_volume

from ...memory_program import peak_of
from ..conftest import STREAM, FakeCluster, FakeFuture, npy, refused

pytestmark = pytest.mark.usefixtures("work")


@pytest.fixture
def result(http, uploaded, submitted, until):
    """The data of a reconstruction."""
    return f"/v1/volumes/{until(http, submitted(http, uploaded(http))['id'])['volume']}/data"


@pytest.fixture
def upload(http):
    """The data of an uploaded volume."""
    content = npy(np.arange(60, dtype=np.uint8).reshape(3, 4, 5))
    return http.post("/v1/volumes?title=A%20head", content=content, headers=STREAM).json()["links"]["data"]


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
def test_interrupted_download_can_be_resumed(http, request, kind):
    data = request.getfixturevalue(kind)
    for asked, form in FORMATS.items():
        here = f"{data}?format={asked}"
        whole = http.get(here)
        assert whole.status_code == 200
        assert whole.headers["accept-ranges"] == "bytes"
        assert whole.headers["content-disposition"].endswith(f'.{form.download_extension}"')
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


@pytest.mark.parametrize("asked", ["nifti", "metaimage", "mat", "npy"])
def test_head_request_does_not_export(http, upload, cluster, asked):
    here, begun = f"{upload}?format={asked}", len(cluster.submitted)
    head = http.head(here)
    assert (head.status_code, head.content) == (200, b"")
    assert "content-length" not in head.headers
    tag = head.headers["etag"]
    assert http.head(here, headers={"If-None-Match": tag}).status_code == 304
    assert len(cluster.submitted) == begun
    whole = http.get(here)
    same = ("etag", "content-type", "content-disposition", "cache-control", "accept-ranges")
    assert {name: whole.headers[name] for name in same} == {name: head.headers[name] for name in same}
    assert http.head(here).headers["content-length"] == str(len(whole.content))
    # Made once, in the render lane.
    assert len(cluster.submitted) == begun + 1
    assert cluster.submitted[-1]["resources"] == {"render": 1}


class OtherProcess(FakeCluster):
    """Tasks run in another process, as those of a worker do."""

    def __init__(self, pool):
        super().__init__()
        self.pool = pool

    def submit(self, task, *given, **how):
        for name in ("workers", "resources", "priority", "pure"):
            how.pop(name)
        return FakeFuture(self.pool.submit(task, *given, **how).result())


@pytest.mark.slow
def test_export_of_a_volume_deleted_meanwhile(http, upload, monkeypatch):
    state = http.app.state
    export = state.background.pictures.export

    async def delete_then(volume, *given):
        await export(volume, *given)
        state.stores.deletion.delete(StoredItem(volume.tenant, "volume", volume.id))

    monkeypatch.setattr(state.background.pictures, "export", delete_then)
    answer = http.get(f"{upload}?format=npy")
    assert (answer.status_code, answer.json()["type"]) == (404, "/problems/deleted")


def test_files_are_not_made_in_the_memory_of_the_service(start):
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        http = start(cluster=OtherProcess(pool))
        state, volume_id = http.app.state, new_id("volume")
        values = np.zeros((200, 200, 200), np.float32)
        write_volume(state.stores.files.of(LOCAL).volume(volume_id), Volume.from_values(values, (1e-3,) * 3))
        summary = {
            "title": "large",
            "shape": list(values.shape),
            "spacing_m": [1e-3] * 3,
            "origin_m": [0.0] * 3,
            "value_range": [0.0, 0.0],
        }
        state.stores.volumes.uploaded.add(
            LOCAL, volume_id, size=values.nbytes, sha256="0" * 64, summary=summary
        )
        del values
        for asked in ("npy", "nifti", "metaimage", "mat"):
            here = f"/v1/volumes/{volume_id}/data?format={asked}"
            answers = []
            # A part of it, for the test's own client holds whatever comes.
            get = partial(http.get, here, headers={"Range": "bytes=-100"})
            assert peak_of(lambda get=get, answers=answers: answers.append(get())) < 8 * 2**20
            assert answers[0].status_code == 206
            assert int(answers[0].headers["content-range"].rpartition("/")[2]) > 32_000_000


@pytest.mark.parametrize("name", ["npy", "nrrd"])
def test_an_export_of_an_earlier_version_is_made_again(http, result, name):
    """Those of NRRD, MetaImage and DICOM lay turned."""
    volume_id = result.split("/")[3]
    stored = http.app.state.stores.files.of(LOCAL).export(volume_id, name)
    stored.write_bytes(b"earlier")
    assert len(http.get(f"{result}?format={name}").content) > len(b"earlier")
    stored.unlink()


def test_formats_have_tags_of_their_own(http, result):
    assert len({http.head(f"{result}?format={name}").headers["etag"] for name in FORMATS}) == len(FORMATS)


@pytest.mark.parametrize(
    ("headers", "part"),
    [
        ({"Range": "bytes=0-0"}, slice(0, 1)),
        ({"Range": "bytes=5-8"}, slice(5, 9)),
        ({"Range": "bytes=-7"}, slice(-7, None)),
        # What is no part of this file is answered by the whole.
        ({"Range": "bytes=5-8", "If-Range": '"another"'}, None),
        ({"Range": "bytes=9999999-", "If-Range": '"another"'}, None),
        ({"Range": "bytes=5-8", "If-Range": "Sun, 06 Nov 1994 08:49:37 GMT"}, None),
        ({"Range": "bytes=0-1,4-5"}, None),
        ({"Range": "bytes=8-5"}, None),
        ({"Range": "bytes=-"}, None),
        ({"Range": "bytes=x"}, None),
        ({"Range": "pages=1-2"}, None),
    ],
)
def test_parts(http, upload, headers, part):
    whole, answer = http.get(upload).content, http.get(upload, headers=headers)
    expected = (200, whole) if part is None else (206, whole[part])
    assert (answer.status_code, answer.content) == expected


@pytest.mark.parametrize("part", ["bytes=99999999-", "bytes=-0", f"bytes={10**400}-"])
def test_a_part_beyond_the_end_is_rejected(http, upload, part):
    answer = http.get(upload, headers={"Range": part})
    assert refused(answer, "Range", status=416)["type"] == "/problems/no-such-part"
    assert answer.headers["content-range"] == f"bytes */{len(http.get(upload).content)}"


def test_quantity_and_unit_of_a_reconstruction(http, result, upload):
    both = {"quantity": "attenuation", "attenuation": "dB/cm/MHz"}
    # The simulated scan has no amplitudes, and an upload no quantities.
    for data in (result, upload):
        refused(http.get(data, params={"format": "npy", **both}), "quantity")
    assert http.get(result, params=both).json()["accepted"].startswith("speed and Np/m for hdf5")

    def exported(**more):
        return http.get(result, params={"format": "npy", **more})

    plain, decibel = exported(attenuation="Np/m"), exported(attenuation="dB/cm/MHz")
    assert plain.content == decibel.content
    stated = exported(attenuation="dB/cm/MHz", frequency_hz=4e5)
    assert len({one.headers["etag"] for one in (plain, decibel, stated)}) == 3
    # Np/m refers to no frequency.
    assert exported(frequency_hz=4e5).headers["etag"] == plain.headers["etag"]

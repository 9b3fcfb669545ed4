"""Limits over HTTP: oversize input is rejected before it is read; plans are made without opening a file."""

import math
import tracemalloc

import h5py
import numpy as np
import pytest
from sqlalchemy import text

from bentray_kernels.requests.limits import ELEMENTS, EMISSIONS, SAMPLES, SLICES
from bentray_service.ingest.ingest_process import convert_upload


def packed(path, shape, dtype="f8", chunk=None):
    """A change that puts an array of zeros there, packed well: it is large only once it is read."""

    def change(file):
        if path in file:
            del file[path]
        chunks = chunk or (min(shape[0], 2**22 // math.prod(shape[1:])), *shape[1:])
        made = file.create_dataset(path, shape, dtype, compression="gzip", chunks=chunks)
        # One chunk, as often as it is needed: to pack them all would take longer than to refuse them.
        made[: chunks[0]] = np.zeros((), dtype)
        mask, raw = made.id.read_direct_chunk((0,) * len(shape))
        for k in range(0, shape[0], chunks[0]):
            made.id.write_direct_chunk((k, *(0,) * (len(shape) - 1)), raw, mask)

    return change


@pytest.mark.parametrize(
    ("place", "shape", "said"),
    [
        ("geometry/element_position_m", (2**27, 2), f"134217728 elements.*at most {ELEMENTS.most}"),
        ("geometry/element_normal", (2**25, 2), f"33554432 elements.*at most {ELEMENTS.most}"),
        ("acquisition/tx", (2**25,), f"33554432 emissions.*at most {EMISSIONS.most}"),
        ("acquisition/rx", (70_000,), f"70000 receivers.*at most {EMISSIONS.most}"),
        ("slice/z_m", (5000,), f"5000 slices.*at most {SLICES.most}"),
        ("acquisition/wavelet", (2**24,), f"16777216 samples.*at most {SAMPLES.most}"),
        ("mask/valid", (2**20, 1024), "1073741824 pairs.*at most 536870912"),
    ],
)
def test_it_is_rejected_by_its_name_its_number_and_the_limit(scan, tmp_path, place, shape, said):
    path = scan(packed(place, shape, "i4" if place in ("acquisition/tx", "mask/valid") else "f8"))
    assert path.stat().st_size < 8 * 2**20
    tracemalloc.start()
    try:
        answer = convert_upload("dataset", path, tmp_path / "out.h5", {})
        # HDF5 reads by itself, but into arrays of NumPy, which are counted.
        assert tracemalloc.get_traced_memory()[1] < 8 * 2**20
    finally:
        tracemalloc.stop()
    error = answer["error"]
    assert error["field"] == place
    result, accepted = said.split(".*")
    assert error["found"].startswith(result)
    assert error["accepted"].startswith(accepted)
    assert not (tmp_path / "out.h5").exists()


def test_an_array_that_its_pairs_have_no_room_for_is_not_read(scan, tmp_path):
    path = scan(packed("traveltime/delta_tof_s", (4096, 4096), chunk=(512, 4096)))
    error = convert_upload("dataset", path, tmp_path / "out.h5", {})["error"]
    assert error == {
        "field": "traveltime/delta_tof_s",
        "found": "shape (4096, 4096)",
        "accepted": "shape (16, 16)",
    }


def test_a_job_is_planned_without_its_file(http, uploaded, submitted, work, monkeypatch):
    dataset = uploaded(http)

    def opened(*_):
        raise AssertionError("the file was opened")

    monkeypatch.setattr(h5py, "File", opened)
    plan = submitted(http, dataset)["plan"]
    assert plan["tasks"] > 0
    monkeypatch.undo()
    # Of one from before counts were kept the file is read.
    with http.app.state.stores.datasets._database.write() as connection:
        connection.execute(text("UPDATE datasets SET counts = NULL"))
    assert submitted(http, dataset)["plan"] == plan


@pytest.mark.parametrize("rate", [1e300, 1e-300, 5e-324, -1e6, 25.0])
def test_rejects_implausible_sampling_rates(scan, tmp_path, rate):
    def change(file):
        file["acquisition"].attrs["sampling_rate_hz"] = rate

    error = convert_upload("dataset", scan(change), tmp_path / "out.h5", {})["error"]
    assert error["field"] == "acquisition@sampling_rate_hz"
    assert error["accepted"].endswith("Hz")

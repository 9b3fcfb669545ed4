"""Estimated cost of pictures: at least the measured memory, and rejections that name what fits."""

import math
import multiprocessing

import numpy as np
import pytest
from benchmarks.reconstruction._worker_use import forget_peak, peak_bytes

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.request_fields import MAX_PIXELS
from bentray_workers.cluster.capacities import WorkerCapacity
from bentray_workers.files.volume import Volume, write_volume
from bentray_workers.files.volume_export import export_volume
from bentray_workers.images.drawing_tasks import volume_slice_png
from bentray_workers.rendering import picture_cost
from bentray_workers.rendering.field_view import FieldView
from bentray_workers.rendering.picture_cost import (
    Cost,
    VolumeFile,
    check_memory,
    field_cost,
    placed,
    refraction_cost,
)
from bentray_workers.rendering.refraction import tile_image
from bentray_workers.rendering.refraction_view import RefractionView

GIB = 2**30
LANES = ("recon", "render")


def test_a_large_picture_of_smooth_glass_is_taken_and_a_deep_one_refused():
    stored = VolumeFile((128, 128, 128), 4)
    large = RefractionView(width=MAX_PIXELS, height=MAX_PIXELS)
    assert refraction_cost(stored, large).seconds < picture_cost.MAX_SECONDS + 1.0
    with pytest.raises(InvalidInput, match=r"width, height, depth: .* or submit a job of kind `refraction`"):
        refraction_cost(stored, RefractionView(width=MAX_PIXELS, height=MAX_PIXELS, depth=256))
    # What is named as the largest is taken.
    with pytest.raises(InvalidInput) as refused:
        refraction_cost(stored, RefractionView(width=4000, height=2000, depth=200))
    width, height = (
        int(part.split()[-1]) for part in refused.value.accepted.split(" pixels")[0].split(" x ")
    )
    assert width / height == pytest.approx(2.0, rel=0.01)
    refraction_cost(stored, RefractionView(width=width, height=height, depth=200))


def test_default_pictures_of_the_page_are_accepted():
    page = field_cost({}, FieldView(width=512, height=512, rays=2))
    assert page.seconds < 5.0
    assert field_cost({}, FieldView(width=MAX_PIXELS, height=MAX_PIXELS)).seconds < picture_cost.MAX_SECONDS
    with pytest.raises(InvalidInput, match=r"width, height, rays, depth: .* or a smaller depth"):
        field_cost({}, FieldView(width=MAX_PIXELS, height=MAX_PIXELS, depth=64))


def test_cost_grows_with_every_parameter():
    stored, view = VolumeFile((64, 64, 64), 4), RefractionView
    usual = refraction_cost(stored, view()).seconds
    for more in (
        view(width=1024),
        view(depth=64),
        view(supersampling="real", degree=2),
        view(filter="bspline6"),
    ):
        assert refraction_cost(stored, more).seconds > usual
    assert refraction_cost(stored, view(mode="shaded")).seconds < usual


def test_rejects_pictures_larger_than_worker_memory():
    offers = [WorkerCapacity(GIB, LANES), WorkerCapacity(2 * GIB, LANES)]
    room = math.floor(offers[1].task_bytes)
    check_memory("volume", "it", Cost(1.0, room), offers)
    with pytest.raises(
        InvalidInput, match=rf"volume: found it, which takes {room + 1} bytes .* {room} bytes"
    ):
        check_memory("volume", "it", Cost(1.0, room + 1), offers)
    check_memory("volume", "it", Cost(1.0, 2**60), [])
    check_memory("volume", "it", Cost(1.0, 2**60), [WorkerCapacity(0, LANES)])


def test_eligible_workers_of_a_turntable():
    workers = {"small": WorkerCapacity(GIB, LANES), "large": WorkerCapacity(8 * GIB, LANES)}
    assert placed(2**20, workers) == {"resources": {"render": 1}}
    assert placed(GIB, workers) == {"resources": {"render": 1, "recon": 1}, "workers": ["large"]}
    assert placed(GIB, {"any": WorkerCapacity(0, LANES)}) == {"resources": {"render": 1}}


def taken(work, *given) -> int:
    """Bytes that a call takes beyond those of a process that has made a small one, in a new process."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return int(pool.apply(_peak, (work, given)))


def _peak(work, given) -> int:
    small, *rest = given
    _call(work, *small)
    forget_peak()
    before = peak_bytes()
    _call(work, *rest)
    return peak_bytes() - before


def _call(work, *given) -> None:
    positional = [one for one in given if not isinstance(one, dict)]
    work(
        *positional, **{name: value for one in given if isinstance(one, dict) for name, value in one.items()}
    )


@pytest.fixture(scope="module")
def volumes(tmp_path_factory):
    """A small volume and a large one of 200³ float32."""
    folder = tmp_path_factory.mktemp("volumes")
    for name, n in (("small", 8), ("large", 200)):
        x = np.linspace(-1.0, 1.0, n, dtype=np.float32)
        ball = x[:, None, None] ** 2 + x[None, :, None] ** 2 + x[None, None, :] ** 2
        write_volume(folder / f"{name}.h5", Volume.from_values(ball, (1e-3,) * 3))
    return folder


LARGE = VolumeFile((200, 200, 200), 4)


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.parametrize("name", ["bspline3", "trilinear"])
def test_tile_stays_within_the_planned_memory(volumes, name):
    small = RefractionView(iso=(0.9,), filter=name, width=8, height=8)
    view = RefractionView(iso=(0.9,), filter=name, width=4096, height=4096)
    measured = taken(
        tile_image, (volumes / "small.h5", small, 0, 8), volumes / "large.h5", view, 1024, 1024 + 128
    )
    planned = picture_cost.refraction_bytes((200, 200, 200), view)
    assert planned / 2 < measured < planned


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.parametrize(
    "how", [{}, {"size": 4096, "frame": False}, {"size": 4096, "interpolation": "cubic"}]
)
def test_a_slice_takes_no_more_memory_than_planned(volumes, how):
    measured = taken(volume_slice_png, (volumes / "small.h5",), volumes / "large.h5", how)
    assert measured < picture_cost.slice_cost(LARGE, how.get("size")).bytes


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "npy",
        *(
            pytest.param(one, marks=pytest.mark.nightly)
            for one in ("nifti", "metaimage", "nrrd", "mat", "vti", "ome-zarr", "dicom")
        ),
    ],
)
def test_an_export_takes_no_more_memory_than_planned(volumes, tmp_path, name):
    # The library of a format is loaded by its first export.
    small = {"target": tmp_path / "small", "name": "npy"}
    large = {"target": tmp_path / "large", "name": name}
    measured = taken(export_volume, (volumes / "small.h5", small), volumes / "large.h5", large)
    assert measured < picture_cost.export_cost(LARGE, name).bytes

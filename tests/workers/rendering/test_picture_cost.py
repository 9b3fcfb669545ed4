"""Estimated cost of pictures grows with what is drawn, and rejections name what fits."""

import math

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.request_fields import MAX_PIXELS
from bentray_service.picture_queue import LONG_S
from bentray_workers.cluster.capacities import WorkerCapacity
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
    # A mesh without a field may have two million faces, which are sorted first.
    assert field_cost({"faces": 2_000_000}, FieldView(mode="diffuse")).seconds > LONG_S


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

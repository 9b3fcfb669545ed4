"""The picture of a slice: right colours, up is up, and bad arguments are named."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.reconstruction import write_reconstruction
from bentray_workers.images.slice import slice_png
from bentray_workers.images.slice_style import COLORMAPS

from ..files.reconstructions import made
from .pixels import near, pixels

YELLOW = (253, 231, 37)


@pytest.fixture
def file(tmp_path):
    write_reconstruction(tmp_path / "r.h5", made())
    return tmp_path / "r.h5"


@pytest.fixture
def volume(tmp_path):
    write_reconstruction(tmp_path / "v.h5", made(slices=3))
    return tmp_path / "v.h5"


def test_x_is_to_the_right_and_y_up(tmp_path):
    result = made()
    speed = np.full_like(result.speed, 1500.0)
    speed[18:22, 3:6] = 1600.0
    write_reconstruction(tmp_path / "r.h5", replace(result, speed=speed))
    picture = pixels(slice_png(tmp_path / "r.h5", low=1500.0, high=1600.0))
    map_part = picture[:, : int(0.84 * picture.shape[1])]
    rows, columns = near(map_part, YELLOW)
    assert rows.size > 500
    assert columns.mean() > 0.65 * map_part.shape[1]
    assert rows.mean() > 0.6 * map_part.shape[0]


def test_the_limits_set_the_colours(file):
    fewer = pixels(slice_png(file, low=1000.0, high=1500.0))
    more = pixels(slice_png(file, low=1600.0, high=1700.0))
    assert near(fewer, YELLOW)[0].size > 20 * max(1, near(more, YELLOW)[0].size)


def test_quantities_maps_and_slices_differ(volume):
    pictures = [
        slice_png(volume),
        slice_png(volume, quantity="coverage"),
        slice_png(volume, quantity="attenuation"),
        slice_png(volume, quantity="recovery"),
        slice_png(volume, colormap="gray"),
        slice_png(volume, index=0),
    ]
    assert len(set(pictures)) == len(pictures)
    assert slice_png(volume, index=1) == slice_png(volume)


def test_a_constant_image_is_drawn(tmp_path):
    result = made()
    flat = replace(result, speed=np.full_like(result.speed, 1500.0), coverage=np.zeros_like(result.coverage))
    write_reconstruction(tmp_path / "r.h5", flat)
    for quantity in ("speed", "coverage"):
        assert pixels(slice_png(tmp_path / "r.h5", quantity=quantity)).shape[0] > 300


@pytest.mark.parametrize(
    ("given", "field", "accepted"),
    [
        ({"quantity": "mass"}, "quantity", "speed, coverage"),
        ({"colormap": "jet"}, "colormap", "viridis"),
        ({"index": 1}, "index", "0 to 0"),
        ({"index": -1}, "index", "0 to 0"),
        ({"low": 1500.0, "high": 1500.0}, "low", "below"),
        ({"low": 9000.0}, "low", "below"),
        ({"high": 10.0}, "high", "above"),
        ({"low": float("nan")}, "low", "a number from"),
        ({"high": float("inf")}, "high", "a number from"),
    ],
)
def test_bad_arguments_are_named(file, given, field, accepted):
    with pytest.raises(InvalidInput) as refused:
        slice_png(file, **given)
    assert refused.value.field == field
    assert accepted in refused.value.accepted


def test_a_quantity_that_the_file_lacks_is_rejected(tmp_path):
    write_reconstruction(tmp_path / "r.h5", replace(made(), attenuation=None))
    with pytest.raises(InvalidInput, match="quantity") as refused:
        slice_png(tmp_path / "r.h5", quantity="attenuation")
    assert refused.value.accepted == "one of speed, coverage, recovery: this file has no other"


def test_recovery_is_drawn_from_0_to_1_by_default(file, drawn):
    for given, limits in (({}, (0.0, 1.0)), ({"low": 0.5}, (0.5, 1.0)), ({"high": 0.6}, (0.0, 0.6))):
        slice_png(file, quantity="recovery", **given)
        assert drawn[-1].axes[0].images[0].get_clim() == limits
    assert "recovered fraction of a checkerboard" in drawn.words()


def test_pictures_drawn_in_threads_are_those_drawn_alone(file):
    jobs = [{"colormap": name} for name in COLORMAPS[:4]] * 2
    alone = [slice_png(file, **job) for job in jobs]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(lambda job: slice_png(file, **job), jobs)) == alone

"""Slices: the plane of an array, and its picture: colours, up is up, and bad arguments are named."""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.reconstruction import write_reconstruction
from bentray_workers.files.volume import Volume, write_volume
from bentray_workers.images.plane import plane_of
from bentray_workers.images.slice import slice_png, volume_slice_png
from bentray_workers.images.slice_style import COLORMAPS

from ..files.reconstructions import made
from ..pixels import near, pixels_of

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
    picture = pixels_of(slice_png(tmp_path / "r.h5", low=1500.0, high=1600.0))
    map_part = picture[:, : int(0.84 * picture.shape[1])]
    rows, columns = near(map_part, YELLOW)
    assert rows.size > 500
    assert columns.mean() > 0.65 * map_part.shape[1]
    assert rows.mean() > 0.6 * map_part.shape[0]


def test_the_limits_set_the_colours(file):
    fewer = pixels_of(slice_png(file, low=1000.0, high=1500.0))
    more = pixels_of(slice_png(file, low=1600.0, high=1700.0))
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
        assert pixels_of(slice_png(tmp_path / "r.h5", quantity=quantity)).shape[0] > 300


@pytest.mark.parametrize(
    ("given", "field", "accepted"),
    [
        ({"quantity": "mass"}, "quantity", "speed, coverage"),
        ({"colormap": "jet"}, "colormap", "viridis"),
        ({"interpolation": "sinc"}, "interpolation", "cubic"),
        ({"size": 199}, "size", "200"),
        ({"size": 31, "frame": False}, "size", "32"),
        ({"size": 4097}, "size", "4096"),
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
    with pytest.raises(InvalidInput, match=rf"^{field}: .*; accepted: .*{accepted}"):
        slice_png(file, **given)


def test_a_quantity_that_the_file_lacks_is_rejected(tmp_path):
    write_reconstruction(tmp_path / "r.h5", replace(made(), attenuation=None))
    accepted = "one of speed, coverage, recovery: this file has no other"
    with pytest.raises(InvalidInput, match=f"^quantity: .*; accepted: {accepted}$"):
        slice_png(tmp_path / "r.h5", quantity="attenuation")


def test_recovery_is_drawn_from_0_to_1_by_default(file, drawn):
    for asked, limits in (({}, (0.0, 1.0)), ({"low": 0.5}, (0.5, 1.0)), ({"high": 0.6}, (0.0, 0.6))):
        slice_png(file, quantity="recovery", **asked)
        assert drawn[-1].axes[0].images[0].get_clim() == limits
    assert "recovered fraction of a checkerboard" in drawn.words()


def test_pictures_drawn_in_threads_are_those_drawn_alone(file):
    jobs = [{"colormap": name} for name in COLORMAPS[:4]] * 2
    alone = [slice_png(file, **job) for job in jobs]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(lambda job: slice_png(file, **job), jobs)) == alone


@pytest.fixture
def path(tmp_path):
    values = np.zeros((6, 5, 4)) + 10.0 * np.arange(4)
    write_volume(tmp_path / "v.h5", Volume.from_values(values, (1e-3,) * 3, (0.0, 0.0, 5e-3), "A $head"))
    return tmp_path / "v.h5"


def test_the_middle_slice_says_where_it_is(path, drawn):
    assert volume_slice_png(path).startswith(b"\x89PNG")
    words = drawn.words()
    assert "Slice index 2 (0 to 3), z = 7 mm" in words
    assert {"A $head", "value"} <= set(words)
    assert np.asarray(drawn[-1].axes[0].images[0].get_array()).max() == 20.0


def test_requested_slice_is_drawn(path, drawn):
    volume_slice_png(path, index=0, low=-1.0, high=7.0, colormap="gray")
    image = drawn[-1].axes[0].images[0]
    assert (image.get_clim(), image.get_cmap().name) == ((-1.0, 7.0), "gray")
    assert np.asarray(image.get_array()).shape == (5, 6)


VALUES = np.arange(60.0).reshape(3, 4, 5)


GRID = ((1e-3, 2e-3, 3e-3), (0.0, 0.1, 0.2))


@given(axis=st.sampled_from("xyz"), data=st.data())
def test_every_slice_is_the_values_across_its_axis(axis, data):
    number = "xyz".index(axis)
    index = data.draw(st.integers(0, VALUES.shape[number] - 1))
    plane = plane_of(VALUES, *GRID, axis, index)
    np.testing.assert_array_equal(plane.image, np.moveaxis(VALUES, number, 0)[index])
    kept = [k for k in range(3) if k != number]
    assert plane.names == "".join("xyz"[k] for k in kept)
    assert plane.spacing_m == tuple(GRID[0][k] for k in kept)
    assert plane.origin_m == tuple(GRID[1][k] for k in kept)
    assert plane.place_m == pytest.approx(GRID[1][number] + index * GRID[0][number])
    assert (plane.index, plane.count) == (index, VALUES.shape[number])


def test_without_an_index_the_middle_one_is_taken():
    assert plane_of(VALUES, *GRID, "y").caption() == "slice index 2 (0 to 3), y = 104 mm"


def test_a_plain_image_is_its_own_slice():
    plane = plane_of(VALUES[0], (1e-3, 1e-3), (0.0, 0.0))
    np.testing.assert_array_equal(plane.image, VALUES[0])
    assert (plane.names, plane.caption()) == ("xy", "")


def test_uneven_heights_have_no_place():
    plane = plane_of(VALUES, (1e-3, 1e-3, math.nan), GRID[1], "z", 1)
    assert plane.caption() == "slice index 1 (0 to 4)"


@pytest.mark.parametrize(
    ("values", "steps", "axis", "index", "field"),
    [
        (VALUES, 1e-3, "x", 3, "index"),
        (VALUES, 1e-3, "z", -1, "index"),
        (VALUES, 1e-3, "w", None, "axis"),
        (VALUES, 1e-3, "xy", None, "axis"),
        (VALUES, 1e-3, "", None, "axis"),
        (VALUES, math.nan, "y", None, "axis"),
        (VALUES[0], 1e-3, "x", None, "axis"),
        (VALUES[0], 1e-3, "z", 1, "index"),
    ],
)
def test_refusals(values, steps, axis, index, field):
    with pytest.raises(InvalidInput, match=f"^{field}: "):
        plane_of(values, (1e-3, 1e-3, steps)[: values.ndim], GRID[1], axis, index)

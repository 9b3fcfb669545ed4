"""Pictures of slices: requested size, scale and colour bars, and the bare image."""

import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from bentray_workers.images.plane import plane_of
from bentray_workers.images.plane_picture import MAX_WIDTH_FRACTION, plane_png, scale_of
from bentray_workers.images.slice_style import SliceStyle

from ..pixels import near, pixels_of

RAMP = np.arange(60.0).reshape(3, 4, 5)
PLANE = plane_of(RAMP, (1e-2, 1e-2, 2e-2), (0.0, 0.0, 0.0), "x", 1)
WORDS = {"title": "A title", "unit": "sound speed (m/s)", "note": "a note"}
WHITE = (255, 255, 255)


def drawn_with(**look):
    return plane_png(PLANE, (20.0, 39.0), SliceStyle(**look), **WORDS)


def size_of(picture):
    return Image.open(io.BytesIO(picture)).size


@pytest.mark.parametrize("size", [200, 257, 1000, 1777])
@pytest.mark.parametrize("bars", [True, False])
def test_longest_side_matches_the_request(size, bars):
    assert max(size_of(drawn_with(size=size, scale_bar=bars, colour_bar=bars))) == size


def test_frame_shows_title_axes_units_and_colour_bar(drawn):
    drawn_with(scale_bar=True, interpolation="cubic")
    assert {"A title", "sound speed (m/s)", "a note", "y (mm)", "z (mm)", "10 mm"} <= set(drawn.words())
    image = drawn[-1].axes[0].images[0]
    assert (image.get_interpolation(), image.get_clim()) == ("bicubic", (20.0, 39.0))
    np.testing.assert_allclose(image.get_extent(), (-5.0, 35.0, -10.0, 90.0))


def test_bars_are_left_out(drawn):
    drawn_with(scale_bar=False, colour_bar=False)
    assert len(drawn[-1].axes) == 1
    assert "sound speed (m/s)" not in drawn.words()
    assert "10 mm" not in drawn.words()


def test_the_bare_image_has_a_pixel_a_node_to_scale():
    # Twice as far between nodes along z: 4 by 10 to scale, the longest side a pixel a node.
    assert size_of(drawn_with(frame=False)) == (2, 5)
    assert size_of(drawn_with(frame=False, size=400)) == (160, 400)


def test_bare_image_contains_only_values():
    picture = pixels_of(drawn_with(frame=False, size=400, colormap="gray"))
    middles = [int(400 * (k + 0.5) / 5) for k in range(5)], [int(160 * (k + 0.5) / 4) for k in range(4)]
    computed = picture[np.ix_(*middles)][..., 0].astype(float)
    # Rows run down, z runs up.
    expected = 255.0 * (RAMP[1].T[::-1] - 20.0) / 19.0
    np.testing.assert_allclose(computed, expected, atol=2.0)


def test_the_scale_bar_is_as_long_as_it_says():
    plain, barred = (pixels_of(drawn_with(frame=False, size=1000, scale_bar=bar)) for bar in (False, True))
    assert near(plain, WHITE)[0].size == 0
    rows, columns = near(barred, WHITE)
    counts = np.bincount(rows)
    # 40 mm across 400 pixels; the bar says 10 mm.
    assert counts.max() == pytest.approx(100, abs=4)
    assert columns.min() > 0
    assert np.argmax(counts) > 900


@given(st.floats(1e-9, 1e6))
def test_scales_are_round_and_short_enough(width):
    scale = scale_of(width)
    assert scale <= MAX_WIDTH_FRACTION * width
    assert scale > 0.39 * MAX_WIDTH_FRACTION * width
    assert float(f"{scale:.1e}"[0]) in (1.0, 2.0, 5.0)

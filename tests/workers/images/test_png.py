"""PNG of arrays: exact, and the same bytes each time; the card behind glass and the landscape."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from PIL import Image

from bentray_kernels.errors import InvalidInput
from bentray_workers.images.backdrop_card import COLOURS, backdrop_card
from bentray_workers.images.landscape import landscape
from bentray_workers.images.png import png_of, read_picture

from ..pixels import pixels_of


@given(arrays.arrays(np.uint8, st.tuples(st.integers(1, 9), st.integers(1, 9), st.just(3))))
def test_a_picture_survives(image):
    np.testing.assert_array_equal(pixels_of(png_of(image)), image)
    assert png_of(image) == png_of(image[::-1][::-1])


def test_a_picture_file_of_another_kind_and_mode(tmp_path):
    Image.new("LA", (4, 2), (90, 255)).save(tmp_path / "grey.png")
    assert read_picture(tmp_path / "grey.png").tolist() == [[[90] * 3] * 4] * 2


@pytest.mark.parametrize(("content", "found"), [(None, "no such file"), (b"text", "no picture")])
def test_rejects_invalid_pictures(tmp_path, content, found):
    if content is not None:
        (tmp_path / "x").write_bytes(content)
    with pytest.raises(InvalidInput, match=found):
        read_picture(tmp_path / "x")


def test_every_turn_and_mirror_image_differs():
    card = backdrop_card()
    assert (card.shape, card.dtype) == ((1024, 1024, 3), np.uint8)
    turned = [np.rot90(one, k) for one in (card, card[::-1]) for k in range(4)]
    assert all((card != other).any() for other in turned[1:])


def test_it_has_every_colour_and_words():
    card = backdrop_card()
    for colour in COLOURS:
        assert (card == colour).all(axis=-1).sum() > 5000
    words = card[360:470, 260:760].mean(axis=(1, 2))
    assert words.min() < card[20:30, 260:760].mean() - 20


def test_it_is_an_environment():
    picture = landscape()
    assert picture.shape[1] == 2 * picture.shape[0]
    assert picture.dtype == np.float32
    assert 0.0 <= picture.min() < picture.max() <= 1.0
    assert landscape() is picture


def test_sky_above_and_fields_below():
    rows = len(landscape())
    above, below = landscape()[: rows // 4], landscape()[rows // 2 + 2 :]
    assert (above[..., 2] >= above[..., 0]).all()
    assert (below[..., 2] < below[..., 0]).all()


def test_it_closes_round():
    picture = landscape()
    seam = np.abs(picture[:, 0] - picture[:, -1]).max(axis=1)
    beside = np.abs(picture[:, 0] - picture[:, 1]).max(axis=1)
    assert (seam > beside + 0.3).mean() < 0.02

"""PNG of arrays: exact, and the same bytes each time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from PIL import Image

from bentray_kernels.errors import InvalidInput
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

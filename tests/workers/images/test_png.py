"""PNG of arrays: exact, and the same bytes each time."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from bentray_workers.images.png import colours_of, png_of


@given(arrays.arrays(np.uint8, st.tuples(st.integers(1, 9), st.integers(1, 9), st.just(3))))
def test_a_picture_survives(image):
    np.testing.assert_array_equal(colours_of(png_of(image)), image)
    assert png_of(image) == png_of(image[::-1][::-1])

"""Slices of uploaded volumes: index, position, and rejected requests."""

import numpy as np
import pytest

from bentray_workers.files.volume import Volume, write_volume
from bentray_workers.images.slice import volume_slice_png


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

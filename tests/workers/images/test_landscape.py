"""The landscape: all around, with a sky above and fields below, and made once."""

import numpy as np

from bentray_workers.images.landscape import landscape


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

"""Smoothing at edges: what differs from its neighbours is averaged, and nothing else."""

import numpy as np

from bentray_kernels.refraction.edge_smoothing import smooth_edges


def test_noise_at_edges_is_averaged_and_all_else_kept():
    rng = np.random.default_rng(1)
    image = (255 * rng.integers(0, 2, (20, 30, 3))).astype(np.uint8)
    pieces = np.zeros((20, 30, 2), dtype=np.int16)
    pieces[:, 15:, 1] = rng.integers(0, 9, (20, 15))
    after = image.copy()
    smooth_edges(pieces, 1, after)
    np.testing.assert_array_equal(after[:, :14], image[:, :14])
    noise, left = image[:, 16:].std(), after[:, 16:].std()
    # By the tent twice: 0.375, and 35/128 after two passes.
    assert 0.2 * noise < left < 0.35 * noise
    assert abs(float(after[:, 16:].mean()) - float(image[:, 16:].mean())) < 4.0


def test_a_straight_edge_is_smoothed_once_by_a_tent():
    image = np.zeros((6, 9, 3), dtype=np.uint8)
    image[:, 5:] = 160
    for least, expected in ((161, [0, 0, 160, 160]), (160, [0, 40, 120, 160])):
        after = image.copy()
        smooth_edges(image.astype(np.int16), least, after)
        np.testing.assert_array_equal(after[..., 0], np.tile([0, 0, 0, *expected, 160, 160], (6, 1)))

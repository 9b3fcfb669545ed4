"""Volumes sampled from exact fields: which node holds which place, and the steps of eight bits."""

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import MarschnerLobb, eight_bit, in_nodes, sampled


def test_nodes_hold_the_field_at_their_places():
    field, n = MarschnerLobb(), 7
    volume = sampled(field, n)
    assert volume.shape == (n, n, n)
    rng = np.random.default_rng(1)
    for node in rng.integers(0, n, (20, 3)):
        position = -1.0 + 2.0 * node / (n - 1)
        assert volume[tuple(node)] == pytest.approx(float(field.value(position)), abs=1e-14)
        assert in_nodes(position, n) == pytest.approx(node)


def test_eight_bits_are_rounded_and_clipped():
    levels = eight_bit(np.array([-1.0, 0.0, 0.5 / 255 - 1e-6, 0.5 / 255 + 1e-6, 1.0, 3.0]), 0.0, 1.0)
    assert levels.dtype == np.uint8
    assert levels.tolist() == [0, 0, 0, 1, 255, 255]


def test_rejects_fields_that_cannot_be_sampled():
    with pytest.raises(InvalidInput, match="nodes"):
        sampled(MarschnerLobb(), 1)
    with pytest.raises(InvalidInput, match="high"):
        eight_bit(np.ones(3), 1.0, 1.0)

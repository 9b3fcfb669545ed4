"""Raw traces: counts are pascals unless a scale is given, and arrays must fit."""

import numpy as np
import pytest

from bentray_kernels.acquisition import Waveform
from bentray_kernels.errors import InvalidInput

TRACES = np.zeros((2, 3, 5), np.float32)


def test_without_a_scale_counts_are_pascals():
    assert Waveform(TRACES).scale == 1.0


@pytest.mark.parametrize(
    ("fields", "name"),
    [
        ({"object": np.zeros((2, 3), np.float32)}, "waveform/object"),
        ({"object": np.zeros((2, 0, 5), np.float32)}, "waveform/object"),
        ({"water": np.zeros((2, 3, 4), np.float32)}, "waveform/water"),
        ({"object_scale": np.ones((2, 2))}, "waveform/object_scale"),
        ({"water_scale": np.full((2, 3), np.inf)}, "waveform/water_scale"),
        ({"scale": 0.0}, "waveform@scale"),
    ],
)
def test_invalid_traces_are_named(fields, name):
    with pytest.raises(InvalidInput, match=name):
        Waveform(**{"object": TRACES, **fields})

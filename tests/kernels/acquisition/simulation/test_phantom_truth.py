"""True values of a phantom: what is accepted, and which field is named otherwise."""

import numpy as np
import pytest

from bentray_kernels.acquisition.simulation.phantom_truth import Truth
from bentray_kernels.errors import InvalidInput

GOOD = {"sound_speed_mps": np.full((4, 5), 1500.0), "spacing_m": (1e-3, 2e-3), "origin_m": (0.0, -0.1)}


def test_positive_spacings_are_accepted():
    assert Truth(**GOOD).spacing_m == (1e-3, 2e-3)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"spacing_m": (1e-3, 0.0)}, "truth@spacing_m"),
        ({"spacing_m": (-1e-3, 1e-3)}, "truth@spacing_m"),
        ({"spacing_m": (1e-3,)}, "truth@spacing_m"),
        ({"origin_m": (0.0, np.nan)}, "truth@origin_m"),
        ({"sound_speed_mps": np.full(4, 1500.0)}, "truth/sound_speed_mps"),
    ],
)
def test_other_values_are_rejected_by_the_name_of_the_field(change, field):
    with pytest.raises(InvalidInput, match=f"^{field}: found"):
        Truth(**(GOOD | change))

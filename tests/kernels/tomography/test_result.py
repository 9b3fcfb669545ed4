"""The residual of a result: that of the image it holds."""

import numpy as np
import pytest

from bentray_kernels.tomography import Iteration, Reconstruction, Settings


@pytest.mark.parametrize(
    ("given", "first"), [((0, 1, 1, 1), 3e-7), ((0, 1, 1, 0), 2e-7), ((1, 1, 0, 0), 4e-7)]
)
def test_residual_of_slices_that_ended_at_different_sweeps(given, first):
    passes = ((0, 1, 4e-7), (1, 1, 1e-7), (0, 2, 2e-7), (0, 3, 3e-7))
    history = tuple(Iteration(*first, 8, given=bool(flag)) for first, flag in zip(passes, given, strict=True))
    image = np.full((4, 4), 1500.0)
    result = Reconstruction(
        image, image, (1e-3, 1e-3), (0.0, 0.0), 1500.0, Settings(method="sart"), history=history
    )
    assert result.residual_rms_s == pytest.approx(np.sqrt((first**2 + 1e-14) / 2))


def test_only_the_last_stage_gives_the_image():
    image = np.full((4, 4), 1500.0)
    history = (
        Iteration(0, 1, 1e-7, 8),
        Iteration(0, 1, 3e-7, 8, stage=1),
        Iteration(0, 2, 2e-7, 8, stage=1, given=False),
    )
    result = Reconstruction(
        image, image, (1e-3, 1e-3), (0.0, 0.0), 1500.0, Settings(method="sart"), history=history
    )
    assert result.residual_rms_s == pytest.approx(3e-7)


def test_no_history_no_residual():
    image = np.full((4, 4), 1500.0)
    assert (
        Reconstruction(image, image, (1e-3, 1e-3), (0.0, 0.0), 1500.0, Settings(method="sart")).residual_rms_s
        is None
    )

"""Baselines of an image error: constants by the norm, straight rays likewise, and default settings."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.shared._baselines import Images
from benchmarks.shared._image_error import ImageError

from bentray_kernels.acquisition import Dataset
from bentray_kernels.tomography import Reconstruction, Settings

from ._small_ring import WATER_MPS, dataset

TRUE = np.array([[1480.0, 1480.0], [1480.0, 1600.0]])
REGION = np.ones((2, 2), bool)


def error_on(image: Reconstruction) -> ImageError:
    return ImageError(TRUE, REGION)


class Spy:
    """Reconstructs an image of one value by the rays, and counts."""

    def __init__(self) -> None:
        self.asked: list[Settings] = []

    def __call__(self, scan: Dataset, settings: Settings) -> Reconstruction:
        self.asked.append(settings)
        if settings.method == "auto":
            settings = settings.changed(method="gauss-newton", penalty_strength=0.6, ray_width_m=0.003)
        speed = 1495.0 if settings.rays == "straight" else 1510.0
        used = replace(settings, nodes=settings.nodes or 16, decomposition="slices")
        flat = np.full((2, 2), speed)
        return Reconstruction(flat, flat, (1.0, 1.0), (0.0, 0.0), WATER_MPS, used)


def test_the_best_constant_is_the_mean_for_rms_and_the_median_else() -> None:
    rms = ImageError(TRUE, REGION)
    assert rms.best_constant == 1510.0
    assert rms.of_constant(1510.0) == pytest.approx(TRUE.std())
    mean = ImageError(TRUE, REGION, norm="mean absolute", unit=120.0)
    assert mean.best_constant == 1480.0
    assert mean.of_constant(1480.0) == pytest.approx(0.25)


def test_nothing_outside_the_region_counts() -> None:
    region = np.array([[True, True], [True, False]])
    error = ImageError(np.where(region, TRUE, np.nan), region)
    assert error.best_constant == 1480.0
    assert error.of_constant(1490.0) == 10.0


def test_straight_rays_have_the_method_penalty_and_width_of_the_image() -> None:
    spy = Spy()
    images = Images(dataset(), spy)
    bent = images.made(
        Settings.from_values(method="gauss-newton", penalty_strength=0.7, ray_width_m=0.002, eikonal="fmm")
    )
    images.straight(bent.result)
    straight = spy.asked[-1]
    assert (straight.rays, straight.method, straight.eikonal) == (
        "straight",
        "gauss-newton",
        "deviation",
    )
    assert (straight.gauss_newton.penalty_strength, straight.numerics.ray_width_m) == (0.7, 0.002)


def test_all_four_baselines_stand_beside_an_image_and_each_is_made_once() -> None:
    spy = Spy()
    images = Images(dataset(), spy)
    image = images.made(Settings(method="sart", nodes=16)).result
    for _ in range(2):
        compared = images.compared(image, error_on)
    assert compared.error == pytest.approx(TRUE.std())
    assert list(compared.baselines) == ["best constant", "water alone", "straight rays", "default settings"]
    assert compared.baselines["best constant"] == pytest.approx(TRUE.std())
    assert compared.baselines["water alone"] == pytest.approx(np.sqrt(((TRUE - WATER_MPS) ** 2).mean()))
    assert compared.baselines["straight rays"] == pytest.approx(np.sqrt(((TRUE - 1495.0) ** 2).mean()))
    assert [request.method for request in spy.asked] == ["sart", "sart", "auto"]

"""Histograms of volumes and reconstructions: NumPy's numbers, and the surface of a default picture."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_workers.files.reconstruction import write_reconstruction
from bentray_workers.files.volume import Volume, write_volume
from bentray_workers.rendering.histogram import volume_histogram
from bentray_workers.rendering.refraction_view import SMOOTHING_8_BIT, RefractionView
from bentray_workers.rendering.scene_cache import scene_at

from ..files.reconstructions import made


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
def test_the_numbers_are_those_of_numpy(tmp_path, kind):
    values = (np.random.default_rng(3).gamma(2.0, 20.0, (9, 8, 7)) % 250).astype(kind)
    write_volume(tmp_path / "v.h5", Volume.from_values(values, (1e-3,) * 3))
    histogram = volume_histogram(tmp_path / "v.h5", "value", 37)
    counts, edges = np.histogram(values, 37)
    assert histogram["counts"] == counts.tolist()
    assert sum(histogram["counts"]) == values.size
    np.testing.assert_allclose(histogram["edges"], edges)
    given = values.astype(np.float64)
    assert [histogram["minimum"], histogram["maximum"]] == [given.min(), given.max()]
    assert (histogram["mean"], histogram["deviation"]) == pytest.approx((given.mean(), given.std()))
    scene = scene_at(tmp_path / "v.h5", RefractionView())
    assert histogram["iso"] == pytest.approx(scene.layers.isos[0])
    assert histogram["smoothing"] == (SMOOTHING_8_BIT if kind is np.uint8 else 0.0)


def test_quantities_of_a_reconstruction(tmp_path):
    result = replace(made(8, 4), spacing_m=(2e-3,) * 3)
    write_reconstruction(tmp_path / "r.h5", result)
    speed = volume_histogram(tmp_path / "r.h5", "speed", 16)
    assert speed["counts"] == np.histogram(result.speed, 16)[0].tolist()
    assert (speed["unit"], speed["iso"] is None) == ("m/s", False)
    coverage = volume_histogram(tmp_path / "r.h5", "coverage", 16)
    assert coverage["counts"] == np.histogram(result.coverage, 16)[0].tolist()
    assert (coverage["unit"], coverage["iso"]) == ("m", None)


def test_slices_have_no_surface(tmp_path):
    result = made(8, 4)
    write_reconstruction(tmp_path / "r.h5", replace(result, spacing_m=(2e-3, 2e-3, float("nan"))))
    assert volume_histogram(tmp_path / "r.h5", "speed", 16)["iso"] is None

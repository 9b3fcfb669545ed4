"""Scenes: rejected input, the box of the octree, and no caster without a device."""

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.opencl import OpenCLFallbackWarning, device_selection
from bentray_kernels.refraction import Layers, Scene
from bentray_kernels.refraction.caster_opencl import OpenCLCaster
from bentray_kernels.splines import Spline

from .solids import distance

VOLUME = 0.3 - distance(16)


@pytest.mark.parametrize(
    ("isos", "indices", "field"),
    [
        ((), (1.0,), "iso"),
        ((1.0, 1.0), (1.0, 1.2, 1.3), "iso"),
        ((2.0, 1.0), (1.0, 1.2, 1.3), "iso"),
        ((float("nan"),), (1.0, 1.2), "iso"),
        ((1.0,), (1.0,), "indices"),
        ((1.0,), (1.0, 0.0), "indices"),
        ((1.0,), (1.0, float("inf")), "indices"),
    ],
)
def test_rejects_invalid_layers(isos, indices, field):
    with pytest.raises(InvalidInput, match=f"^{field}: found"):
        Layers(isos, indices)


@pytest.mark.parametrize("layer", [-1, 2])
def test_surroundings_that_are_no_layer_are_rejected(layer):
    with pytest.raises(InvalidInput, match=f"surroundings: found {layer}; accepted: a layer, 0 to 1"):
        Layers((0.5,), (1.0, 1.5), layer)


@pytest.mark.parametrize("iso", [-5.0, 0.31, 400.0])
def test_an_iso_value_that_the_volume_does_not_have_is_rejected_with_the_range(iso):
    with pytest.raises(InvalidInput, match=rf"iso: found {iso}; accepted: between -0.5\d+ and 0.2\d+"):
        Scene.build(Spline(VOLUME), Layers((iso,), (1.0, 1.5)))


def test_an_empty_volume_has_no_surface():
    with pytest.raises(InvalidInput, match=r"iso: found 0\.5; accepted: between 0 and 0"):
        Scene.build(Spline(np.zeros((8, 8, 8))), Layers((0.5,), (1.0, 1.5)))


def test_voxels_that_are_no_numbers_are_rejected():
    broken = VOLUME.copy()
    broken[3, 4, 5] = np.nan
    with pytest.raises(InvalidInput, match="volume: found nan"):
        Scene.build(Spline(broken), Layers((0.0,), (1.0, 1.5)))


@pytest.mark.parametrize("spacing", [0.0, -1.0, float("nan"), (1.0, 1.0, 0.0)])
def test_impossible_spacings_are_rejected(spacing):
    with pytest.raises(InvalidInput, match="spacing_m"):
        Scene.build(Spline(VOLUME), Layers((0.0,), (1.0, 1.5)), spacing)


@pytest.mark.parametrize("scale", [1e-31, 1e36, 1e300])
def test_volumes_beyond_float32_are_rejected(scale):
    with pytest.raises(InvalidInput, match=r"volume: found .*; accepted: values up to 1e\+35, .* 1e-30"):
        Scene.build(Spline(scale * VOLUME), Layers((0.1 * scale,), (1.0, 1.5)))


@pytest.mark.parametrize("scale", [1e-28, 1e34])
def test_volumes_within_float32_have_the_same_surfaces(scale):
    scaled = Scene.build(Spline(scale * VOLUME), Layers((0.1 * scale,), (1.0, 1.5)))
    np.testing.assert_array_equal(
        scaled.octree.masks, Scene.build(Spline(VOLUME), Layers((0.1,), (1.0, 1.5))).octree.masks
    )
    assert np.isfinite(scaled.octree.bend).all()


def test_flat_volumes_are_rejected():
    with pytest.raises(InvalidInput, match="volume: found 2 dimensions"):
        Scene.build(Spline(VOLUME[0]), Layers((0.0,), (1.0, 1.5)))


def test_searches_that_do_not_fit_are_rejected():
    scene = Scene.build(Spline(VOLUME), Layers((0.0,), (1.0, 1.5)))
    for wrong, field in (
        ({"structure": "grid"}, "structure"),
        ({"roots": "newton"}, "roots"),
        ({"roots": "analytic"}, "roots"),
        ({"step": 0.0}, "step"),
    ):
        with pytest.raises(InvalidInput, match=f"^{field}: found"):
            scene.search(**wrong)


def test_the_box_holds_the_surface_and_little_more():
    scene = Scene.build(Spline(VOLUME), Layers((0.0,), (1.0, 1.5)), 1.0 / 15)
    assert not scene.open
    # The sphere of radius 4.5 spacings about node 7.5.
    assert (scene.box[0] <= 3.0).all()
    assert (scene.box[0] >= 2.0).all()
    assert (scene.box[1] >= 12.0).all()
    assert (scene.box[1] <= 13.0).all()


def test_a_volume_that_is_cut_keeps_its_whole_grid():
    scene = Scene.build(Spline(-VOLUME), Layers((0.0,), (1.0, 1.5)))
    assert scene.open
    np.testing.assert_array_equal(scene.box, scene.grid)


def test_without_a_device_there_is_no_caster(monkeypatch):
    monkeypatch.setattr(device_selection, "_found", lambda *_: "this machine has no OpenCL device")
    device_selection._warn_once.cache_clear()
    ball = Scene.build(Spline(0.3 - distance(12)), Layers((0.0,), (1.0, 1.5)), 1.0 / 11)
    with pytest.warns(OpenCLFallbackWarning, match="takes over: this machine has no"):
        assert OpenCLCaster.on_the_device(ball) is None
    device_selection._warn_once.cache_clear()

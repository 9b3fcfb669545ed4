"""Scene cache: scenes are reused, rebuilt when file or filter change, and bounded in memory."""

import os
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_kernels.splines import Spline
from bentray_workers.cluster.memory_cache import MemoryCache
from bentray_workers.files.reconstruction import write_reconstruction
from bentray_workers.files.volume import Volume, write_volume
from bentray_workers.files.volume_formats import import_volume
from bentray_workers.rendering import scene_cache
from bentray_workers.rendering.refraction_view import SMOOTHING_8_BIT, RefractionView
from bentray_workers.rendering.scene_cache import check_size, filter_volume, scene_at, stored_shape

from ..files.reconstructions import made

BALL = sampled(ONE_HOLE, 12)


@pytest.fixture
def path(tmp_path):
    write_volume(tmp_path / "v.h5", Volume.from_values(BALL, (1e-3, 1e-3, 2e-3)))
    return tmp_path / "v.h5"


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 60)), max_size=60))
def test_cache_stays_within_its_limit(asked):
    kept, made_of = MemoryCache(100), {}
    for key, size in asked:
        size = made_of.setdefault(key, size)
        assert kept.get(key, size, lambda key=key: key) == key
        assert kept.held() <= 100


def test_least_recently_used_entry_is_evicted():
    kept, made_now = MemoryCache(100), []

    def get(key, size):
        return kept.get(key, size, lambda: made_now.append(key) or key)

    for key in ("a", "b", "a", "c", "a", "b"):
        get(key, 40)
    assert made_now == ["a", "b", "c", "b"]
    get("huge", 101)
    get("huge", 101)
    assert made_now[-2:] == ["huge", "huge"]


def test_failed_entries_are_not_cached():
    kept = MemoryCache(10)
    with pytest.raises(ZeroDivisionError):
        kept.get("a", 1, lambda: 1 / 0)
    assert kept.get("a", 1, lambda: 5) == 5


def test_a_scene_has_the_middle_of_its_volume_at_0(path):
    scene = scene_at(path, RefractionView())
    np.testing.assert_allclose(scene.origin, -0.5 * 11 * np.array([1e-3, 1e-3, 2e-3]))
    assert scene.layers.isos[0] == pytest.approx(0.5 * (BALL.min() + BALL.max()))


def test_the_default_surface_of_a_smoothed_volume_lies_within_it(tmp_path):
    """A small cube loses more than half of its height, and the middle of the stored range is above all."""
    cube = np.zeros((32, 32, 32), np.uint8)
    cube[12:20, 12:20, 12:20] = 255
    write_volume(tmp_path / "cube.h5", Volume.from_values(cube, (1e-3,) * 3))
    scene = scene_at(tmp_path / "cube.h5", RefractionView(smoothing=100.0))
    nodes = Spline(cube, smoothing=100.0).value(np.argwhere(np.ones(cube.shape)))
    assert nodes.max() < 127.5
    assert scene.layers.isos[0] == pytest.approx(0.5 * (nodes.min() + nodes.max()))
    with pytest.raises(InvalidInput, match=r"iso: found 127\.5; .*, the range of the volume after smoothing"):
        scene_at(tmp_path / "cube.h5", RefractionView(iso=(127.5,), smoothing=100.0))


def test_8_bit_values_are_smoothed_by_default(tmp_path):
    """The normals of a ball: the steps of 8-bit values turn them, smoothing turns them back."""
    x = np.linspace(-1.0, 1.0, 40)
    radius = np.sqrt(x[:, None, None] ** 2 + x[:, None] ** 2 + x**2)
    write_volume(
        tmp_path / "ball.h5", Volume.from_values(np.round(40.0 - 20.0 * radius).astype(np.uint8), (1e-3,) * 3)
    )
    angles = np.random.default_rng(1).normal(size=(500, 3))
    outwards = angles / np.linalg.norm(angles, axis=1, keepdims=True)

    def tilt_deg(view):
        spline = filter_volume(import_volume(tmp_path / "ball.h5"), view).spline
        slopes = spline.gradient(0.5 * 39 * (1.0 + 0.6 * outwards))
        cosine = -(slopes * outwards).sum(axis=1) / np.linalg.norm(slopes, axis=1)
        return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))).mean()

    scene = scene_at(tmp_path / "ball.h5", RefractionView())
    asked = scene_at(tmp_path / "ball.h5", RefractionView(smoothing=SMOOTHING_8_BIT))
    np.testing.assert_array_equal(scene.field.coefficients, asked.field.coefficients)
    rough, smooth = tilt_deg(RefractionView(smoothing=0.0)), tilt_deg(RefractionView())
    assert smooth < 3.0 < 4.0 * smooth < rough


def test_another_glass_shares_the_octree(path):
    one, two = (scene_at(path, RefractionView(iso=(0.4,), index=(n,))) for n in (1.3, 1.5))
    assert one.octree is two.octree
    assert (one.layers.indices, two.layers.indices) == ((1.0, 1.3), (1.0, 1.5))
    other = scene_at(path, RefractionView(iso=(0.6,)))
    assert other.octree is not one.octree
    assert other.field.coefficients is one.field.coefficients
    assert scene_at(path, RefractionView(iso=(0.4,), filter="trilinear")).field is not one.field


def test_other_surroundings_are_another_scene(path):
    air, glass = (scene_at(path, RefractionView(iso=(0.4,), surroundings=n)) for n in (0, 1))
    assert (air.layers.surroundings, glass.layers.surroundings) == (0, 1)
    assert glass.open
    assert not air.open


def test_changed_file_is_read_again(path):
    before = scene_at(path, RefractionView(iso=(0.4,)))
    write_volume(path, Volume.from_values(0.9 * BALL, (1e-3,) * 3))
    os.utime(path, ns=(1, 1))
    after = scene_at(path, RefractionView(iso=(0.4,)))
    np.testing.assert_allclose(
        after.field.coefficients, 0.9 * before.field.coefficients, rtol=1e-5, atol=1e-6
    )


def test_a_reconstruction_is_a_volume(tmp_path):
    write_reconstruction(tmp_path / "r.h5", replace(made(8, 4), spacing_m=(2e-3, 2e-3, 3e-3)))
    assert stored_shape(tmp_path / "r.h5") == (8, 8, 4)
    assert scene_at(tmp_path / "r.h5", RefractionView()).spacing.tolist() == [2e-3, 2e-3, 3e-3]


def test_a_volume_that_no_worker_can_hold_is_rejected_before_it_is_read(path, monkeypatch):
    check_size((512, 512, 512))
    with pytest.raises(InvalidInput, match=r"shape \(1024, 1024, 1024\)"):
        check_size((1024, 1024, 1024))
    monkeypatch.setattr(scene_cache, "MAX_BUILDING_BYTES", 1000)
    monkeypatch.setattr(scene_cache, "import_volume", None)
    with pytest.raises(InvalidInput, match="1000 bytes"):
        scene_at(path, RefractionView())


def test_the_figures_for_memory_are_no_less_than_what_is_used():
    """Of numpy's own arrays, which are nearly all there is."""
    import tracemalloc

    volume = Volume.from_values(sampled(ONE_HOLE, 64), (1e-3,) * 3)
    filtered = scene_cache.filter_volume(volume, RefractionView())
    scene_cache.build_scene(filtered, RefractionView(iso=(0.5,)).layers())
    tracemalloc.start()
    filtered = scene_cache.filter_volume(volume, RefractionView())
    spline = tracemalloc.get_traced_memory()[0]
    scene = scene_cache.build_scene(filtered, RefractionView(iso=(0.5,)).layers())
    kept, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert scene.layers.isos == (0.5,)
    shape = volume.values.shape
    assert spline <= scene_cache.needed_bytes(shape, scene_cache.SPLINE_BYTES)
    assert kept <= scene_cache.needed_bytes(shape, scene_cache.SCENE_BYTES)
    assert peak <= scene_cache.needed_bytes(shape, scene_cache.BUILDING_BYTES)

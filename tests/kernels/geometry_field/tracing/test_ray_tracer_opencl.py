"""The tracer on an OpenCL device: the compiled one's pictures, and its refusals."""

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.tracing.lookup_scene import FACE_WAYS, UV_WAYS
from bentray_kernels.geometry_field.tracing.packed_scene import World, world_of
from bentray_kernels.geometry_field.tracing.ray_tracer import TraceSettings, trace
from bentray_kernels.geometry_field.tracing.ray_tracer_opencl import OpenCLTracer
from bentray_kernels.geometry_field.tracing.scene import Ground, Instance, Material, Scene, Shape, placed
from bentray_kernels.opencl import OpenCLFallbackWarning
from bentray_kernels.refraction import perspective

from ..shapes import ball
from .test_ray_tracer import WHITE, crowded, round_shape

pytestmark = pytest.mark.opencl

CAMERA = perspective((0.3, -3.0, 0.9), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 45.0)


def tracer_of(world: World, precision: str = "float64") -> OpenCLTracer:
    made = OpenCLTracer.on_the_device(world, precision)
    assert made is not None
    return made


def odd(world: World, precision: str, **how) -> float:
    """Share of pixels that differ by more than one level."""
    settings = TraceSettings(96, 80, **how)
    colours = tracer_of(world, precision).follow(CAMERA, settings)
    return float(np.mean(np.abs(colours.astype(int) - trace(world, CAMERA, settings)).max(axis=2) > 1))


@pytest.mark.parametrize("way", FACE_WAYS)
def test_pictures_are_those_of_the_compiled_tracer(way):
    world = world_of(crowded(ground=Ground(-0.6, 0.3, 3.0)))
    assert odd(world, "float64", way=way, eye=way) <= 0.0005
    assert odd(world, "float32", way=way, eye=way) <= 0.01


def test_single_refraction_too():
    single = Instance(round_shape(), placed((0.0, 0.0, 0.0), 1.2), Material(glass=1.0, refraction="single"))
    world = world_of(Scene((single, crowded().instances[1]), crowded().environment))
    assert odd(world, "float64", depth=6) <= 0.0005


def test_a_shape_without_fields_is_intersected_exactly():
    scene = Scene((Instance(Shape(ball(3)), placed((0.0, 0.0, 0.0), 1.0), Material(glass=1.0)),), WHITE)
    assert odd(world_of(scene), "float64") == 0.0


@pytest.mark.parametrize("way", UV_WAYS)
def test_lookups_of_uv_run_on_the_cpu(way):
    world, settings = world_of(crowded()), TraceSettings(16, 16, way=way)
    np.testing.assert_array_equal(tracer_of(world).trace(CAMERA, settings), trace(world, CAMERA, settings))
    with pytest.raises(InvalidInput, match="way"):
        tracer_of(world).follow(CAMERA, settings)


def test_cpu_replaces_wrong_device_results(monkeypatch):
    world = world_of(crowded())
    tracer, settings = tracer_of(world), TraceSettings(32, 32)
    monkeypatch.setattr(tracer, "follow", lambda camera, how: np.zeros((how.rows, how.columns, 3), np.uint8))
    with pytest.warns(OpenCLFallbackWarning, match="takes over"):
        colours = tracer.trace(CAMERA, settings)
    np.testing.assert_array_equal(colours, trace(world, CAMERA, settings))
    # The warning comes once.
    np.testing.assert_array_equal(tracer.trace(CAMERA, settings), colours)


def test_device_that_passes_the_self_test_is_used():
    world = world_of(crowded())
    colours = tracer_of(world).trace(CAMERA, TraceSettings(32, 32))
    np.testing.assert_array_equal(colours, tracer_of(world).follow(CAMERA, TraceSettings(32, 32)))


def test_other_precisions_are_rejected():
    with pytest.raises(InvalidInput, match="precision"):
        OpenCLTracer.on_the_device(world_of(crowded()), "float16")

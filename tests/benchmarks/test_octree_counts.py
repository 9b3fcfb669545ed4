"""Counted operations of the ray casters, and the compiled functions back in their places."""

import numpy as np
from benchmarks.refraction._octree_counts import counted, operations
from benchmarks.refraction._refraction_ladders import subjects

from bentray_kernels.isosurface import crossing
from bentray_kernels.refraction import Layers, Scene, render
from bentray_kernels.refraction.render import RenderSettings
from bentray_kernels.splines import Spline


def test_the_octree_leaves_few_evaluations_and_nodes():
    ball = subjects()[0]
    scene = Scene.build(Spline(ball.volume), Layers((ball.iso,), (1.0, 1.5)))
    compiled = crossing.leave_interval
    result = {search: operations(scene, ball, search, 6) for search in ("steps", "dda", "octree")}
    assert crossing.leave_interval is compiled
    # About 64 nodes along each ray, in steps of a tenth.
    assert 600 < result["steps"][0] < 700
    assert 60 < result["dda"][1] < 90
    assert result["octree"][1] < 0.3 * result["dda"][1]
    assert 0 < result["octree"][0] <= result["dda"][0] < 0.02 * result["steps"][0]


def test_counting_changes_no_ray():
    ball = subjects()[0]
    scene = Scene.build(Spline(ball.volume), Layers((ball.iso,), (1.0, 1.5)))
    settings = RenderSettings(6, 6, supersampling="none")
    expected = render(scene, ball.camera, ball.backdrop, settings)
    with counted() as counts:
        computed = render(scene, ball.camera, ball.backdrop, settings)
    assert counts["_trace_ray"] == 36
    np.testing.assert_allclose(computed.position_m, expected.position_m, rtol=1e-9)

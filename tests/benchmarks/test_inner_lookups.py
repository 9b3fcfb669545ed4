"""Rays that leave a surface: exact ones on a known ball, errors of the published inner field and of ours."""

import numpy as np
import pytest
from benchmarks.geometry_field._inner_lookups import found_points, leaving_rays, world_with_fields

from ..kernels.geometry_field.shapes import dented, octahedron, turned

RAYS = 10_000
PUBLISHED = ("uv-nearest", "uv-linear")


@pytest.fixture(scope="module")
def ball():
    return world_with_fields(turned(octahedron(4)), 8, 8, 129)


@pytest.fixture(scope="module")
def dent():
    return world_with_fields(turned(dented(4)), 8, 8, 129)


@pytest.mark.nightly
def test_exact_rays_through_a_ball_are_its_chords(ball):
    rays = _, origins, directions = leaving_rays(ball.surface, RAYS, True)
    from_middle = origins - 0.5
    assert (np.abs(np.linalg.norm(from_middle, axis=1) - 0.5) < 0.01).all()
    ends = origins - 2.0 * (from_middle * directions).sum(axis=1)[:, None] * directions
    off = np.linalg.norm(found_points(ball, "exact", True, rays) - ends, axis=1)
    assert np.median(off) < 0.01
    outside = leaving_rays(ball.surface, RAYS, False)
    assert np.isnan(found_points(ball, "exact", False, outside)).mean() > 0.99


@pytest.mark.parametrize("inside", [True, False])
def test_published_points_are_coarse_and_ours_are_those_of_exact_rays(dent, inside):
    rays = leaving_rays(dent.surface, RAYS, inside)
    exact = found_points(dent, "exact", inside, rays)
    hit = np.isfinite(exact[:, 0])
    assert hit.mean() > (0.99 if inside else 0.01)
    walked = found_points(dent, "walk", inside, rays)
    both = hit & np.isfinite(walked[:, 0])
    assert both.sum() > (0.99 if inside else 0.6) * hit.sum()
    assert np.median(np.linalg.norm(walked - exact, axis=1)[both]) < 1e-6
    for way in PUBLISHED:
        result = found_points(dent, way, inside, rays)
        met = np.isfinite(result[:, 0])
        off = np.linalg.norm(result - exact, axis=1)[met & hit]
        # A point stands for its part of the surface, an exit for a square of the cube; there is no walk.
        assert 1e-3 < np.median(off) < 0.1
        assert (met != hit).mean() < 0.2


def test_averages_over_exits_are_closer_than_the_nearest_exit(ball):
    rays = leaving_rays(ball.surface, RAYS, True)
    exact = found_points(ball, "exact", True, rays)
    nearest, linear = (
        np.nanmedian(np.linalg.norm(found_points(ball, way, True, rays) - exact, axis=1)) for way in PUBLISHED
    )
    assert linear < nearest

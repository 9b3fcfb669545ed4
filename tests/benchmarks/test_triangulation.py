"""Rays through a triangulated ball end where the exact ones do."""

import numpy as np
import trimesh
from benchmarks.refraction._refracting_ball import DISTANCE_RADIUS
from benchmarks.refraction.triangulation import Triangulation, cases, meshed

from bentray_kernels.meshes.mesh import Chart, TriangleMesh
from bentray_kernels.meshes.surface import surface_of


def test_rays_through_a_fine_ball_end_at_the_exact_places():
    case = cases()[0]
    ball = trimesh.creation.icosphere(6)
    mesh = TriangleMesh(0.5 + 0.5 * ball.vertices, ball.faces.astype(np.int32))
    surface = surface_of(Chart(mesh, np.zeros((len(ball.faces), 3, 2))))
    radius = DISTANCE_RADIUS
    ends = meshed(case, Triangulation(surface, np.full(3, -radius), 2.0 * radius)).ends
    used = np.isfinite(case.truth).all(axis=1)
    assert used.sum() > 10_000
    off = np.linalg.norm(ends - case.truth, axis=1)[used]
    # Flat triangles of 0.02 edges; 60 nodes behind the ball.
    assert np.median(off) < 0.01
    assert off.max() < 1.0

"""Meshes from images: closed where the surface is closed, with its handles and holes."""

import numpy as np
import pytest

from bentray_kernels.geometry_field.image.geometry_image import geometry_image
from bentray_kernels.geometry_field.layout.parameterisation import parameterise
from bentray_kernels.meshes.example_surfaces import bumpy_ball, sphere, torus
from bentray_kernels.meshes.geometric_error import geometric_error
from bentray_kernels.meshes.topology import topology_of

from ...meshes.examples import ball_with_holes, flat_patch, two_handles, without

SURFACES = {
    "sphere": sphere(),
    "torus": torus(40, 40),
    "two handles": two_handles(),
    "ball": bumpy_ball(5000),
    "holes": ball_with_holes(),
    "torus with a hole": without(torus(30, 30), [5]),
    "patch": flat_patch(9, 9, lambda x, y: np.sin(0.4 * x) * np.cos(0.3 * y)),
}


def volume_of(surface):
    first, second, third = np.moveaxis(surface.corners - 0.5, 1, 0)
    return (first * np.cross(second, third)).sum() / 6.0


@pytest.mark.parametrize("size", [65, 128])
@pytest.mark.parametrize("name", SURFACES)
def test_topology_comes_back(name, size):
    surface = SURFACES[name]
    chart = parameterise(surface).chart
    before, mesh = topology_of(surface.faces), geometry_image(chart, size).mesh()
    after = topology_of(mesh.faces)
    assert (after.genus, len(after.boundary_loops), after.pieces.max()) == (
        before.genus,
        len(before.boundary_loops),
        0,
    )
    # No two fans touch.
    assert after.fans(~after.on_boundary).max() + 1 == len(mesh.vertices)
    if not before.on_boundary.any():
        assert volume_of(mesh) == pytest.approx(volume_of(chart.mesh), rel=0.05)


def test_the_boundary_of_a_patch_is_kept_whole():
    patch = flat_patch(9, 9, lambda x, y: np.sin(0.4 * x) * np.cos(0.3 * y))
    chart = parameterise(patch).chart
    mesh = geometry_image(chart, 64).mesh()

    def rim(surface):
        topology = topology_of(surface.faces)
        return np.linalg.norm(
            np.diff(surface.vertices[topology.edges[topology.on_boundary]], axis=1), axis=-1
        ).sum()

    assert rim(mesh) == pytest.approx(rim(chart.mesh), rel=1e-9)


def test_a_flat_square_comes_back_as_a_square():
    chart = parameterise(flat_patch(5, 5)).chart
    mesh = geometry_image(chart, 16).mesh()
    assert np.linalg.norm(mesh.face_normals, axis=1).sum() == pytest.approx(1.0, rel=1e-9)
    assert geometric_error(chart.mesh, mesh, 1000).greatest < 1e-12

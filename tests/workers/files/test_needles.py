"""Meshes of needles: a field of them, or a refusal by name; never an error of the service."""

import math

import numpy as np
import pytest
import trimesh

from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.layout.parameterisation import parameterise
from bentray_kernels.meshes.defects import sound
from bentray_kernels.meshes.example_surfaces import torus

THIN = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14)
BALL = trimesh.creation.icosphere(1)
TORUS = torus(12, 8)
TETRAHEDRON = (
    np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
)


def spike(length):
    vertices = np.array(BALL.vertices)
    vertices[0] *= length
    return vertices, BALL.faces


@pytest.mark.parametrize("thin", THIN)
@pytest.mark.parametrize(
    "shape",
    [
        lambda e: (TETRAHEDRON[0] * [1.0, e, e], TETRAHEDRON[1]),
        lambda e: (BALL.vertices * [1.0, e, e], BALL.faces),
        lambda e: (BALL.vertices * [1.0, 1.0, e], BALL.faces),
        lambda e: (TORUS.vertices * [1.0, e, e], TORUS.faces),
        lambda e: spike(1.0 / e),
    ],
    ids=["tetrahedron", "ball", "disc", "torus", "spike"],
)
def test_it_is_laid_out_or_refused(shape, thin):
    try:
        layout = parameterise(sound(*shape(thin)).mesh)
    except InvalidInput as refusal:
        name = refusal.field
    else:
        name = ""
        assert math.isfinite(layout.area_stretch)
    assert name in ("", "faces", "mesh")
    assert thin < 1e-2 or not name

"""Chapter 4's pictures of glass balls: without, after and with real supersampling."""

import io

import numpy as np
from PIL import Image

from bentray_kernels.phantoms import FringeSphere, eight_bit, sampled
from bentray_kernels.phantoms.fringe_sphere import ONE_HOLE, TWO_HOLES
from bentray_kernels.refraction import (
    Layers,
    RenderSettings,
    Scene,
    backdrop_of,
    checkerboard,
    orthographic,
    render,
)
from bentray_kernels.splines import Spline

from ._refracting_ball import INDEX, SQUARES

NODES = 64

# Without; after refraction; 64 rays a pixel.
COLUMNS = (("none", 1), ("prss", 1), ("real", 8))


def picture() -> bytes:
    """PNG: a ball, with one hole and with two, a row each; a column for each supersampling."""
    camera = orthographic((0.0, 0.0, -2.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0), 2.0)
    board = backdrop_of([checkerboard((0.0, 0.0, 1.5), (2.0, 0.0, 0.0), (0.0, 2.0, 0.0), SQUARES)])
    rows = []
    for ball in (FringeSphere(0.55, 0.08), ONE_HOLE, TWO_HOLES):
        spline = Spline(eight_bit(sampled(ball, NODES), 0.0, 1.0), smoothing=1.0)
        scene = Scene.build(spline, Layers((127.5,), (1.0, INDEX)), 2.0 / (NODES - 1))
        settings = [RenderSettings(supersampling=name, degree=degree) for name, degree in COLUMNS]
        rows.append(np.hstack([render(scene, camera, board, chosen).image for chosen in settings]))
    file = io.BytesIO()
    Image.fromarray(np.vstack(rows)).save(file, "PNG", optimize=True)
    return file.getvalue()

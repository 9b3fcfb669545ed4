"""Cameras: the middle and the edges of the image, and what is refused."""

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.refraction import Camera, orthographic, perspective


def ray(camera: Camera, u: float, v: float) -> tuple[np.ndarray, np.ndarray]:
    position = np.array([1.0, u, v])
    direction = position @ camera.direction
    return position @ camera.origin, direction / np.linalg.norm(direction)


def test_parallel_rays_start_on_the_rectangle():
    camera = orthographic((0.0, -2.0, 0.0), (0.0, 3.0, 0.0), (0.0, 0.0, 1.0), 0.4, 0.5)
    start, ahead = ray(camera, 0.5, -0.5)
    np.testing.assert_allclose(start, [0.2, -2.0, 0.1], atol=1e-12)
    np.testing.assert_allclose(ahead, [0.0, 1.0, 0.0], atol=1e-12)


def test_rays_from_the_eye_span_the_angle():
    camera = perspective((0.0, -2.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 60.0)
    left, right = ray(camera, -0.5, 0.0), ray(camera, 0.5, 0.0)
    np.testing.assert_allclose(left[0], [0.0, -2.0, 0.0])
    assert np.degrees(np.arccos(left[1] @ right[1])) == pytest.approx(60.0)
    assert right[1][0] > 0.0
    assert ray(camera, 0.0, -0.5)[1][2] > 0.0
    np.testing.assert_allclose(ray(camera, 0.0, 0.0)[1], [0.0, 1.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: orthographic((0, 0, 0), (0, 0, 1), (0, 0, 2), 1.0), "up"),
        (lambda: orthographic((0, 0, 0), (0, 0, 1), (0, 1, 0), 0.0), "width_m"),
        (lambda: orthographic((0, 0, 0), (0, 0, 1), (0, 1, 0), 1.0, float("nan")), "aspect"),
        (lambda: perspective((0, 0, 0), (0, 0, 1), (0, 1, 0), 180.0), "view_deg"),
        (lambda: perspective((0, 0, 0), (0, 0, 0), (0, 1, 0), 30.0), "up"),
    ],
)
def test_rejects_invalid_cameras(make, field):
    with pytest.raises(InvalidInput) as refusal:
        make()
    assert refusal.value.field == field

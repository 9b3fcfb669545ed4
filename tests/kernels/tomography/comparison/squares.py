"""Images and truths of a square in water, for tests of errors against a truth."""

import numpy as np

from bentray_kernels.acquisition import Truth
from bentray_kernels.tomography import Reconstruction, Settings

WATER = 1500.0
STEP = 1e-3


def image(speed: np.ndarray, origin: tuple[float, ...] = (0.0, 0.0)) -> Reconstruction:
    return Reconstruction(
        speed=speed,
        coverage=np.ones_like(speed),
        spacing_m=(STEP,) * speed.ndim,
        origin_m=origin,
        water_speed_mps=WATER,
        settings=Settings(method="sart", nodes=16),
    )


def truth(speed: np.ndarray, spacing: float = STEP) -> Truth:
    axes = ",".join("xyz"[: speed.ndim])
    return Truth(speed, (spacing,) * speed.ndim, (0.0,) * speed.ndim, axes=axes)


def disc(nodes: int = 17) -> np.ndarray:
    """Water with a square of 1450 and 1550 m/s in it."""
    speed = np.full((nodes, nodes), WATER)
    speed[4:9, 4:13], speed[9:13, 4:13] = 1450.0, 1550.0
    return speed

"""Made-up reconstructions, with every field set."""

import numpy as np

from bentray_kernels.acquisition import Truth
from bentray_kernels.tomography import Candidate, Iteration, Reconstruction, Settings
from bentray_kernels.tomography.result import residual_counts

WATER_MPS = 1500.0
SPACING_M = 2e-3


def blob(nodes: int, height_mps: float) -> np.ndarray:
    x, y = np.mgrid[-1 : 1 : nodes * 1j, -1 : 1 : nodes * 1j]
    return WATER_MPS + height_mps * (np.hypot(x - 0.2, y) < 0.4)


def made(
    nodes: int = 24, slices: int | None = None, height_mps: float = 40.0, seed: int = 0
) -> Reconstruction:
    """An off-centre disc of another speed, with a little noise."""
    random = np.random.default_rng(seed)
    shape = (nodes, nodes) if slices is None else (nodes, nodes, slices)
    speed = (
        blob(nodes, height_mps)
        if slices is None
        else np.repeat(blob(nodes, height_mps)[..., None], slices, 2)
    )
    side = 0.5 * (nodes - 1) * SPACING_M
    return Reconstruction(
        speed=speed + random.normal(0.0, 1.0, shape),
        coverage=random.uniform(0.0, 1.0, shape),
        attenuation=random.uniform(0.0, 5.0, shape),
        spacing_m=(SPACING_M, SPACING_M) if slices is None else (SPACING_M, SPACING_M, float("nan")),
        origin_m=(-side, -side) if slices is None else (-side, -side, 0.01),
        water_speed_mps=WATER_MPS,
        settings=Settings.from_values(method="sart", rays="straight", speed_bounds_mps=(1400.0, 1600.0)),
        history=tuple(Iteration(k, n, 1e-7 / n / 3, 64) for n in (1, 2, 3) for k in range(slices or 1)),
        recovery=random.uniform(0.0, 1.0, shape),
        residuals=residual_counts(random.normal(0.0, 1e-7, 4000)),
        trials=(Candidate({"rays": "straight", "relaxation": 0.03}, 2e-7 / 3, 1e-7 / 3),),
        provenance={"bentray": "0.1.0", "odd": "naïve «quotes» \"'\\"},
    )


def truth(nodes: int = 24, height_mps: float = 40.0, axes: str = "x,y") -> Truth:
    side = 0.5 * (nodes - 1) * SPACING_M
    return Truth(blob(nodes, height_mps), (SPACING_M, SPACING_M), (-side, -side), axes=axes)

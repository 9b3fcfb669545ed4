"""Where one emitter's pass of SART over a slice spends its time: wave front, rays, update."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from bentray_kernels.eikonal.deviation import deviate
from bentray_kernels.phantoms import TABLE7_SIDE_M, table7
from bentray_kernels.tomography.sart.emitter_pass import EmitterPass
from bentray_workers.simulation.plane import Ring, ring_radius

from ..shared._timing import alternate

REPEATS = 60


@dataclass(frozen=True)
class Split:
    """Least of some runs, s, of one emitter on one core.

    Attributes:
        front: the wave front.
        rays: everything else that an emitter takes: tracing, times, back-projection.
        update: of the image, smoothing included.
    """

    front: float
    rays: float
    update: float

    @property
    def whole(self) -> float:
        """All three."""
        return self.front + self.rays + self.update

    def __str__(self) -> str:
        seconds_of = {"wave front": self.front, "rays": self.rays, "update": self.update}
        return ", ".join(f"{name} {1e3 * seconds:.2f} ms" for name, seconds in seconds_of.items())


def split(nodes: int, elements: int) -> Split:
    """Times of a pass through the middle slice of the 3-D breast phantom in water as fast as fat."""
    spacing = TABLE7_SIDE_M / (nodes - 1)
    # As smooth as an image of SART is; the front goes round its grid more often where edges are sharp.
    slowness = 1.0 / gaussian_filter(table7(1375.0, max(nodes, 128)).at(0.0).speed(nodes, TABLE7_SIDE_M), 2.0)
    positions = Ring(elements, ring_radius(TABLE7_SIDE_M, nodes)).positions() + 0.5 * TABLE7_SIDE_M
    source, receivers = positions[0], positions[1:]
    measured = np.linalg.norm(receivers - source, axis=1) / 1375.0
    work = EmitterPass.for_grid(slowness.shape, elements)
    region, coverage = np.ones(slowness.shape, bool), np.zeros(slowness.shape)

    def look() -> None:
        work.trace(slowness, slowness, spacing, source, receivers, measured)

    def front() -> None:
        # ``look`` leaves what it gave the wave front in the first field.
        deviate(work.fields[0], source[0] / spacing, source[1] / spacing, work.front, work.fields[2])

    def update() -> None:
        work.update(slowness.copy(), coverage, region, spacing, 0.1, 1.0, (1e-4, 1e-3))

    runs: dict[str, Callable[[], object]] = {"both": look, "front": front, "update": update}
    both, first, last = alternate(runs, REPEATS).values()
    return Split(first, both - first, last)

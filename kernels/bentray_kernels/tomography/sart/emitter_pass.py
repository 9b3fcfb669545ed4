"""One emitter's part of SART over a slice: front, rays and back-projection in one compiled call (2-D)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...arrays import Flags, Float32s, Floats
from ...compiled import kernel
from ...eikonal.deviation import SweepArrays, allocate_sweep_arrays, deviate
from ...rays.vectorised import Bundle, allocate_bundle, back_project, interleave, trace_bundle

# The Gaussian of an update ends at so many standard deviations.
TRUNCATE = 4.0


@dataclass(frozen=True)
class EmitterPass:
    """Work arrays for one grid; their content is not kept from one update to the next.

    Attributes:
        shape: of the grid.
        sheets, rays: of the wave front and of the rays.
        fields: slowness of the front and of the image, and u; (3, nodes).
        readable: what rays read at each node, see ``interleave``.
        sums: Σ correction·w and Σ w of each node in turn since the last update, (2·nodes,).
    """

    shape: tuple[int, int]
    sheets: SweepArrays
    rays: Bundle
    fields: Float32s
    readable: Float32s
    sums: Float32s

    @classmethod
    def for_grid(cls, shape: tuple[int, int], receivers: int) -> EmitterPass:
        """For up to so many receivers of an emitter."""
        nodes = shape[0] * shape[1]
        return cls(
            shape,
            allocate_sweep_arrays(shape),
            allocate_bundle(receivers, shape),
            np.zeros((3, nodes), np.float32),
            np.empty(4 * nodes, np.float32),
            np.zeros(2 * nodes, np.float32),
        )

    def trace(
        self,
        slowness: Floats,
        front: Floats | None,
        spacing: float,
        source: Floats,
        receivers: Floats,
        measured: Floats,
    ) -> Floats:
        """Trace the rays of one emitter and back-project the residuals.

        Args:
            slowness: (nx, ny), of the image, s/m.
            front: as ``slowness``, what the wave front runs in, s/m; None for straight rays.
            spacing: m.
            source: (2,), m, in the grid.
            receivers: (k, 2), m, in the grid.
            measured: (k,), travel times, s.

        Returns:
            (k,), measured less predicted travel times, s.
        """
        left = np.empty(len(receivers))
        _look(
            slowness.ravel(),
            (slowness if front is None else front).ravel(),
            front is not None,
            spacing,
            source / spacing,
            receivers / spacing,
            measured,
            self.shape,
            self.sheets,
            self.rays,
            self.fields,
            self.readable,
            self.sums,
            left,
        )
        return left

    def update(
        self,
        slowness: Floats,
        coverage: Floats,
        region: Flags,
        spacing: float,
        relaxation: float,
        smoothing: float,
        bounds: tuple[float, float],
    ) -> None:
        """Update the image in place from all emitters traced since the last update (chapter 6, equation 1).

        Args:
            slowness: (nx, ny), s/m, C order.
            coverage: as ``slowness``, m of ray; added to.
            region: as ``slowness``, nodes that may change.
            spacing: m.
            relaxation: λ.
            smoothing: standard deviation of the Gaussian, nodes; 0: none.
            bounds: lowest and highest slowness, s/m.
        """
        _update(
            self.sums,
            slowness.reshape(-1),
            coverage.reshape(-1),
            region.ravel(),
            spacing,
            relaxation,
            gaussian(smoothing),
            bounds,
            self.shape,
            self.fields[0],
            self.fields[1],
        )


def gaussian(deviation: float) -> Float32s:
    """Weights of a Gaussian from its middle outwards; 1 for a deviation of 0."""
    if not deviation > 0.0:
        return np.ones(1, np.float32)
    reach = np.arange(int(TRUNCATE * deviation + 0.5) + 1)
    weights = np.exp(-0.5 * (reach / deviation) ** 2)
    return np.asarray(weights / (2.0 * weights.sum() - 1.0), dtype=np.float32)


@kernel
def _look(
    slowness: Floats,
    front: Floats,
    curved: bool,
    spacing: float,
    source: Floats,
    receivers: Floats,
    measured: Floats,
    shape: tuple[int, int],
    at: SweepArrays,
    rays: Bundle,
    fields: Float32s,
    readable: Float32s,
    sums: Float32s,
    left: Floats,
) -> None:
    x, y = source
    i, j = min(int(x), shape[0] - 2), min(int(y), shape[1] - 2)
    node = i * shape[1] + j
    at_source = (i + 1 - x) * ((j + 1 - y) * front[node] + (y - j) * front[node + 1])
    node += shape[1]
    at_source += (x - i) * ((j + 1 - y) * front[node] + (y - j) * front[node + 1])
    scale = 1.0 / at_source
    ahead, image, later = fields[0], fields[1], fields[2]
    for n in range(slowness.size):
        image[n] = np.float32(slowness[n] * scale)
    if curved:
        for n in range(front.size):
            ahead[n] = np.float32(front[n] * scale)
        deviate(ahead, x, y, at, later)
    else:
        later[:] = np.float32(0.0)
    interleave(later, image, shape, readable)
    count = len(receivers)
    nearness = np.empty(count)
    for r in range(count):
        nearness[r] = -math.hypot(receivers[r, 0] - x, receivers[r, 1] - y)
    order = np.argsort(nearness)
    for k in range(count):
        rays.x[k] = np.float32(receivers[order[k], 0])
        rays.y[k] = np.float32(receivers[order[k], 1])
    steps = trace_bundle(x, y, readable, shape, count, rays)
    # A node of the source's slowness takes this long.
    unit = at_source * spacing
    worth = np.zeros(count, np.float32)
    for k in range(count):
        r = order[k]
        left[r] = measured[r] - rays.time[k] * unit
        if rays.length[k] > np.float32(0.0):
            worth[k] = np.float32(left[r] / rays.length[k])
    back_project(worth, steps, shape, rays, sums)


@kernel
def _update(
    sums: Float32s,
    slowness: Floats,
    coverage: Floats,
    region: Flags,
    spacing: float,
    relaxation: float,
    weights: Float32s,
    bounds: tuple[float, float],
    shape: tuple[int, int],
    change: Float32s,
    scratch: Float32s,
) -> None:
    zero = np.float32(0.0)
    for n in range(region.size):
        passed = sums[2 * n + 1]
        moves = (passed > zero) & region[n]
        change[n] = sums[2 * n] / passed if moves else zero
        coverage[n] += passed * spacing
    sums[:] = zero
    _smooth(change, weights, shape, scratch)
    scale = relaxation / spacing
    for n in range(region.size):
        moved = min(max(slowness[n] + scale * change[n], bounds[0]), bounds[1])
        slowness[n] = moved if region[n] else slowness[n]


@kernel
def _smooth(image: Float32s, weights: Float32s, shape: tuple[int, int], scratch: Float32s) -> None:
    """Convolve with a symmetric kernel along both axes, in place; nodes on the rim go on beyond it."""
    nx, ny = shape
    reach = len(weights) - 1
    if reach == 0:
        return
    middle = weights[0]
    for i in range(nx):
        here = np.uint64(i * ny)
        for j in range(np.uint64(ny)):
            scratch[here + j] = middle * image[here + j]
        for d in range(1, reach + 1):
            before, after = np.uint64(max(i - d, 0) * ny), np.uint64(min(i + d, nx - 1) * ny)
            weight = weights[d]
            for j in range(np.uint64(ny)):
                scratch[here + j] += weight * (image[before + j] + image[after + j])
    line = np.empty(ny + 2 * reach, np.float32)
    for i in range(nx):
        here = np.uint64(i * ny)
        for d in range(reach):
            line[d] = scratch[here]
            line[ny + reach + d] = scratch[here + np.uint64(ny - 1)]
        for j in range(np.uint64(ny)):
            line[j + np.uint64(reach)] = scratch[here + j]
            image[here + j] = middle * scratch[here + j]
        for d in range(1, reach + 1):
            weight = weights[d]
            for j in range(np.uint64(ny)):
                image[here + j] += weight * (line[j + np.uint64(reach + d)] + line[j + np.uint64(reach - d)])

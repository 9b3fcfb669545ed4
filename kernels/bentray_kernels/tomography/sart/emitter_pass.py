"""SART of one emitter over a slice: wave front, rays and back-projection in one compiled call (2-D)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...arrays import Flags, Float32s, Floats
from ...compilation.compiled import kernel
from ...eikonal.deviation import SweepArrays, allocate_sweep_arrays, deviate
from ...rays.vectorised import Bundle, allocate_bundle, back_project, interleave, trace_bundle

# Standard deviations at which the Gaussian of an update is truncated.
TRUNCATE = 4.0


class EmitterPass(NamedTuple):
    """Work arrays for one grid; their content is not kept between updates.

    Attributes:
        shape: of the grid.
        front, rays: of the wave front and of the rays.
        fields: relative slowness for the front and for the rays, and u; (3, nodes).
        interleaved: the fields that rays read at each node, see ``interleave``.
        sums: Σ correction·w and Σ w of each node in turn since the last update, (2·nodes,).
    """

    shape: tuple[int, int]
    front: SweepArrays
    rays: Bundle
    fields: Float32s
    interleaved: Float32s
    sums: Float32s

    @classmethod
    def for_grid(cls, shape: tuple[int, int], receivers: int) -> EmitterPass:
        """Work arrays for up to so many receivers of an emitter."""
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
            front: as ``slowness``, for the wave front, s/m; None for straight rays.
            spacing: m.
            source: (2,), m, in the grid.
            receivers: (k, 2), m, in the grid.
            measured: (k,), travel times, s.

        Returns:
            (k,), measured minus predicted travel times, s.
        """
        residual = np.empty(len(receivers))
        curved, speeds = front is not None, (slowness if front is None else front).ravel()
        ends = source / spacing, receivers / spacing
        _trace(self, slowness.ravel(), speeds, curved, spacing, *ends, measured, residual)
        return residual

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
        image = slowness.reshape(-1), coverage.reshape(-1), region.ravel()
        _update(self, *image, spacing, relaxation, gaussian(smoothing), bounds)


def gaussian(deviation: float) -> Float32s:
    """Weights of a Gaussian from its middle outwards; 1 for a deviation of 0."""
    if not deviation > 0.0:
        return np.ones(1, np.float32)
    reach = np.arange(int(TRUNCATE * deviation + 0.5) + 1)
    weights = np.exp(-0.5 * (reach / deviation) ** 2)
    return np.asarray(weights / (2.0 * weights.sum() - 1.0), dtype=np.float32)


@kernel
def _trace(
    work: EmitterPass,
    slowness: Floats,
    front: Floats,
    curved: bool,
    spacing: float,
    source: Floats,
    receivers: Floats,
    measured: Floats,
    residual: Floats,
) -> None:
    shape, rays = work.shape, work.rays
    x, y = source
    i, j = min(int(x), shape[0] - 2), min(int(y), shape[1] - 2)
    node = i * shape[1] + j
    at_source = (i + 1 - x) * ((j + 1 - y) * front[node] + (y - j) * front[node + 1])
    node += shape[1]
    at_source += (x - i) * ((j + 1 - y) * front[node] + (y - j) * front[node + 1])
    scale = 1.0 / at_source
    relative_front, image, deviation = work.fields[0], work.fields[1], work.fields[2]
    for n in range(slowness.size):
        image[n] = np.float32(slowness[n] * scale)
    if curved:
        for n in range(front.size):
            relative_front[n] = np.float32(front[n] * scale)
        deviate(relative_front, x, y, work.front, deviation)
    else:
        deviation[:] = np.float32(0.0)
    interleave(deviation, image, shape, work.interleaved)
    count = len(receivers)
    nearness = np.empty(count)
    for r in range(count):
        nearness[r] = -math.hypot(receivers[r, 0] - x, receivers[r, 1] - y)
    order = np.argsort(nearness)
    for k in range(count):
        rays.x[k] = np.float32(receivers[order[k], 0])
        rays.y[k] = np.float32(receivers[order[k], 1])
    steps = trace_bundle(x, y, work.interleaved, shape, count, rays)
    # Crossing time of a node with the slowness of the source, s.
    unit = at_source * spacing
    correction = np.zeros(count, np.float32)
    for k in range(count):
        r = order[k]
        residual[r] = measured[r] - rays.time[k] * unit
        if rays.length[k] > np.float32(0.0):
            correction[k] = np.float32(residual[r] / rays.length[k])
    back_project(correction, steps, shape, rays, work.sums)


@kernel
def _update(
    work: EmitterPass,
    slowness: Floats,
    coverage: Floats,
    region: Flags,
    spacing: float,
    relaxation: float,
    weights: Float32s,
    bounds: tuple[float, float],
) -> None:
    sums, change, scratch = work.sums, work.fields[0], work.fields[1]
    zero = np.float32(0.0)
    for n in range(region.size):
        passed = sums[2 * n + 1]
        moves = (passed > zero) & region[n]
        change[n] = sums[2 * n] / passed if moves else zero
        coverage[n] += passed * spacing
    sums[:] = zero
    _smooth(change, weights, work.shape, scratch)
    scale = relaxation / spacing
    for n in range(region.size):
        moved = min(max(slowness[n] + scale * change[n], bounds[0]), bounds[1])
        slowness[n] = moved if region[n] else slowness[n]


@kernel
def _smooth(image: Float32s, weights: Float32s, shape: tuple[int, int], scratch: Float32s) -> None:
    """Convolve with a symmetric kernel along both axes, in place; constant beyond the boundary."""
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

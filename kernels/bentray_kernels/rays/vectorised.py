"""Vectorised ray tracing and back-projection: all rays of one source advance together (2-D, float32).

The steps of one ray depend on each other; those of different rays do not, and fill the vector registers.
Positions are in nodes. The gradient of the travel time is ∇r + ∇u, see ``eikonal.deviation``.
"""

import math
from typing import NamedTuple

import numpy as np

from ..arrays import Float32s, Ints
from ..compilation.compiled import kernel

ZERO, HALF, ONE = (np.float32(x) for x in (0.0, 0.5, 1.0))

# Length of a step, nodes; fields are interpolated at its midpoint. Steps of 1 give the same error on
# Table 6, 3.70 %.
STRIDE = np.float32(1.5)

# Most steps, in sums of the nodes along both sides. A ray that needs more is caught where the discrete
# gradient has no downhill direction; a straight ray replaces it.
LONGEST = 2

# A ray this near to its source, nodes, has arrived.
ARRIVED = np.float32(1e-3)

# Added to divisors.
TINY = np.float32(1e-12)


class Bundle(NamedTuple):
    """Rays, and the steps that they have taken.

    Attributes:
        x, y: position of each ray, (rays,), nodes.
        to_x, to_y: unit vector of its last step, (rays,).
        length: of the ray so far, (rays,), nodes.
        time: integral of the slowness so far, (rays,).
        read: interpolated at the midpoint of the step, (4·rays,): ∇u, slowness, padding.
        middle_x, middle_y, part: midpoint and length of each step, (steps, rays).
        active: number of rays that take each step, (steps,): the first of them.
    """

    x: Float32s
    y: Float32s
    to_x: Float32s
    to_y: Float32s
    length: Float32s
    time: Float32s
    read: Float32s
    middle_x: Float32s
    middle_y: Float32s
    part: Float32s
    active: Ints


def allocate_bundle(rays: int, shape: tuple[int, int]) -> Bundle:
    """Memory for up to ``rays`` rays through a grid; used again for every source."""
    steps = LONGEST * sum(shape)
    x, y, to_x, to_y, length, time = np.empty((6, rays), np.float32)
    middle_x, middle_y, fraction = np.empty((3, steps, rays), np.float32)
    read, active = np.empty(4 * rays, np.float32), np.empty(steps, np.int64)
    return Bundle(x, y, to_x, to_y, length, time, read, middle_x, middle_y, fraction, active)


@kernel
def interleave(deviation: Float32s, slowness: Float32s, shape: tuple[int, int], out: Float32s) -> None:
    """Interleave ∇u, slowness and padding of each node, (4·nodes,), in one cache line per ray.

    Central differences, one-sided at the boundary.
    """
    nx, ny = shape
    one, four = np.uint64(1), np.uint64(4)
    for i in range(nx):
        low, high = max(i - 1, 0), min(i + 1, nx - 1)
        scale = np.float32(1.0 / (high - low))
        here, before, after = np.uint64(i * ny), np.uint64(low * ny), np.uint64(high * ny)
        for j in range(one, np.uint64(ny - 1)):
            out[four * (here + j)] = scale * (deviation[after + j] - deviation[before + j])
            out[four * (here + j) + np.uint64(1)] = HALF * (
                deviation[here + j + one] - deviation[here + j - one]
            )
            out[four * (here + j) + np.uint64(2)] = slowness[here + j]
            out[four * (here + j) + np.uint64(3)] = ZERO
        for j, inner, outer in ((0, 0, 1), (ny - 1, ny - 2, ny - 1)):
            node = 4 * (i * ny + j)
            out[node] = scale * (deviation[high * ny + j] - deviation[low * ny + j])
            out[node + 1] = deviation[i * ny + outer] - deviation[i * ny + inner]
            out[node + 2] = slowness[i * ny + j]
            out[node + 3] = ZERO


@kernel
def trace_bundle(x: float, y: float, fields: Float32s, shape: tuple[int, int], rays: int, at: Bundle) -> int:
    """Trace the first ``rays`` rays of ``at`` from their positions to the source; returns the steps.

    Direction and slowness are interpolated half a step ahead along the last direction.

    Args:
        x, y: the source.
        fields: from ``interleave``; u and slowness relative to the slowness at the source.
        rays: their number; the longest first.
    """
    source_x, source_y = np.float32(x), np.float32(y)
    for r in range(rays):
        off_x, off_y = source_x - at.x[r], source_y - at.y[r]
        inverse = ONE / (np.float32(math.sqrt(off_x * off_x + off_y * off_y)) + TINY)
        at.to_x[r], at.to_y[r] = off_x * inverse, off_y * inverse
        at.length[r] = at.time[r] = ZERO
    left, steps = rays, 0
    while left > 0 and steps < len(at.active):
        at.active[steps] = left
        _predict_midpoints(source_x, source_y, shape, left, steps, at)
        _interpolate(fields, shape, left, steps, at)
        _advance(source_x, source_y, shape, left, steps, at)
        steps += 1
        while left > 0 and _has_arrived(source_x, source_y, left - 1, at):
            left -= 1
    for r in range(left):
        if not _has_arrived(source_x, source_y, r, at):
            _trace_straight(source_x, source_y, fields, shape, r, steps, at)
    return steps


@kernel(inline="always")
def _has_arrived(x: np.float32, y: np.float32, r: int, at: Bundle) -> bool:
    return bool((at.x[r] - x) ** 2 + (at.y[r] - y) ** 2 < ARRIVED * ARRIVED)


@kernel
def _predict_midpoints(
    x: np.float32, y: np.float32, shape: tuple[int, int], rays: int, step: int, at: Bundle
) -> None:
    """Length of the next step of each ray, and its midpoint."""
    last_x, last_y = np.float32(shape[0] - 1), np.float32(shape[1] - 1)
    xs, ys, to_x, to_y = at.x, at.y, at.to_x, at.to_y
    middle_x, middle_y, part = at.middle_x[step], at.middle_y[step], at.part[step]
    for r in range(np.uint64(rays)):
        off_x, off_y = x - xs[r], y - ys[r]
        distance = np.sqrt(off_x * off_x + off_y * off_y)
        size = distance if distance <= STRIDE else STRIDE
        middle_x[r] = _clamp(xs[r] + HALF * size * to_x[r], last_x)
        middle_y[r] = _clamp(ys[r] + HALF * size * to_y[r], last_y)
        part[r] = size


@kernel
def _interpolate(fields: Float32s, shape: tuple[int, int], rays: int, step: int, at: Bundle) -> None:
    """The fields at each midpoint, multilinear; the only loop with gathered loads."""
    low_x, low_y = np.int32(shape[0] - 2), np.int32(shape[1] - 2)
    line = shape[1]
    middle_x, middle_y, read = at.middle_x[step], at.middle_y[step], at.read
    for r in range(np.uint64(rays)):
        px, py = middle_x[r], middle_y[r]
        i, j = min(np.int32(px), low_x), min(np.int32(py), low_y)
        fx, fy = px - np.float32(i), py - np.float32(j)
        wd = fx * fy
        wb, wc = fy - wd, fx - wd
        wa = ONE - fx - wb
        a = np.uint64(4 * (i * line + j))
        c = np.uint64(4 * (i * line + j + line))
        out = np.uint64(4) * r
        one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
        four, five, six, seven = np.uint64(4), np.uint64(5), np.uint64(6), np.uint64(7)
        v0 = wa * fields[a] + wb * fields[a + four] + wc * fields[c] + wd * fields[c + four]
        v1 = wa * fields[a + one] + wb * fields[a + five] + wc * fields[c + one] + wd * fields[c + five]
        v2 = wa * fields[a + two] + wb * fields[a + six] + wc * fields[c + two] + wd * fields[c + six]
        v3 = wa * fields[a + three] + wb * fields[a + seven] + wc * fields[c + three] + wd * fields[c + seven]
        read[out] = v0
        read[out + one] = v1
        read[out + two] = v2
        read[out + three] = v3


@kernel
def _advance(x: np.float32, y: np.float32, shape: tuple[int, int], rays: int, step: int, at: Bundle) -> None:
    """Advance each ray along −(∇r + ∇u) or, within a step of the source, straight to it."""
    last_x, last_y = np.float32(shape[0] - 1), np.float32(shape[1] - 1)
    xs, ys, to_x, to_y, length, time, read = at.x, at.y, at.to_x, at.to_y, at.length, at.time, at.read
    middle_x, middle_y, part = at.middle_x[step], at.middle_y[step], at.part[step]
    for r in range(np.uint64(rays)):
        size, begin_x, begin_y = part[r], xs[r], ys[r]
        gx, gy, slowness = (
            read[np.uint64(4) * r],
            read[np.uint64(4) * r + np.uint64(1)],
            read[np.uint64(4) * r + np.uint64(2)],
        )
        off_x, off_y = x - middle_x[r], y - middle_y[r]
        inverse = ONE / np.sqrt(off_x * off_x + off_y * off_y + TINY)
        gx, gy = off_x * inverse - gx, off_y * inverse - gy
        off_x, off_y = x - begin_x, y - begin_y
        near = size < STRIDE
        gx, gy = off_x if near else gx, off_y if near else gy
        inverse = ONE / np.sqrt(gx * gx + gy * gy + TINY)
        gx, gy = gx * inverse, gy * inverse
        xs[r] = _clamp(begin_x + size * gx, last_x)
        ys[r] = _clamp(begin_y + size * gy, last_y)
        to_x[r], to_y[r] = gx, gy
        length[r] += size
        time[r] += size * slowness


@kernel(inline="always")
def _clamp(place: np.float32, last: np.float32) -> np.float32:
    place = place if place > ZERO else ZERO
    return place if place < last else last


@kernel
def _trace_straight(
    x: np.float32, y: np.float32, fields: Float32s, shape: tuple[int, int], r: int, steps: int, at: Bundle
) -> None:
    """Replace a ray that has not arrived by a straight one, in as many steps."""
    # Its first midpoint lies half a step from its start, straight towards the source.
    off_x, off_y = x - at.middle_x[0, r], y - at.middle_y[0, r]
    distance = math.sqrt(off_x * off_x + off_y * off_y)
    length = distance + HALF * at.part[0, r]
    begin_x, begin_y = x - off_x * length / distance, y - off_y * length / distance
    at.time[r], at.length[r] = ZERO, np.float32(length)
    for step in range(steps):
        along = (step + 0.5) / steps
        px, py = np.float32(begin_x + along * (x - begin_x)), np.float32(begin_y + along * (y - begin_y))
        i, j = min(int(px), shape[0] - 2), min(int(py), shape[1] - 2)
        fx, fy = px - i, py - j
        node = 4 * (i * shape[1] + j) + 2
        here = (1 - fx) * ((1 - fy) * fields[node] + fy * fields[node + 4])
        node += 4 * shape[1]
        here += fx * ((1 - fy) * fields[node] + fy * fields[node + 4])
        size = np.float32(length / steps)
        at.time[r] += size * np.float32(here)
        at.middle_x[step, r], at.middle_y[step, r], at.part[step, r] = px, py, size


@kernel
def back_project(correction: Float32s, steps: int, shape: tuple[int, int], at: Bundle, out: Float32s) -> None:
    """Distribute the length of each step, also times the ray's correction, to the nodes around it.

    Args:
        correction: (rays,).
        out: Σ correction·w and Σ w, interleaved, (2·nodes,); added to.
    """
    low_x, low_y = np.int32(shape[0] - 2), np.int32(shape[1] - 2)
    line = np.int32(shape[1])
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    for step in range(steps):
        for r in range(at.active[step]):
            px, py, size, value = at.middle_x[step, r], at.middle_y[step, r], at.part[step, r], correction[r]
            i, j = min(np.int32(px), low_x), min(np.int32(py), low_y)
            fx, fy = px - np.float32(i), py - np.float32(j)
            node = np.uint64(2 * (i * line + j))
            high = fx * size
            low = size - high
            w = low * fy
            v = low - w
            out[node] += value * v
            out[node + one] += v
            out[node + two] += value * w
            out[node + three] += w
            node += np.uint64(2 * line)
            w = high * fy
            v = high - w
            out[node] += value * v
            out[node + one] += v
            out[node + two] += value * w
            out[node + three] += w

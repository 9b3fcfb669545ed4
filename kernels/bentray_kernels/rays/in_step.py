"""All rays of one source traced in step, a part of each at a time, and what they pass (2-D, 32 bits).

One ray waits for itself: where it goes next hangs on what it has just read. Rays side by side do not, and
fill the vectors. Positions are in nodes, and the front's direction is ∇r + ∇u, see ``eikonal.deviation``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Ints
from ..compiled import kernel

Singles = NDArray[np.float32]

ZERO, HALF, ONE = (np.float32(x) for x in (0.0, 0.5, 1.0))

# Length of a step, nodes; each is read at its middle. On Table 6 steps of 1 give the same error, 3.70 %.
STRIDE = np.float32(1.5)

# Steps that no ray needs more of, over the number of nodes along both sides. One that does has been caught
# where the discrete gradient has no downhill, and goes straight.
LONGEST = 2

# A ray this near to its source, nodes, has arrived.
ARRIVED = np.float32(1e-3)

# Added to what divides.
TINY = np.float32(1e-12)


class Bundle(NamedTuple):
    """Rays under way, and the parts that they have passed.

    Attributes:
        x, y: where each ray is, (rays,), nodes.
        to_x, to_y: unit vector of its last step, (rays,).
        length: nodes so far, (rays,).
        time: integral of the slowness so far, (rays,).
        read: what each ray has just read, (4·rays,): ∇u, slowness, nothing.
        middle_x, middle_y, part: of each step: where it is read, and its length; (steps, rays).
        going: rays that took each step, (steps,): the first so many.
    """

    x: Singles
    y: Singles
    to_x: Singles
    to_y: Singles
    length: Singles
    time: Singles
    read: Singles
    middle_x: Singles
    middle_y: Singles
    part: Singles
    going: Ints


def bundle(rays: int, shape: tuple[int, int]) -> Bundle:
    """Room for so many rays through a grid; used again from source to source."""
    steps = LONGEST * sum(shape)
    x, y, to_x, to_y, length, time = np.empty((6, rays), np.float32)
    middle_x, middle_y, part = np.empty((3, steps, rays), np.float32)
    read, going = np.empty(4 * rays, np.float32), np.empty(steps, np.int64)
    return Bundle(x, y, to_x, to_y, length, time, read, middle_x, middle_y, part, going)


@kernel
def lay_out(later: Singles, slowness: Singles, shape: tuple[int, int], into: Singles) -> None:
    """∇u, slowness and nothing of each node in turn, (4·nodes,): one ray reads them all at once.

    Central differences, one-sided on the rim.
    """
    nx, ny = shape
    one, four = np.uint64(1), np.uint64(4)
    for i in range(nx):
        low, high = max(i - 1, 0), min(i + 1, nx - 1)
        scale = np.float32(1.0 / (high - low))
        here, before, after = np.uint64(i * ny), np.uint64(low * ny), np.uint64(high * ny)
        for j in range(one, np.uint64(ny - 1)):
            into[four * (here + j)] = scale * (later[after + j] - later[before + j])
            into[four * (here + j) + np.uint64(1)] = HALF * (later[here + j + one] - later[here + j - one])
            into[four * (here + j) + np.uint64(2)] = slowness[here + j]
            into[four * (here + j) + np.uint64(3)] = ZERO
        for j, inner, outer in ((0, 0, 1), (ny - 1, ny - 2, ny - 1)):
            node = 4 * (i * ny + j)
            into[node] = scale * (later[high * ny + j] - later[low * ny + j])
            into[node + 1] = later[i * ny + outer] - later[i * ny + inner]
            into[node + 2] = slowness[i * ny + j]
            into[node + 3] = ZERO


@kernel
def follow(x: float, y: float, fields: Singles, shape: tuple[int, int], rays: int, at: Bundle) -> int:
    """Bring the first ``rays`` rays of ``at`` from where they are to the source; returns the steps.

    The direction is read where the last one would lead in half a step, the slowness there as well.

    Args:
        x, y: the source.
        fields: from ``lay_out``; u and the slowness in units of that of the source.
        rays: the longest first.
    """
    source_x, source_y = np.float32(x), np.float32(y)
    for r in range(rays):
        off_x, off_y = source_x - at.x[r], source_y - at.y[r]
        inverse = ONE / (np.float32(math.sqrt(off_x * off_x + off_y * off_y)) + TINY)
        at.to_x[r], at.to_y[r] = off_x * inverse, off_y * inverse
        at.length[r] = at.time[r] = ZERO
    left, steps = rays, 0
    while left > 0 and steps < len(at.going):
        at.going[steps] = left
        _look_ahead(source_x, source_y, shape, left, steps, at)
        _read(fields, shape, left, steps, at)
        _go(source_x, source_y, shape, left, steps, at)
        steps += 1
        while left > 0 and _arrived(source_x, source_y, left - 1, at):
            left -= 1
    for r in range(left):
        if not _arrived(source_x, source_y, r, at):
            _straighten(source_x, source_y, fields, shape, r, steps, at)
    return steps


@kernel(inline="always")
def _arrived(x: np.float32, y: np.float32, r: int, at: Bundle) -> bool:
    return bool((at.x[r] - x) ** 2 + (at.y[r] - y) ** 2 < ARRIVED * ARRIVED)


@kernel
def _look_ahead(
    x: np.float32, y: np.float32, shape: tuple[int, int], rays: int, step: int, at: Bundle
) -> None:
    """Size of the next step of each ray, and where it is read."""
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
def _read(fields: Singles, shape: tuple[int, int], rays: int, step: int, at: Bundle) -> None:
    """The fields where each ray is read, multilinear; the one loop whose reads no vector can hold."""
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
        into = np.uint64(4) * r
        one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
        four, five, six, seven = np.uint64(4), np.uint64(5), np.uint64(6), np.uint64(7)
        v0 = wa * fields[a] + wb * fields[a + four] + wc * fields[c] + wd * fields[c + four]
        v1 = wa * fields[a + one] + wb * fields[a + five] + wc * fields[c + one] + wd * fields[c + five]
        v2 = wa * fields[a + two] + wb * fields[a + six] + wc * fields[c + two] + wd * fields[c + six]
        v3 = wa * fields[a + three] + wb * fields[a + seven] + wc * fields[c + three] + wd * fields[c + seven]
        read[into] = v0
        read[into + one] = v1
        read[into + two] = v2
        read[into + three] = v3


@kernel
def _go(x: np.float32, y: np.float32, shape: tuple[int, int], rays: int, step: int, at: Bundle) -> None:
    """The step of each ray, down ∇r + ∇u or, where the source is a step away, straight to it."""
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
def _straighten(
    x: np.float32, y: np.float32, fields: Singles, shape: tuple[int, int], r: int, steps: int, at: Bundle
) -> None:
    """Let a ray that was caught go straight from where it began, in as many steps as there were."""
    # Its first middle lies half a step, straight towards the source, from where it began.
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
def spread(worth: Singles, steps: int, shape: tuple[int, int], at: Bundle, into: Singles) -> None:
    """Give each part of a ray, times what the ray is worth and as it is, to the nodes around it.

    Args:
        worth: (rays,).
        into: Σ worth·w, Σ w of each node in turn, (2·nodes,); added to.
    """
    low_x, low_y = np.int32(shape[0] - 2), np.int32(shape[1] - 2)
    line = np.int32(shape[1])
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    for step in range(steps):
        for r in range(at.going[step]):
            px, py, size, value = at.middle_x[step, r], at.middle_y[step, r], at.part[step, r], worth[r]
            i, j = min(np.int32(px), low_x), min(np.int32(py), low_y)
            fx, fy = px - np.float32(i), py - np.float32(j)
            node = np.uint64(2 * (i * line + j))
            high = fx * size
            low = size - high
            w = low * fy
            v = low - w
            into[node] += value * v
            into[node + one] += v
            into[node + two] += value * w
            into[node + three] += w
            node += np.uint64(2 * line)
            w = high * fy
            v = high - w
            into[node] += value * v
            into[node + one] += v
            into[node + two] += value * w
            into[node + three] += w

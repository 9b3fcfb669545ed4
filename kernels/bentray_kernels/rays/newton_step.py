"""Newton step of ray bending: block tridiagonal Hessian of the travel time, its elimination and solution."""

import math
from typing import NamedTuple

import numpy as np

from ..arrays import Floats
from ..compilation.compiled import kernel

# Largest shift of a point in a step, nodes: the quadratic model is local.
MAX_SHIFT = 2.0

# Shorter segments get the tension of this length, nodes.
MIN_LENGTH = 1e-3

# Pivots below this fraction of the path's own tension: the Hessian is not positive definite.
MIN_PIVOT = 1e-9


class Bending(NamedTuple):
    """Intermediate values at every point, and on the segment to the next one.

    Attributes:
        slowness, slope, second: at the point, derivatives per node; (points,), (points, n), (points, n, n).
        vector, length, tension: of the segment: to the next point, length, mean slowness over length.
        normal: unit vectors normal to the path, (points, n − 1, n).
        inverse: of the pivots of the elimination, (points, n − 1, n − 1).
        couple: block of the Hessian between the previous point and this one, (points, n − 1, n − 1).
        right: right-hand side after the elimination, (points, n − 1).
        before, move: point before a step, and the step; (points, n).
    """

    slowness: Floats
    slope: Floats
    second: Floats
    vector: Floats
    length: Floats
    tension: Floats
    normal: Floats
    inverse: Floats
    couple: Floats
    right: Floats
    before: Floats
    move: Floats


@kernel
def allocate_bending(points: int, shape: tuple[int, ...]) -> Bending:
    """Memory for paths of up to ``points`` points in a grid of that shape."""
    n = len(shape)
    return Bending(
        np.empty(points),
        np.empty((points, n)),
        np.empty((points, n, n)),
        np.empty((points, n)),
        np.empty(points),
        np.empty(points),
        np.empty((points, n - 1, n)),
        np.empty((points, n - 1, n - 1)),
        np.empty((points, n - 1, n - 1)),
        np.empty((points, n - 1)),
        np.empty((points, n)),
        np.empty((points, n)),
    )


@kernel(inline="always")
def _normals(k: int, axes: int, work: Bending) -> None:
    """Unit vectors normal to the path at point k; in 3-D the first is close to that of the previous point."""
    if axes == 2:
        x = work.vector[k - 1, 0] + work.vector[k, 0]
        y = work.vector[k - 1, 1] + work.vector[k, 1]
        scale = 1.0 / math.sqrt(max(x * x + y * y, 1e-300))
        work.normal[k, 0, 0] = -y * scale
        work.normal[k, 0, 1] = x * scale
        return
    x = work.vector[k - 1, 0] + work.vector[k, 0]
    y = work.vector[k - 1, 1] + work.vector[k, 1]
    z = work.vector[k - 1, axes - 1] + work.vector[k, axes - 1]
    scale = 1.0 / math.sqrt(max(x * x + y * y + z * z, 1e-300))
    x, y, z = x * scale, y * scale, z * scale
    if k > 1:
        u, v, w = work.normal[k - 1, 0, 0], work.normal[k - 1, 0, 1], work.normal[k - 1, 0, axes - 1]
    else:
        u, v, w = 0.0, 0.0, 0.0
    along = u * x + v * y + w * z
    u, v, w = u - along * x, v - along * y, w - along * z
    if u * u + v * v + w * w < 0.1:
        # The first point, or a sharp bend: the axis most nearly normal to the path.
        u, v, w = 1.0 - x * x, -x * y, -x * z
        if abs(y) <= abs(x) and abs(y) <= abs(z):
            u, v, w = -x * y, 1.0 - y * y, -y * z
        elif abs(z) <= abs(x):
            u, v, w = -x * z, -y * z, 1.0 - z * z
    scale = 1.0 / math.sqrt(u * u + v * v + w * w)
    u, v, w = u * scale, v * scale, w * scale
    work.normal[k, 0, 0], work.normal[k, 0, 1], work.normal[k, 0, axes - 1] = u, v, w
    work.normal[k, 1, 0] = y * w - z * v
    work.normal[k, 1, 1] = z * u - x * w
    work.normal[k, 1, axes - 1] = x * v - y * u


@kernel(inline="always")
def factorise(count: int, shape: tuple[int, ...], curved: bool, work: Bending) -> float:
    """Forward elimination of Hessian H and gradient g; ½·gᵀH⁻¹g, or −1 if H is not positive definite.

    Without ``curved`` H contains only the tension of the path, which is positive for every path that does not
    fold back on itself.
    """
    medium = 1.0 if curved else 0.0
    axes = len(shape)
    normals = axes - 1
    decrease = 0.0
    for k in range(1, count - 1):
        _normals(k, axes, work)
        before, after = work.tension[k - 1], work.tension[k]
        length_before, length_after = work.length[k - 1], work.length[k]
        half = 0.5 * (length_before + length_after)
        tension = before + after
        d00 = d01 = d11 = g0 = g1 = 0.0
        mixed_before = before
        mixed_after = after
        for i in range(normals):
            slope = along_before = along_after = 0.0
            for a in range(axes):
                n = work.normal[k, i, a]
                slope += work.slope[k, a] * n
                along_before += work.vector[k - 1, a] * n
                along_after += work.vector[k, a] * n
            gradient = half * slope + before * along_before - after * along_after
            cos_before = along_before / max(length_before, MIN_LENGTH)
            cos_after = along_after / max(length_after, MIN_LENGTH)
            mixed_before *= cos_before
            mixed_after *= cos_after
            bend_ii = 0.0
            for a in range(axes):
                for b in range(axes):
                    bend_ii += work.normal[k, i, a] * work.second[k, a, b] * work.normal[k, i, b]
            d_ii = (
                before * (1.0 - cos_before * cos_before)
                + after * (1.0 - cos_after * cos_after)
                + medium * half * bend_ii
                + medium * slope * (cos_before - cos_after)
            )
            if i == 0:
                g0, d00 = gradient, d_ii
            else:
                g1, d11 = gradient, d_ii
        if normals == 2:
            d01 -= mixed_before + mixed_after
            for a in range(axes):
                for b in range(axes):
                    d01 += medium * half * work.normal[k, 0, a] * work.second[k, a, b] * work.normal[k, 1, b]
        # Schur complement of the previous point: Cᵀ·S⁻¹·C, with C the coupling to it.
        t00 = t01 = t11 = 0.0
        if k > 1:
            for i in range(normals):
                for j in range(normals):
                    dot = mixed_i = mixed_j = 0.0
                    for a in range(axes):
                        n_i = work.normal[k - 1, i, a]
                        n_j = work.normal[k, j, a]
                        dot += n_i * n_j
                        mixed_i += work.vector[k - 1, a] * n_i
                        mixed_j += work.vector[k - 1, a] * n_j
                    square = max(length_before, MIN_LENGTH) ** 2
                    work.couple[k, i, j] = -before * (dot - mixed_i * mixed_j / square)
            for i in range(normals):
                # Row i of S⁻¹·C of the previous point.
                r0 = r1 = 0.0
                for j in range(normals):
                    s = work.inverse[k - 1, i, j]
                    r0 += s * work.couple[k, j, 0]
                    if normals == 2:
                        r1 += s * work.couple[k, j, 1]
                c0 = work.couple[k, i, 0]
                t00 += c0 * r0
                t01 += c0 * r1
                if normals == 2:
                    t11 += work.couple[k, i, 1] * r1
                # yᵀ·S⁻¹·C
                y = work.right[k - 1, i]
                g0 -= y * r0
                g1 -= y * r1
        least = MIN_PIVOT * tension
        if normals == 1:
            pivot = d00 - t00
            if pivot <= least:
                return -1.0
            work.inverse[k, 0, 0] = 1.0 / pivot
            work.right[k, 0] = g0
            decrease += 0.5 * g0 * g0 * work.inverse[k, 0, 0]
        else:
            p00, p01, p11 = d00 - t00, d01 - t01, d11 - t11
            if p00 <= least or p00 * p11 - p01 * p01 <= least * p00:
                return -1.0
            determinant = p00 * p11 - p01 * p01
            scale = 1.0 / determinant
            last = normals - 1
            work.inverse[k, 0, 0] = p11 * scale
            work.inverse[k, 0, last] = -p01 * scale
            work.inverse[k, last, 0] = -p01 * scale
            work.inverse[k, last, last] = p00 * scale
            work.right[k, 0] = g0
            work.right[k, last] = g1
            decrease += 0.5 * scale * (g0 * g0 * p11 - 2.0 * g0 * g1 * p01 + g1 * g1 * p00)
    return decrease


@kernel(inline="always")
def shift(path: Floats, count: int, shape: tuple[int, ...], work: Bending) -> None:
    """Back substitution: store the points, then move them by −H⁻¹g normal to the path, inside the grid."""
    axes = len(shape)
    normals = axes - 1
    after0 = after1 = 0.0
    for k in range(count - 2, 0, -1):
        # The right-hand side minus the coupling to the next point, times the inverse pivot.
        for i in range(normals):
            if k < count - 2:
                work.right[k, i] += work.couple[k + 1, i, 0] * after0
                if normals == 2:
                    work.right[k, i] += work.couple[k + 1, i, 1] * after1
        x0 = x1 = 0.0
        for j in range(normals):
            x0 -= work.inverse[k, 0, j] * work.right[k, j]
            if normals == 2:
                x1 -= work.inverse[k, 1, j] * work.right[k, j]
        x0 = min(max(x0, -MAX_SHIFT), MAX_SHIFT)
        x1 = min(max(x1, -MAX_SHIFT), MAX_SHIFT)
        after0, after1 = x0, x1
        for a in range(axes):
            move = x0 * work.normal[k, 0, a]
            if normals == 2:
                move += x1 * work.normal[k, 1, a]
            to = min(max(path[k, a] + move, 0.0), shape[a] - 1.0)
            work.before[k, a] = path[k, a]
            work.move[k, a] = to - path[k, a]
            path[k, a] = to

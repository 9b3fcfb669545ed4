"""Ray bending: Newton's method on Fermat's principle moves a traced ray to the path of stationary time.

The ray along the gradient of the travel time deviates a little from the true one where the front has an
edge or grazes one. The error of its travel time is the square of that deviation, which along grazing rays
exceeds the error of the travel time itself. Bending (Um & Thurber 1987 relax the points one by one; here all
move at once) depends on the medium only.

A path p_0 … p_m has the time F = Σ ½(s_k + s_k+1)·|p_k+1 − p_k|. Each inner point moves in the plane normal
to the path, so that points cannot cluster where the quadrature error is favourable. The Hessian couples only
neighbours: each step factorises one block tridiagonal matrix. Terms that mix the slope of the slowness at one
point with the shift of another are neglected. Lengths are in nodes and times are slowness times nodes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..arrays import Floats
from ..compiled import kernel
from ..splines.cubic import jet_2d, jet_3d

# Step of the descent before bending, nodes; bending corrects the error of steps longer than ``STEP``.
STRIDE = 1.5

# Relative decrease of the time, predicted for a step, below which the iteration ends.
TOLERANCE = 1e-6

# Most Newton steps; nearly every ray takes one or two.
MAX_STEPS = 40

# Smallest fraction of a step in the line search.
MIN_FRACTION = 0.1

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
        kept, move: point before a step, and the step; (points, n).
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
    kept: Floats
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
def bend(
    path: Floats, count: int, spline: Floats, shape: tuple[int, ...], work: Bending
) -> tuple[float, int]:
    """Move the inner points of ``path``, in nodes; returns the time along it, spacing 1, and its points.

    The time never rises: a step that raises it is halved, and rejected if that does not help. Where the
    Hessian is not positive definite (a maximum of slowness, a shock), the path's tension alone replaces it.

    Args:
        path: (points, ndim); the first and the last of its ``count`` points stay.
        spline: ``splines.coefficients`` of the logarithm of the slowness, which keeps it positive.
        shape: of the grid.
        work: from ``allocate_bending``.
    """
    axes = len(shape)
    count = _merge_short_end(path, count, axes)
    time = _expand(path, count, spline, shape, work)
    decrease = 0.0
    for _ in range(MAX_STEPS):
        decrease = _factorise(count, shape, True, work)
        if decrease < 0.0:
            decrease = _factorise(count, shape, False, work)
        if decrease <= TOLERANCE * time:
            # A path folded back on itself has no positive tension either; it is not changed.
            decrease = max(decrease, 0.0)
            break
        _shift(path, count, shape, work)
        part = 1.0
        after = _expand(path, count, spline, shape, work)
        while after > time and part > MIN_FRACTION:
            part *= 0.5
            for k in range(1, count - 1):
                for a in range(axes):
                    path[k, a] = work.kept[k, a] + part * work.move[k, a]
            after = _expand(path, count, spline, shape, work)
        decrease = 0.0
        if after > time:
            for k in range(1, count - 1):
                for a in range(axes):
                    path[k, a] = work.kept[k, a]
            time = _expand(path, count, spline, shape, work)
            break
        time = after
    # The remaining decrease is below the tolerance and known to its square.
    return time - min(decrease, TOLERANCE * time) + _fourth_order(count, shape, work), count


@kernel(inline="always")
def _merge_short_end(path: Floats, count: int, axes: int) -> int:
    """Merge the last step with the rest of the way to the source where the latter is shorter."""
    if count < 3:
        return count
    step = rest = 0.0
    for a in range(axes):
        step += (path[count - 2, a] - path[count - 3, a]) ** 2
        rest += (path[count - 1, a] - path[count - 2, a]) ** 2
    if rest > 0.25 * step:
        return count
    for a in range(axes):
        path[count - 2, a] = path[count - 1, a]
    return count - 1


@kernel(inline="always")
def _expand(path: Floats, count: int, spline: Floats, shape: tuple[int, ...], work: Bending) -> float:
    """Slowness, its slopes and second derivatives at the points; tension, length and vector of the segments.

    Returns the time along the path.
    """
    axes = len(shape)
    for k in range(count):
        if axes == 2:
            u, gx, gy, xx, xy, yy = jet_2d(spline, path[k, 0], path[k, 1])
            work.slowness[k] = math.exp(u)
            work.slope[k, 0], work.slope[k, 1] = gx, gy
            work.second[k, 0, 0], work.second[k, 0, 1] = xx, xy
            work.second[k, 1, 0], work.second[k, 1, 1] = xy, yy
        else:
            u, gx, gy, gz, xx, xy, xz, yy, yz, zz = jet_3d(spline, path[k, 0], path[k, 1], path[k, axes - 1])
            last = axes - 1
            work.slowness[k] = math.exp(u)
            work.slope[k, 0], work.slope[k, 1], work.slope[k, last] = gx, gy, gz
            work.second[k, 0, 0], work.second[k, 0, 1], work.second[k, 0, last] = xx, xy, xz
            work.second[k, 1, 0], work.second[k, 1, 1], work.second[k, 1, last] = xy, yy, yz
            work.second[k, last, 0], work.second[k, last, 1], work.second[k, last, last] = xz, yz, zz
        # From the logarithm u: ∇s = s·∇u and ∇∇s = s·(∇∇u + ∇u·∇uᵀ).
        for a in range(axes):
            for b in range(axes):
                work.second[k, a, b] += work.slope[k, a] * work.slope[k, b]
                work.second[k, a, b] *= work.slowness[k]
        for a in range(axes):
            work.slope[k, a] *= work.slowness[k]
    time = 0.0
    for k in range(count - 1):
        square = 0.0
        for a in range(axes):
            work.vector[k, a] = path[k + 1, a] - path[k, a]
            square += work.vector[k, a] ** 2
        length = math.sqrt(square)
        mean = 0.5 * (work.slowness[k] + work.slowness[k + 1])
        time += mean * length
        work.tension[k] = mean / max(length, MIN_LENGTH)
        work.length[k] = length
    return time


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
def _factorise(count: int, shape: tuple[int, ...], curved: bool, work: Bending) -> float:
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
def _shift(path: Floats, count: int, shape: tuple[int, ...], work: Bending) -> None:
    """Back substitution: keep the points, then move them by −H⁻¹g normal to the path, inside the grid."""
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
            work.kept[k, a] = path[k, a]
            work.move[k, a] = to - path[k, a]
            path[k, a] = to


@kernel(inline="always")
def _fourth_order(count: int, shape: tuple[int, ...], work: Bending) -> float:
    """Fourth-order correction of the trapezoidal rule over chords: arc length and change of slope.

    A segment of length l that turns by θ is l·θ²/24 longer than its chord. The trapezoid of a function f over
    it is too large by l²/12·(f'(end) − f'(start)) (Euler and Maclaurin); here f' is the slope of the
    slowness along the path.
    """
    axes = len(shape)
    last = count - 1
    more = 0.0
    slope_before, curvature_before = 0.0, 0.0
    for k in range(count):
        # The segments whose directions give the tangent: the two adjacent ones, at an end the two nearest.
        first, second = max(min(k, last - 1) - 1, 0), min(max(k, 1), last - 1)
        length_first, length_second = (
            max(work.length[first], MIN_LENGTH),
            max(work.length[second], MIN_LENGTH),
        )
        # Weights of a circle through them; outside 0 to 1 at the ends, where it is extrapolated.
        share = length_first / (length_first + length_second)
        if k == 0:
            share = -share
        elif k == last:
            share = 2.0 - length_first / (length_first + length_second)
        slope = dot = square = 0.0
        for a in range(axes):
            u = work.vector[first, a] / length_first
            v = work.vector[second, a] / length_second
            dot += u * v
            tangent = (1.0 - share) * u + share * v
            square += tangent * tangent
            slope += work.slope[k, a] * tangent
        slope /= math.sqrt(max(square, MIN_LENGTH))
        # 2 − 2·cos θ = θ² for small turns.
        turn = math.sqrt(max(2.0 - 2.0 * dot, 0.0))
        curvature = 2.0 * turn / (length_first + length_second)
        if k > 0:
            length = work.length[k - 1]
            angle = 0.5 * length * (curvature_before + curvature)
            more += work.tension[k - 1] * length * length * angle * angle / 24.0
            more -= length * length / 12.0 * (slope - slope_before)
        slope_before, curvature_before = slope, curvature
    return more

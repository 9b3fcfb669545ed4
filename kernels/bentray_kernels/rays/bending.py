"""Bend a traced ray until no shift of its points makes it faster (Newton's method on Fermat's principle).

The ray that the travel time's gradient gives runs a little beside the true one wherever the front has an
edge or grazes one. The travel time along it is off by the square of that distance, yet along grazing rays
this is more than the error of the travel time itself. Bending (Um & Thurber 1987 relax the points one by
one; here all move at once) takes the ray to the stationary path, and needs the medium alone.

A path p_0 … p_m has the time F = Σ ½(s_k + s_k+1)·|p_k+1 − p_k|. Each inner point moves in the plane normal
to the path, so that points cannot bunch where the quadrature likes them. The Hessian couples neighbours
only: one factorisation of a block tridiagonal matrix a step. Terms that mix the slope of the slowness at
one point with the shift of another are left out. Lengths are in nodes and times are slowness
times nodes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..arrays import Floats
from ..compiled import kernel
from ..splines.cubic import jet_2d, jet_3d

# Steps of the descent that bending begins with, nodes; it mends what longer ones than ``STEP`` spoil.
STRIDE = 1.5

# A step that promises to lower the time by less than this part ends the bending.
PROMISE = 1e-6

# Steps at most; nearly every ray takes one or two.
MOST = 40

# A step is halved down to this part of it.
LEAST_PART = 0.1

# No point moves farther in a step, nodes: farther off, the medium is another one.
FARTHEST = 2.0

# A shorter piece pulls as one of this length, nodes.
SHORTEST = 1e-3

# A pivot below this part of the path's own tension belongs to no minimum.
LEAST_PIVOT = 1e-9


class Bending(NamedTuple):
    """What is kept of every point, and of the piece from it to the next one.

    Attributes:
        slowness, slope, second: at the point, with derivatives by nodes; (room,), (room, n), (room, n, n).
        vector, length, tension: of the piece: to the next point, its length, mean slowness over length.
        normal: unit vectors across the path, (room, n − 1, n).
        inverse: of the pivot of the elimination, (room, n − 1, n − 1).
        couple: block of the Hessian between the point before and this one, (room, n − 1, n − 1).
        right: the right-hand side as the elimination leaves it, (room, n − 1).
        kept, move: the point before a step, and the step; (room, n).
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
def bending(room: int, shape: tuple[int, ...]) -> Bending:
    """Space for paths of up to ``room`` points in a grid of that shape."""
    n = len(shape)
    return Bending(
        np.empty(room),
        np.empty((room, n)),
        np.empty((room, n, n)),
        np.empty((room, n)),
        np.empty(room),
        np.empty(room),
        np.empty((room, n - 1, n)),
        np.empty((room, n - 1, n - 1)),
        np.empty((room, n - 1, n - 1)),
        np.empty((room, n - 1)),
        np.empty((room, n)),
        np.empty((room, n)),
    )


@kernel(inline="always")
def bend(path: Floats, count: int, spline: Floats, shape: tuple[int, ...], at: Bending) -> tuple[float, int]:
    """Move the inner points of ``path``, in nodes; returns the time along it, spacing 1, and its points.

    The time never rises: a step that would is halved, and given up when that does not help. Where the
    Hessian is not positive (a maximum of slowness, a shock), the path's tension alone stands in for it.

    Args:
        path: (room, ndim); the first and the last of its ``count`` points stay.
        spline: ``splines.coefficients`` of the logarithm of the slowness, which no overshoot makes negative.
        shape: of the grid.
        at: from ``bending``.
    """
    axes = len(shape)
    count = _without_stub(path, count, axes)
    time = _expand(path, count, spline, shape, at)
    promise = 0.0
    for _ in range(MOST):
        promise = _factorise(count, shape, True, at)
        if promise < 0.0:
            promise = _factorise(count, shape, False, at)
        if promise <= PROMISE * time:
            # A path folded back on itself has not even a positive tension; it stays as it is.
            promise = max(promise, 0.0)
            break
        _shift(path, count, shape, at)
        part = 1.0
        after = _expand(path, count, spline, shape, at)
        while after > time and part > LEAST_PART:
            part *= 0.5
            for k in range(1, count - 1):
                for a in range(axes):
                    path[k, a] = at.kept[k, a] + part * at.move[k, a]
            after = _expand(path, count, spline, shape, at)
        promise = 0.0
        if after > time:
            for k in range(1, count - 1):
                for a in range(axes):
                    path[k, a] = at.kept[k, a]
            time = _expand(path, count, spline, shape, at)
            break
        time = after
    # What is left to gain is below the tolerance and known to its square.
    return time - min(promise, PROMISE * time) + _fourth_order(count, shape, at), count


@kernel(inline="always")
def _without_stub(path: Floats, count: int, axes: int) -> int:
    """Let the last step and what it fell short of the source be one piece where the latter is the shorter."""
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
def _expand(path: Floats, count: int, spline: Floats, shape: tuple[int, ...], at: Bending) -> float:
    """Slowness, its slopes and second derivatives at the points; tension, length and vector of the pieces.

    Returns the time along the path.
    """
    axes = len(shape)
    for k in range(count):
        if axes == 2:
            u, gx, gy, xx, xy, yy = jet_2d(spline, path[k, 0], path[k, 1])
            at.slowness[k] = math.exp(u)
            at.slope[k, 0], at.slope[k, 1] = gx, gy
            at.second[k, 0, 0], at.second[k, 0, 1] = xx, xy
            at.second[k, 1, 0], at.second[k, 1, 1] = xy, yy
        else:
            u, gx, gy, gz, xx, xy, xz, yy, yz, zz = jet_3d(spline, path[k, 0], path[k, 1], path[k, axes - 1])
            last = axes - 1
            at.slowness[k] = math.exp(u)
            at.slope[k, 0], at.slope[k, 1], at.slope[k, last] = gx, gy, gz
            at.second[k, 0, 0], at.second[k, 0, 1], at.second[k, 0, last] = xx, xy, xz
            at.second[k, 1, 0], at.second[k, 1, 1], at.second[k, 1, last] = xy, yy, yz
            at.second[k, last, 0], at.second[k, last, 1], at.second[k, last, last] = xz, yz, zz
        # From the logarithm u: ∇s = s·∇u and ∇∇s = s·(∇∇u + ∇u·∇uᵀ).
        for a in range(axes):
            for b in range(axes):
                at.second[k, a, b] += at.slope[k, a] * at.slope[k, b]
                at.second[k, a, b] *= at.slowness[k]
        for a in range(axes):
            at.slope[k, a] *= at.slowness[k]
    time = 0.0
    for k in range(count - 1):
        square = 0.0
        for a in range(axes):
            at.vector[k, a] = path[k + 1, a] - path[k, a]
            square += at.vector[k, a] ** 2
        length = math.sqrt(square)
        mean = 0.5 * (at.slowness[k] + at.slowness[k + 1])
        time += mean * length
        at.tension[k] = mean / max(length, SHORTEST)
        at.length[k] = length
    return time


@kernel(inline="always")
def _normals(k: int, axes: int, at: Bending) -> None:
    """Unit vectors across the path at point k; in space the first follows that of the point before."""
    if axes == 2:
        x = at.vector[k - 1, 0] + at.vector[k, 0]
        y = at.vector[k - 1, 1] + at.vector[k, 1]
        scale = 1.0 / math.sqrt(max(x * x + y * y, 1e-300))
        at.normal[k, 0, 0] = -y * scale
        at.normal[k, 0, 1] = x * scale
        return
    x = at.vector[k - 1, 0] + at.vector[k, 0]
    y = at.vector[k - 1, 1] + at.vector[k, 1]
    z = at.vector[k - 1, axes - 1] + at.vector[k, axes - 1]
    scale = 1.0 / math.sqrt(max(x * x + y * y + z * z, 1e-300))
    x, y, z = x * scale, y * scale, z * scale
    if k > 1:
        u, v, w = at.normal[k - 1, 0, 0], at.normal[k - 1, 0, 1], at.normal[k - 1, 0, axes - 1]
    else:
        u, v, w = 0.0, 0.0, 0.0
    along = u * x + v * y + w * z
    u, v, w = u - along * x, v - along * y, w - along * z
    if u * u + v * v + w * w < 0.1:
        # The first point, or a sharp bend: the axis most across the path.
        u, v, w = 1.0 - x * x, -x * y, -x * z
        if abs(y) <= abs(x) and abs(y) <= abs(z):
            u, v, w = -x * y, 1.0 - y * y, -y * z
        elif abs(z) <= abs(x):
            u, v, w = -x * z, -y * z, 1.0 - z * z
    scale = 1.0 / math.sqrt(u * u + v * v + w * w)
    u, v, w = u * scale, v * scale, w * scale
    at.normal[k, 0, 0], at.normal[k, 0, 1], at.normal[k, 0, axes - 1] = u, v, w
    at.normal[k, 1, 0] = y * w - z * v
    at.normal[k, 1, 1] = z * u - x * w
    at.normal[k, 1, axes - 1] = x * v - y * u


@kernel(inline="always")
def _factorise(count: int, shape: tuple[int, ...], curved: bool, at: Bending) -> float:
    """Forward elimination of the Hessian H and the gradient g; returns ½·gᵀH⁻¹g, or −1 for an H not positive.

    Without ``curved`` the medium's part of H is left out. What remains is the path's tension, which is
    positive for every path that does not fold back on itself.
    """
    medium = 1.0 if curved else 0.0
    axes = len(shape)
    normals = axes - 1
    promise = 0.0
    for k in range(1, count - 1):
        _normals(k, axes, at)
        before, after = at.tension[k - 1], at.tension[k]
        length_before, length_after = at.length[k - 1], at.length[k]
        half = 0.5 * (length_before + length_after)
        tension = before + after
        d00 = d01 = d11 = g0 = g1 = 0.0
        mixed_before = before
        mixed_after = after
        for i in range(normals):
            slope = along_before = along_after = 0.0
            for a in range(axes):
                n = at.normal[k, i, a]
                slope += at.slope[k, a] * n
                along_before += at.vector[k - 1, a] * n
                along_after += at.vector[k, a] * n
            gradient = half * slope + before * along_before - after * along_after
            cos_before = along_before / max(length_before, SHORTEST)
            cos_after = along_after / max(length_after, SHORTEST)
            mixed_before *= cos_before
            mixed_after *= cos_after
            bend_ii = 0.0
            for a in range(axes):
                for b in range(axes):
                    bend_ii += at.normal[k, i, a] * at.second[k, a, b] * at.normal[k, i, b]
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
                    d01 += medium * half * at.normal[k, 0, a] * at.second[k, a, b] * at.normal[k, 1, b]
        # What the elimination of the point before takes off: Cᵀ·S⁻¹·C, with C the coupling to it.
        t00 = t01 = t11 = 0.0
        if k > 1:
            for i in range(normals):
                for j in range(normals):
                    dot = mixed_i = mixed_j = 0.0
                    for a in range(axes):
                        n_i = at.normal[k - 1, i, a]
                        n_j = at.normal[k, j, a]
                        dot += n_i * n_j
                        mixed_i += at.vector[k - 1, a] * n_i
                        mixed_j += at.vector[k - 1, a] * n_j
                    square = max(length_before, SHORTEST) ** 2
                    at.couple[k, i, j] = -before * (dot - mixed_i * mixed_j / square)
            for i in range(normals):
                # Row i of S⁻¹·C, of the point before.
                r0 = r1 = 0.0
                for j in range(normals):
                    s = at.inverse[k - 1, i, j]
                    r0 += s * at.couple[k, j, 0]
                    if normals == 2:
                        r1 += s * at.couple[k, j, 1]
                c0 = at.couple[k, i, 0]
                t00 += c0 * r0
                t01 += c0 * r1
                if normals == 2:
                    t11 += at.couple[k, i, 1] * r1
                # yᵀ·S⁻¹·C
                y = at.right[k - 1, i]
                g0 -= y * r0
                g1 -= y * r1
        least = LEAST_PIVOT * tension
        if normals == 1:
            pivot = d00 - t00
            if pivot <= least:
                return -1.0
            at.inverse[k, 0, 0] = 1.0 / pivot
            at.right[k, 0] = g0
            promise += 0.5 * g0 * g0 * at.inverse[k, 0, 0]
        else:
            p00, p01, p11 = d00 - t00, d01 - t01, d11 - t11
            if p00 <= least or p00 * p11 - p01 * p01 <= least * p00:
                return -1.0
            determinant = p00 * p11 - p01 * p01
            scale = 1.0 / determinant
            last = normals - 1
            at.inverse[k, 0, 0] = p11 * scale
            at.inverse[k, 0, last] = -p01 * scale
            at.inverse[k, last, 0] = -p01 * scale
            at.inverse[k, last, last] = p00 * scale
            at.right[k, 0] = g0
            at.right[k, last] = g1
            promise += 0.5 * scale * (g0 * g0 * p11 - 2.0 * g0 * g1 * p01 + g1 * g1 * p00)
    return promise


@kernel(inline="always")
def _shift(path: Floats, count: int, shape: tuple[int, ...], at: Bending) -> None:
    """Back substitution: keep the points, and move them by −H⁻¹g across the path, inside the grid."""
    axes = len(shape)
    normals = axes - 1
    after0 = after1 = 0.0
    for k in range(count - 2, 0, -1):
        # The right-hand side less what the coupling to the point after gives, then the pivot's inverse.
        for i in range(normals):
            if k < count - 2:
                at.right[k, i] += at.couple[k + 1, i, 0] * after0
                if normals == 2:
                    at.right[k, i] += at.couple[k + 1, i, 1] * after1
        x0 = x1 = 0.0
        for j in range(normals):
            x0 -= at.inverse[k, 0, j] * at.right[k, j]
            if normals == 2:
                x1 -= at.inverse[k, 1, j] * at.right[k, j]
        x0 = min(max(x0, -FARTHEST), FARTHEST)
        x1 = min(max(x1, -FARTHEST), FARTHEST)
        after0, after1 = x0, x1
        for a in range(axes):
            move = x0 * at.normal[k, 0, a]
            if normals == 2:
                move += x1 * at.normal[k, 1, a]
            to = min(max(path[k, a] + move, 0.0), shape[a] - 1.0)
            at.kept[k, a] = path[k, a]
            at.move[k, a] = to - path[k, a]
            path[k, a] = to


@kernel(inline="always")
def _fourth_order(count: int, shape: tuple[int, ...], at: Bending) -> float:
    """What the trapezoids over chords leave out: the arcs, and the change of the slope along each piece.

    A piece of length l that turns by θ is l·θ²/24 longer than its chord. The trapezoid of a function f over
    it is too large by l²/12·(f'(end) − f'(start)) (Euler and Maclaurin); here f' is the slope of the
    slowness along the path.
    """
    axes = len(shape)
    last = count - 1
    more = 0.0
    slope_before, curvature_before = 0.0, 0.0
    for k in range(count):
        # The pieces whose directions give the tangent: those that meet here, at an end the two nearest.
        first, second = max(min(k, last - 1) - 1, 0), min(max(k, 1), last - 1)
        length_first, length_second = max(at.length[first], SHORTEST), max(at.length[second], SHORTEST)
        # Of a circle through them; beyond 0 and 1 at the ends, where it is extrapolated.
        share = length_first / (length_first + length_second)
        if k == 0:
            share = -share
        elif k == last:
            share = 2.0 - length_first / (length_first + length_second)
        slope = dot = square = 0.0
        for a in range(axes):
            u = at.vector[first, a] / length_first
            v = at.vector[second, a] / length_second
            dot += u * v
            tangent = (1.0 - share) * u + share * v
            square += tangent * tangent
            slope += at.slope[k, a] * tangent
        slope /= math.sqrt(max(square, SHORTEST))
        # 2 − 2·cos θ = θ² for small turns.
        turn = math.sqrt(max(2.0 - 2.0 * dot, 0.0))
        curvature = 2.0 * turn / (length_first + length_second)
        if k > 0:
            length = at.length[k - 1]
            angle = 0.5 * length * (curvature_before + curvature)
            more += at.tension[k - 1] * length * length * angle * angle / 24.0
            more -= length * length / 12.0 * (slope - slope_before)
        slope_before, curvature_before = slope, curvature
    return more

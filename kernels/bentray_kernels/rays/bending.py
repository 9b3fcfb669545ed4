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

import math

from ..arrays import Floats
from ..compilation.compiled import kernel
from ..splines.cubic import jet_2d, jet_3d
from .newton_step import MIN_LENGTH, Bending, factorise, shift

# Step of the descent before bending, nodes; bending corrects the error of steps longer than ``STEP``.
STRIDE = 1.5

# Relative decrease of the time, predicted for a step, below which the iteration ends.
TOLERANCE = 1e-6

# Most Newton steps; nearly every ray takes one or two.
MAX_STEPS = 40

# Smallest fraction of a step in the line search.
MIN_FRACTION = 0.1


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
        decrease = factorise(count, shape, True, work)
        if decrease < 0.0:
            decrease = factorise(count, shape, False, work)
        if decrease <= TOLERANCE * time:
            # A path folded back on itself has no positive tension either; it is not changed.
            decrease = max(decrease, 0.0)
            break
        shift(path, count, shape, work)
        part = 1.0
        after = _expand(path, count, spline, shape, work)
        while after > time and part > MIN_FRACTION:
            part *= 0.5
            for k in range(1, count - 1):
                for a in range(axes):
                    path[k, a] = work.before[k, a] + part * work.move[k, a]
            after = _expand(path, count, spline, shape, work)
        decrease = 0.0
        if after > time:
            for k in range(1, count - 1):
                for a in range(axes):
                    path[k, a] = work.before[k, a]
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

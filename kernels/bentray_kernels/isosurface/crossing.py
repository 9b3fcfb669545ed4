"""Ray intersection with iso-surfaces: the first point at which the field along a ray leaves an interval."""

import math
from typing import NamedTuple

from ..arrays import Vector
from ..compilation.compiled import kernel
from ..splines.sampler import Sampler
from .octree import Octree
from .roots import Ray, brent, field_at, first_root_of_cubic, newton

# Root finders within a cell.
CERTAIN, CERTAIN_BRENT, BRENT, ANALYTIC = 0, 1, 2, 3

# Gradient of a crossing that was found without it.
UNKNOWN = (math.nan, math.nan, math.nan)

# Accuracy of a crossing, nodes, and the shortest segment of a ray that is still halved.
TOLERANCE = 1e-9
SHORTEST = 1e-7

# Most halvings of a ray, each with at most two evaluations of the field. Most rays need fewer than ten, a
# grazing one about twenty at each surface, and one through noise, with surfaces everywhere, some hundreds. On
# a plateau of the field at an iso-value they would not end.
MAX_HALVINGS = 512

# How many of them the shortest piece counts for where nothing is proved of it. A ray that touches a surface
# has two or three of these, one along a plateau nothing else.
UNPROVED = 32


class Search(NamedTuple):
    """How crossings are found.

    Attributes:
        roots: ``CERTAIN``: no crossing is missed, however close to the next one; Newton's method.
            ``CERTAIN_BRENT``: the same by Brent's, for trilinear values, whose gradients jump. ``BRENT``: a
            cell is searched if the field at its two ends lies on different sides (dissertation, 4.2.3), which
            misses double crossings at grazing rays. ``ANALYTIC``: the cubic of a trilinear cell.
        top: level of the octree at which the descent begins; 0 is the 3-D DDA through all cells.
        step: length of the steps in nodes, without octree; 0 with it.
    """

    roots: int
    top: int
    step: float


@kernel(inline="always")
def leave_interval(
    field: Sampler,
    octree: Octree,
    search: Search,
    ray: Ray,
    start: float,
    stop: float,
    below: float,
    above: float,
    sought: int,
    slope: float,
    halvings: int,
) -> tuple[float, int, Vector, int]:
    """First s, start < s < stop, where the field is no longer between ``below`` and ``above``.

    A ray is in a layer of the object between two iso-values, the interval. So nested iso-surfaces, entry and
    exit are one search.

    Args:
        field: what is read.
        octree: over its cells.
        search: how.
        ray: within the grid from start to stop.
        start, stop: s.
        below, above: the interval, in which the field lies just after start.
        sought: bits of the two in ``Octree.masks``.
        slope: of the field along the ray at start, per unit of s, if start lies on an iso-surface; else 0.
        halvings: how often a piece of the ray may still be halved.

    Returns:
        s; +1 where the field rises above the interval, −1 where it falls below it, 0 if it does not; the
        gradient there, per node, NaN where it was not needed; and the halvings that are left, −1 where
        more were needed: then nothing is known beyond s.
    """
    speed = math.sqrt(ray.along_x**2 + ray.along_y**2 + ray.along_z**2)
    if search.step > 0.0:
        step = search.step / speed
        root, side, gradient, _, halvings = _scan(
            field, ray, False, speed, start, math.nan, stop, step, 0.0, below, above, halvings
        )
        return root, side, gradient, halvings
    cells_x, cells_y, cells_z = octree.levels[0, 1], octree.levels[0, 2], octree.levels[0, 3]
    i = min(max(int(ray.x + start * ray.along_x), 0), cells_x - 1)
    j = min(max(int(ray.y + start * ray.along_y), 0), cells_y - 1)
    k = min(max(int(ray.z + start * ray.along_z), 0), cells_z - 1)
    # The cell of a surface cannot be skipped, nor can a node about it.
    s, level = start, search.top if slope == 0.0 else 0
    # The field at s, where it is known.
    value = math.nan
    # Of the bound on which the ray starts: how far off the field is at s, and how fast it goes off.
    leaving, near, far = slope != 0.0, 0.0, 0.0
    slowest = fastest = abs(slope)
    while s < stop:
        p, q, r = i >> level, j >> level, k >> level
        node = octree.levels[level, 0] + (p * octree.levels[level, 2] + q) * octree.levels[level, 3] + r
        skipped = octree.masks[node] & sought == 0
        if not skipped and level > 0:
            level -= 1
            continue
        out_x = _way_out(ray.x, ray.over_x, p, level, cells_x)
        out_y = _way_out(ray.y, ray.over_y, q, level, cells_y)
        out_z = _way_out(ray.z, ray.over_z, r, level, cells_z)
        out = max(min(out_x, out_y, out_z), s)
        if not skipped:
            end, bend = min(out, stop), octree.bend[node] * speed * speed
            if leaving:
                length = end - s
                sag = 0.5 * bend * length * length
                least, most = near + slowest * length - sag, far + fastest * length + sag
                # A surface may lie on a face: then all is as it was where the next cell begins.
                on_face = near == 0.0 and length * speed <= SHORTEST
                leaving = on_face or (least > 0.0 and most < above - below)
                if leaving:
                    if not on_face:
                        near, far = least, most
                        slowest, fastest = slowest - bend * length, fastest + bend * length
                    s = end
                    # Where gradients are continuous the next cell begins with this slope.
                    leaving = search.roots == CERTAIN
                elif near == 0.0:
                    s = _turned(s, end, slowest, bend, above - below)
            if s >= end:
                value = math.nan
                root, side, gradient = s, 0, UNKNOWN
            elif search.roots == ANALYTIC:
                root, side, gradient = _solve(field, ray, s, end, below, above)
            else:
                certain = bend if search.roots != BRENT else 0.0
                smooth = search.roots == CERTAIN
                root, side, gradient, value, halvings = _scan(
                    field, ray, smooth, speed, s, value, end, end - s, certain, below, above, halvings
                )
            if side != 0 or halvings < 0:
                return root, side, gradient, halvings
        else:
            value, leaving = math.nan, False
        s = out
        # The axis of the face moves to the next node; rounding must not carry the others out of theirs.
        by_x = out_x <= out_y and out_x <= out_z
        by_y = not by_x and out_y <= out_z
        before = p if by_x else (q if by_y else r)
        along = ray.along_x if by_x else (ray.along_y if by_y else ray.along_z)
        after = (before + 1) << level if along > 0.0 else (before << level) - 1
        if after < 0 or after >= (cells_x if by_x else (cells_y if by_y else cells_z)):
            break
        i = after if by_x else _within(ray.x + s * ray.along_x, p, level, cells_x)
        j = after if by_y else _within(ray.y + s * ray.along_y, q, level, cells_y)
        k = _within(ray.z + s * ray.along_z, r, level, cells_z) if by_x or by_y else after
        # Above the highest level at which the node changed, nothing is new.
        changed = (after >> level) ^ before
        while changed > 1 and level < search.top:
            changed >>= 1
            level += 1
    return stop, 0, UNKNOWN, halvings


@kernel(inline="always")
def _turned(s: float, end: float, slope: float, bend: float, height: float) -> float:
    """Where the field is surely off one of the interval's bounds, s, which it leaves with a slope.

    Within slope·h ± bend·h²/2 of that bound, it can be back only where bend·h reaches 2·slope, and at the
    other bound only where the rise reaches the height. Half as far it is farthest off.
    """
    return min(s + slope / max(bend, 2.0 * slope * slope / height), end)


@kernel(inline="always")
def _way_out(start: float, over: float, node: int, level: int, cells: int) -> float:
    """s of the face at which the ray leaves a node of the octree along one axis; infinity if none."""
    if math.isinf(over):
        return math.inf
    face = min((node + 1) << level, cells) if over > 0.0 else node << level
    return (face - start) * over


@kernel(inline="always")
def _within(place: float, node: int, level: int, cells: int) -> int:
    """The cell at a place, kept within a node of the octree."""
    return min(max(int(place), node << level), min(((node + 1) << level), cells) - 1)


@kernel(inline="always")
def _scan(
    field: Sampler,
    ray: Ray,
    smooth: bool,
    speed: float,
    start: float,
    value: float,
    stop: float,
    step: float,
    bend: float,
    below: float,
    above: float,
    halvings: int,
) -> tuple[float, int, Vector, float, int]:
    """The first way out of the interval between start and stop, in steps that are halved where in doubt.

    Over a length h the field departs from its chord by at most bend·h²/8. So it stays in the interval where
    both ends are farther than that from its bounds, and is monotone where the ends differ by more than
    bend·h²/2: then one crossing lies between them.

    Args:
        smooth: whether the gradient is the values' own.
        value: the field at start, NaN where unknown.
        halvings: as in ``leave_interval``.

    Returns:
        As ``leave_interval``, with the field where the search ended before the halvings that are left.
    """
    a = start
    if math.isnan(value):
        value = field_at(field, ray, a)
    value_a = min(max(value, below), above)
    length = step
    while a < stop:
        b = min(a + length, stop)
        value_b = field_at(field, ray, b)
        sag = 0.125 * bend * (b - a) ** 2
        inside = below < value_b < above
        if inside and min(min(value_a, value_b) - below, above - max(value_a, value_b)) >= sag:
            a, value_a = b, value_b
            length = min(2.0 * length, step)
        elif not inside and (abs(value_b - value_a) >= 4.0 * sag or (b - a) * speed <= SHORTEST):
            target, side = (above, 1) if value_b >= above else (below, -1)
            # Where the field stays on the bound, Newton's method has no slope to follow.
            if smooth and abs(value_b - value_a) > 4.0 * sag:
                root, gradient = newton(field, ray, target, a, value_a, b, value_b, bend, TOLERANCE / speed)
            else:
                root = brent(field, ray, target, a, value_a, b, value_b, TOLERANCE / speed)
                gradient = UNKNOWN
            return root, side, gradient, target, halvings
        else:
            shortest = (b - a) * speed <= SHORTEST
            halvings -= UNPROVED if shortest else 1
            if halvings < 0:
                return a, 0, UNKNOWN, value_a, -1
            if shortest:
                a, value_a = b, value_b
                length = min(2.0 * length, step)
            else:
                length = 0.5 * (b - a)
    return stop, 0, UNKNOWN, value_a, halvings


@kernel(inline="always")
def _solve(
    field: Sampler, ray: Ray, start: float, stop: float, below: float, above: float
) -> tuple[float, int, Vector]:
    """Root in a trilinear cell, whose field along the ray is the cubic through four values."""
    third = (stop - start) / 3.0
    f0, f1 = field_at(field, ray, start), field_at(field, ray, start + third)
    f2, f3 = field_at(field, ray, start + 2.0 * third), field_at(field, ray, stop)
    c1 = 0.5 * (-11.0 * f0 + 18.0 * f1 - 9.0 * f2 + 2.0 * f3)
    c2 = 4.5 * (2.0 * f0 - 5.0 * f1 + 4.0 * f2 - f3)
    c3 = 4.5 * (-f0 + 3.0 * f1 - 3.0 * f2 + f3)
    rising = first_root_of_cubic(f0 - above, c1, c2, c3) if above < math.inf else math.inf
    falling = first_root_of_cubic(f0 - below, c1, c2, c3) if below > -math.inf else math.inf
    first = min(rising, falling)
    if first > 1.0 + 1e-12:
        return stop, 0, UNKNOWN
    return start + first * 3.0 * third, 1 if rising < falling else -1, UNKNOWN
